# keyFolder.tcl -- the folder of keys, read and written by those who make keys and those who look at them. It knows no bus.
#
# See generic/comm/keys.h for its files. The program openssl makes and reads them.

package provide sorma::keyFolder 1.0

namespace eval ::sorma::keyFolder {}

# ::sorma::keyFolder::folder -- where it is.
proc ::sorma::keyFolder::folder {} {
    global env
    foreach {variable ending} {SORMA_KEYS {} XDG_CONFIG_HOME sorma/keys HOME .config/sorma/keys} {
        if {[info exists env($variable)] && $env($variable) ne {}} {
            return [file join $env($variable) {*}[file split $ending]]
        }
    }
    return -code error "there is no home: set SORMA_KEYS to a folder"
}

# ::sorma::keyFolder::path NAME -- a file of it.
proc ::sorma::keyFolder::path name {
    return [file join [folder] $name]
}

# ::sorma::keyFolder::text FILE -- what is in it.
proc ::sorma::keyFolder::text file {
    set in [open $file]
    try {
        return [read $in]
    } finally {
        close $in
    }
}

# ::sorma::keyFolder::write FILE TEXT -- replace it at once: a daemon that looks has the old one, or the new one.
proc ::sorma::keyFolder::write {file text} {
    set new $file.[pid].new
    file delete $new
    set out [open $new {WRONLY CREAT EXCL} 0600]
    try {
        puts -nonewline $out $text
        close $out
        file rename -force $new $file
    } on error {message options} {
        file delete $new
        return -options $options $message
    }
}

# ::sorma::keyFolder::names -- of our own certificates.
proc ::sorma::keyFolder::names {} {
    return [lsort [lmap file [glob -nocomplain -tails -directory [folder] *.pem] {
        set name [file rootname $file]
        if {$name in {authority trusted crl}} continue
        set name
    }]]
}

# ::sorma::keyFolder::own -- the name that this host has; empty: none.
proc ::sorma::keyFolder::own {} {
    return [if {[file exists [path own]]} {lindex [split [text [path own]]] 0}]
}

# ::sorma::keyFolder::exposed FILE ?RIGHTS? -- may others read or write it, or what RIGHTS say, as in 022?
proc ::sorma::keyFolder::exposed {file {rights 077}} {
    return [expr {([file attributes $file -permissions] & "0o$rights") != 0}]
}

# ::sorma::keyFolder::pins -- the daemons that are never spoken to in clear: a dict of names, each with its date.
proc ::sorma::keyFolder::pins {} {
    set pins {}
    if {[file exists [path pins]]} {
        foreach line [split [text [path pins]] \n] {
            if {[regexp {^(\S+)\s+(\S+)} $line -> name date] && ![dict exists $pins $name]} {
                dict set pins $name $date
            }
        }
    }
    return $pins
}

# ---- what openssl says ----

# ::sorma::keyFolder::openssl WORDS ?INPUT? ?TEXT ...? --
#       Run it with this input. Each FILE{n} of the words stands for a file with one of the texts. Nobody else may read it.
proc ::sorma::keyFolder::openssl {words {input {}} args} {
    if {[auto_execok openssl] eq {}} {
        return -code error "the program openssl is not there: install openssl"
    }
    set files {}
    set places {}
    try {
        foreach text $args {
            set file [path .[pid].[llength $files]]
            file delete $file
            write $file $text
            lappend places FILE[llength $files] $file
            lappend files $file
        }
        set words [lmap word $words {string map $places $word}]
        return [exec -ignorestderr -keepnewline openssl {*}$words << $input 2>@1]
    } on error message {
        return -code error "openssl [lindex $words 0]: [string trim [lindex [split $message \n] 0]]"
    } finally {
        file delete {*}$files
    }
}

# ::sorma::keyFolder::about CERTIFICATE -- a dict of its name, organisation, serial, and from and until [s since 1970].
proc ::sorma::keyFolder::about certificate {
    set said [openssl {x509 -noout -subject -serial -startdate -enddate -nameopt RFC2253} $certificate]
    foreach {key pattern} {name {CN=([^,\n]*)} organisation {O=([^,\n]*)} serial {serial=(\S+)} from {notBefore=([^\n]*)} until {notAfter=([^\n]*)}} {
        set value {}
        regexp $pattern $said -> value
        dict set about $key [expr {$key in {from until} ? [clock scan [string map {GMT UTC} $value]] : $value}]
    }
    return $about
}

# ::sorma::keyFolder::hosts CERTIFICATE -- the names and addresses that it is made for, in lower case.
proc ::sorma::keyFolder::hosts certificate {
    set said [openssl {x509 -noout -ext subjectAltName} $certificate]
    set names {}
    foreach {- name} [regexp -all -inline {(?:DNS|IP Address):([^,\s]+)} $said] {
        dict set names [string tolower $name] 1
    }
    return [expr {$names eq {} ? [list [string tolower [dict get [about $certificate] name]]] : [dict keys $names]}]
}

# ::sorma::keyFolder::parts KIND TEXT -- the certificates, keys or lists that are in the text of a file.
proc ::sorma::keyFolder::parts {kind text} {
    return [regexp -all -inline -- "-----BEGIN $kind-----.*?-----END $kind-----\n?" $text]
}

# ::sorma::keyFolder::authorities ?FILE ...? -- the certificates of those that this host knows, or that are in these files of the folder.
proc ::sorma::keyFolder::authorities args {
    set all {}
    foreach name [expr {$args eq {} ? {authority.pem trusted.pem} : $args}] {
        if {[file exists [path $name]]} {
            lappend all {*}[parts CERTIFICATE [text [path $name]]]
        }
    }
    return $all
}

# ::sorma::keyFolder::fits KEY CERTIFICATE -- is it the key of this certificate?
proc ::sorma::keyFolder::fits {key certificate} {
    return [expr {[openssl {x509 -noout -pubkey} $certificate] eq [openssl {pkey -pubout -in FILE0} {} $key]}]
}

# ::sorma::keyFolder::vouched CERTIFICATE AUTHORITIES -- has one of them signed it? When it ends does not matter.
proc ::sorma::keyFolder::vouched {certificate authorities} {
    return [expr {![catch {openssl {verify -no_check_time -CAfile FILE0 FILE1} {} [join $authorities \n] $certificate}]}]
}

# ::sorma::keyFolder::listEnd LIST -- by when a list of revoked certificates has a newer one [s since 1970]; far away when it does not say.
proc ::sorma::keyFolder::listEnd list {
    return [if {[regexp {nextUpdate=(\w+ [^\n]*)} [openssl {crl -noout -nextupdate} $list] -> date]} {clock scan [string map {GMT UTC} $date]} else {expr {1 << 40}}]
}

# ::sorma::keyFolder::signed LIST AUTHORITIES -- has one of them signed this list of revoked certificates?
proc ::sorma::keyFolder::signed {list authorities} {
    file tempfile file sorma-authority
    try {
        foreach authority $authorities {
            set out [open $file w]
            puts -nonewline $out $authority
            close $out
            if {![catch {openssl [list crl -noout -CAfile $file] $list} said] && [string match "*verify OK*" $said]} {
                return 1
            }
        }
        return 0
    } finally {
        file delete $file
    }
}

# ::sorma::keyFolder::date SECONDS -- as a day, for people.
proc ::sorma::keyFolder::date seconds {
    return [clock format $seconds -format %Y-%m-%d -timezone :UTC]
}
