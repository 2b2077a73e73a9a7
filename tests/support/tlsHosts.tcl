# tlsHosts.tcl -- clients and daemons of hosts that have keys, and a proxy between them. keys.tcl is sourced before.

# A client of its own, with the keys of a host: evaluate a script in it. entry: what its dictionary says of @cell.
proc client {host entry script} {
    set other [interp create]
    try {
        $other eval {package require sorma}
        $other eval [list set auto_path $::auto_path]
        $other eval [list sorma::so::dict CTRL -add @cell {*}$entry]
        $other eval [list proc failure script [info body failure]]
        return [at $host [list $other eval $script]]
    } finally {
        interp delete $other
    }
}

# The code of a failed call of that host. The message must have these words.
proc refused {host entry args} {
    lassign [client $host $entry {failure {echo@cell EXEC TMSG hello}}] code message
    foreach word $args {
        if {[string first $word $message] < 0} {
            return "$code, and no \"$word\": $message"
        }
    }
    return [lrange $code 0 1]
}

proc serve {host args} {
    return [at $host [list daemon start -tcp 1 {*}$args]]
}
proc port d {
    return 127.0.0.1:[daemon info $d port]
}

# A key and a certificate for cell that the authority of a host signs, with dates as openssl wants them: into another folder.
proc signed {host into from until {name cell}} {
    global folder
    set ca [file join $folder $host]
    set work [file join $folder work]
    file delete -force $work
    file mkdir $work
    set out [open $work/config w]
    puts $out "\[ca\]\ndefault_ca=all\n\[all\]\nnew_certs_dir=$work\ndatabase=$work/index\nrand_serial=yes\ndefault_md=sha256\npolicy=any\nunique_subject=no
\[any\]\norganizationName=optional\ncommonName=supplied\n\[more\]\nsubjectAltName=DNS:$name\nbasicConstraints=CA:FALSE\n\[req\]\ndistinguished_name=name\n\[name\]"
    close $out
    close [open $work/index w]
    exec openssl req -new -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -config $work/config -keyout $work/key -subj /O=lab/CN=$name -out $work/request 2>@1
    exec openssl ca -batch -config $work/config -extensions more -cert $ca/authority.pem -keyfile $ca/authority.key -startdate $from -enddate $until \
        -in $work/request -out $work/certificate -notext 2>@1
    set target [file join $folder $into]
    file mkdir $target
    file copy -force $ca/authority.pem $target/authority.pem
    set out [open $target/$name.pem {WRONLY CREAT TRUNC} 0600]
    foreach part {key certificate} {
        set in [open $work/$part]
        puts $out [read $in]
        close $in
    }
    close $out
    set out [open $target/own w]
    puts $out $name
    close $out
}

# A proxy as support/tlsProxy.tcl says; heard: what clients, or another side, have said to it.
proc proxy {d how {bytes 0}} {
    set pipe [open [list | [info nameofexecutable] [file join $::supportFolder tlsProxy.tcl] [daemon info $d port] $how $bytes] r+]
    fconfigure $pipe -buffering line
    return [list $pipe [gets $pipe]]
}
proc heard {proxy args} {
    puts [lindex $proxy 0] $args
    return [binary decode hex [gets [lindex $proxy 0]]]
}
