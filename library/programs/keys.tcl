# keys.tcl -- the program sorma-keys: makes and brings the keys with which daemons and their clients know each other.
#
# See generic/comm/keys.h for the files of the folder. The program openssl makes and reads them.

package require sorma
package require sorma::commandLine
package require sorma::keyFolder
package require sorma::text
package provide sorma::keys 1.0

namespace eval ::sorma::keys {
    variable Options {-days {{whole 1 36500}}}
    variable Commands {new-authority {name} new {name} give {name ?file?} take {file} list {} revoke {name} forget {name} import {certificate key ?authority?}}
    variable Days {authority 3650 name 825}     ;# that a certificate holds, unless -days says it
}

# ::sorma::keys::main WORDS -- run the program: the exit code.
proc ::sorma::keys::main words {
    variable Options
    return [::sorma::commandLine::run sorma-keys $Options $words ::sorma::keys::Run -check ::sorma::keys::Check -complete ::sorma::keys::Complete]
}
proc ::sorma::keys::Check {settings words} {
    variable Commands
    set rest [lassign $words command]
    if {![dict exists $Commands $command]} {
        error "expected [join [dict keys $Commands] {, }], got \"$command\"[::sorma::DidYouMean $command [dict keys $Commands]]"
    }
    set takes [dict get $Commands $command]
    set least [llength [lsearch -all -not $takes {\?*}]]
    if {[llength $rest] < $least || [llength $rest] > [llength $takes]} {
        error "$command expects [expr {$takes eq {} ? {nothing more} : [join $takes]}], got \"[join $rest]\""
    }
}
proc ::sorma::keys::Run {settings words} {
    set rest [lassign $words command]
    file mkdir [::sorma::keyFolder::folder]
    file attributes [::sorma::keyFolder::folder] -permissions 0700
    puts -nonewline [[dict get {
        new-authority NewAuthority new New give Give take Take list List revoke Revoke forget Forget import Import
    } $command] {*}$rest [dict get $settings -days]]
}
proc ::sorma::keys::Complete words {
    variable Commands
    return [if {[llength $words] <= 1} {dict keys $Commands} else {::sorma::keyFolder::names}]
}

# ---- the folder ----

proc ::sorma::keys::CheckName name {
    if {![regexp {^[A-Za-z0-9_][A-Za-z0-9_.-]{0,62}$} $name]} {
        return -code error "\"$name\" is no name: letters, digits, _ - and . only, as an alias of the dictionary has"
    }
    if {$name in {authority trusted crl own pins revoked issued}} {
        return -code error "\"$name\" is a file of the folder; choose another name"
    }
}

# ---- openssl ----

proc ::sorma::keys::NewKey {} {
    return [::sorma::keyFolder::openssl {genpkey -algorithm EC -pkeyopt ec_paramgen_curve:P-256}]
}

# ---- the commands ----

proc ::sorma::keys::NewAuthority {name days} {
    variable Days
    CheckName $name
    if {[file exists [::sorma::keyFolder::path authority.pem]]} {
        return -code error "[::sorma::keyFolder::path authority.pem] is there already, of [dict get [::sorma::keyFolder::about [::sorma::keyFolder::text [::sorma::keyFolder::path authority.pem]]] organisation]; remove it first if nobody needs it any more"
    }
    set key [NewKey]
    set certificate [::sorma::keyFolder::openssl [list req -x509 -new -key FILE0 -config FILE1 -days [expr {$days eq {} ? [dict get $Days authority] : $days}]] {} $key \
        "\[req\]\ndistinguished_name=name\nprompt=no\nx509_extensions=more\n\[name\]\nO=$name\nCN=$name authority\n\[more\]
basicConstraints=critical,CA:TRUE,pathlen:0\nkeyUsage=critical,keyCertSign,cRLSign\nsubjectKeyIdentifier=hash\n"]
    ::sorma::keyFolder::write [::sorma::keyFolder::path authority.key] $key
    ::sorma::keyFolder::write [::sorma::keyFolder::path authority.pem] $certificate
    return "authority $name, until [::sorma::keyFolder::date [dict get [::sorma::keyFolder::about $certificate] until]]: [::sorma::keyFolder::path authority.key] stays on this host; keep a copy in a safe place\n"
}

# A key and a certificate of our authority: the text of a file.
proc ::sorma::keys::Make {name days} {
    variable Days
    CheckName $name
    foreach file {authority.key authority.pem} {
        if {![file exists [::sorma::keyFolder::path $file]]} {
            return -code error "there is no [::sorma::keyFolder::path $file]: sorma-keys new-authority NAME makes one; on another host than the authority's: sorma-keys take FILE"
        }
    }
    set lab [dict get [::sorma::keyFolder::about [::sorma::keyFolder::text [::sorma::keyFolder::path authority.pem]]] organisation]
    set key [NewKey]
    set request [::sorma::keyFolder::openssl {req -new -key FILE0 -config FILE1} {} $key "\[req\]\ndistinguished_name=name\nprompt=no\n\[name\]\nO=$lab\nCN=$name\n"]
    set certificate [::sorma::keyFolder::openssl [list x509 -req -in FILE0 -CA [::sorma::keyFolder::path authority.pem] -CAkey [::sorma::keyFolder::path authority.key] -extfile FILE1 -set_serial 0x[Serial] \
        -days [expr {$days eq {} ? [dict get $Days name] : $days}]] {} $request \
        "basicConstraints=critical,CA:FALSE\nkeyUsage=critical,digitalSignature\nextendedKeyUsage=serverAuth,clientAuth\nsubjectAltName=DNS:$name[expr {[regexp {^\d+(\.\d+){3}$} $name] ? ",IP:$name" : {}}]\n"]
    set certificate [lindex [::sorma::keyFolder::parts CERTIFICATE $certificate] 0]
    file mkdir [::sorma::keyFolder::path issued]
    ::sorma::keyFolder::write [::sorma::keyFolder::path issued/$name.[dict get [::sorma::keyFolder::about $certificate] serial].pem] $certificate
    return [list $key $certificate]
}

# 16 bytes nobody can guess; the first one keeps it positive.
proc ::sorma::keys::Serial {} {
    set in [open /dev/urandom rb]
    try {
        binary scan [read $in 15] H* digits
    } finally {
        close $in
    }
    return 4d$digits
}

proc ::sorma::keys::New {name days} {
    lassign [Make $name $days] key certificate
    ::sorma::keyFolder::write [::sorma::keyFolder::path $name.pem] $key$certificate
    Own $name
    return "$name, until [::sorma::keyFolder::date [dict get [::sorma::keyFolder::about $certificate] until]]: [::sorma::keyFolder::path $name.pem]\n"
}

# The first name that a host has is its own; a daemon with another name shows its own certificate, if there is one.
proc ::sorma::keys::Own name {
    if {![file exists [::sorma::keyFolder::path own]]} {
        ::sorma::keyFolder::write [::sorma::keyFolder::path own] $name\n
    }
}

proc ::sorma::keys::Passphrase again {
    global env
    if {[info exists env(SORMA_PASSPHRASE)]} {
        return $env(SORMA_PASSPHRASE)
    }
    if {![::sorma::text::isTerminal stdin]} {
        return -code error "a passphrase is asked for at a terminal, or taken from SORMA_PASSPHRASE"
    }
    set said {}
    exec stty -echo <@stdin
    try {
        foreach question [expr {$again ? {{passphrase for the file: } {the same again: }} : {{passphrase of the file: }}}] {
            puts -nonewline stderr $question
            lappend said [gets stdin]
            puts stderr {}
        }
    } finally {
        exec stty echo <@stdin
    }
    if {[llength [lsort -unique $said]] != 1} {
        return -code error "these are two different passphrases"
    }
    return [lindex $said 0]
}

proc ::sorma::keys::WithPassphrase {again words args} {
    global env
    set text [Passphrase $again]
    if {$again && [string length $text] < 8} {
        return -code error "the passphrase has [string length $text] characters; it protects a key, and needs 8"
    }
    set env(SORMA_KEYS_PASSPHRASE) $text
    try {
        return [::sorma::keyFolder::openssl [list {*}$words -pass[expr {$again ? "out" : "in"}] env:SORMA_KEYS_PASSPHRASE] {} {*}$args]
    } finally {
        unset env(SORMA_KEYS_PASSPHRASE)
    }
}

proc ::sorma::keys::Give {name args} {
    set file [expr {[llength $args] > 1 ? [lindex $args 0] : "$name.keys"}]
    if {[file exists $file]} {
        return -code error "$file is there already; choose another file"
    }
    lassign [Make $name [lindex $args end]] key certificate
    close [open $file {WRONLY CREAT EXCL} 0600]
    try {
        WithPassphrase 1 [list pkcs12 -export -inkey FILE0 -in FILE1 -certfile [::sorma::keyFolder::path authority.pem] -name $name -out $file] $key $certificate
    } on error {message options} {
        file delete $file
        return -options $options $message
    }
    return "$name, until [::sorma::keyFolder::date [dict get [::sorma::keyFolder::about $certificate] until]]: bring $file there, and: sorma-keys take $file\n"
}

proc ::sorma::keys::Take {file days} {
    set all [if {$file eq "-"} {read stdin} else {WithPassphrase 0 [list pkcs12 -nodes -in $file]}]
    set key [lindex [::sorma::keyFolder::parts {PRIVATE KEY} $all] 0]
    set certificates [::sorma::keyFolder::parts CERTIFICATE $all]
    if {$key eq {} || [llength $certificates] < 2} {
        return -code error "$file holds no key with its certificate and authority; sorma-keys give makes such files"
    }
    return [Accept $key [lindex $certificates 0] [lindex $certificates end] authority.pem]
}

# ::sorma::keys::stream NAME -- a new key, its certificate and our authority, for "sorma-keys take -" on another host. Nothing protects it.
proc ::sorma::keys::stream name {
    return [join [Make $name {}] {}][::sorma::keyFolder::text [::sorma::keyFolder::path authority.pem]]
}

# Put them into the folder. An authority that is there already is never replaced: the user decides whom to trust.
proc ::sorma::keys::Accept {key certificate authority into} {
    set about [::sorma::keyFolder::about $certificate]
    set name [dict get $about name]
    CheckName $name
    ::sorma::keyFolder::openssl {verify -CAfile FILE0 FILE1} {} $authority $certificate
    if {![::sorma::keyFolder::fits $key $certificate]} {
        return -code error "the key is not that of the certificate"
    }
    if {$authority ne {} && $into eq "authority.pem" && [file exists [::sorma::keyFolder::path $into]]} {
        if {[lindex [::sorma::keyFolder::parts CERTIFICATE [::sorma::keyFolder::text [::sorma::keyFolder::path $into]]] 0] ne [string trimright $authority \n] && [string trim [::sorma::keyFolder::text [::sorma::keyFolder::path $into]]] ne [string trim $authority]} {
            return -code error "[::sorma::keyFolder::path $into] is there already, of another authority ([dict get [::sorma::keyFolder::about [::sorma::keyFolder::text [::sorma::keyFolder::path $into]]] organisation]); remove it first if it is to be replaced"
        }
    } elseif {$into eq "trusted.pem" && [file exists [::sorma::keyFolder::path $into]]} {
        if {[string first [string trim $authority] [::sorma::keyFolder::text [::sorma::keyFolder::path $into]]] < 0} {
            ::sorma::keyFolder::write [::sorma::keyFolder::path $into] [::sorma::keyFolder::text [::sorma::keyFolder::path $into]]$authority\n
        }
    } else {
        ::sorma::keyFolder::write [::sorma::keyFolder::path $into] [string trimright $authority \n]\n
    }
    ::sorma::keyFolder::write [::sorma::keyFolder::path $name.pem] [string trimright $key \n]\n[string trimright $certificate \n]\n
    Own $name
    return "$name, until [::sorma::keyFolder::date [dict get $about until]]: [::sorma::keyFolder::path $name.pem]\n"
}

# Keys of a site's authority: who has one is known by it, and may what the policy says.
proc ::sorma::keys::Import {certificate key args} {
    set certificates [::sorma::keyFolder::parts CERTIFICATE [::sorma::keyFolder::text $certificate]]
    set authority [if {[llength $args] > 1} {lindex [::sorma::keyFolder::parts CERTIFICATE [::sorma::keyFolder::text [lindex $args 0]]] 0} else {lindex $certificates end}]
    if {$certificates eq {} || $authority eq {}} {
        return -code error "$certificate holds no certificate, or that of its authority is missing"
    }
    set secret [::sorma::keyFolder::openssl {pkey -in FILE0} {} [::sorma::keyFolder::text $key]]
    return [Accept $secret [lindex $certificates 0] $authority trusted.pem]
}

proc ::sorma::keys::List days {
    set rows {}
    foreach file [list authority trusted {*}[::sorma::keyFolder::names]] {
        if {![file exists [::sorma::keyFolder::path $file.pem]]} continue
        foreach certificate [::sorma::keyFolder::parts CERTIFICATE [::sorma::keyFolder::text [::sorma::keyFolder::path $file.pem]]] {
            set about [::sorma::keyFolder::about $certificate]
            set left [expr {([dict get $about until] - [clock seconds]) / 86400}]
            lappend rows "[format %-20s [dict get $about name]] [format %-12s [dict get $about organisation]] until [::sorma::keyFolder::date [dict get $about until]], [expr {
                [dict get $about until] < [clock seconds] ? {EXPIRED} : [dict get $about from] > [clock seconds] + 300 ? {NOT YET VALID} : "$left days left"
            }], $file.pem[expr {$file ni {authority trusted} && [::sorma::keyFolder::exposed [::sorma::keyFolder::path $file.pem]] ? {, OTHERS MAY READ THE KEY} : {}}]\n"
        }
    }
    if {$rows eq {}} {
        return "[::sorma::keyFolder::folder] holds no keys: sorma-keys new-authority NAME, or sorma-keys take FILE\n"
    }
    return [join $rows {}]
}

proc ::sorma::keys::Revoke {name days} {
    set lines {}
    foreach file [glob -nocomplain -directory [::sorma::keyFolder::path issued] $name.*.pem] {
        set about [::sorma::keyFolder::about [::sorma::keyFolder::text $file]]
        if {[dict get $about name] eq $name && [dict get $about until] > [clock seconds]} {
            lappend lines "[dict get $about serial] $name, on [::sorma::keyFolder::date [clock seconds]]"
        }
    }
    if {$lines eq {}} {
        return -code error "no certificate for $name that holds was made here; where another authority has made it: a line \"revoke $name\" in the policy of the daemons"
    }
    set before [expr {[file exists [::sorma::keyFolder::path revoked]] ? [::sorma::keyFolder::text [::sorma::keyFolder::path revoked]] : {}}]
    set lines [lmap line $lines {
        if {[string first [lindex $line 0] $before] >= 0} continue
        set line
    }]
    ::sorma::keyFolder::write [::sorma::keyFolder::path revoked] $before[join $lines \n][expr {$lines eq {} ? {} : "\n"}]
    return "$name is revoked on this host; on others: copy [::sorma::keyFolder::path revoked] there, or write \"revoke $name\" into their policy\n"
}

proc ::sorma::keys::Forget {name days} {
    set before [expr {[file exists [::sorma::keyFolder::path pins]] ? [split [string trim [::sorma::keyFolder::text [::sorma::keyFolder::path pins]]] \n] : {}}]
    set left [lsearch -all -inline -not -glob $before "$name *"]
    if {[llength $left] == [llength $before]} {
        return -code error "no daemon \"$name\" was reached with TLS"
    }
    ::sorma::keyFolder::write [::sorma::keyFolder::path pins] [join $left \n][expr {$left eq {} ? {} : "\n"}]
    return "$name may be spoken to in clear again\n"
}
