# keys.tcl -- the program sorma-keys: makes and brings the keys with which daemons and their clients know each other.
#
# See generic/comm/keys.h for the files of the folder. The program openssl makes and reads them.

package require sorma
package require sorma::options
package require sorma::usage
package provide sorma::keys 1.0

namespace eval ::sorma::keys {
    variable Options {-days {{whole 1 36500}} -help flag --help flag -h flag}
    variable Commands {new-authority {name} new {name} give {name ?file?} take {file} list {} revoke {name} forget {name} import {certificate key ?authority?}}
    variable Days {authority 3650 name 825}     ;# that a certificate holds, unless -days says it
}

# ::sorma::keys::main WORDS -- run the program: the exit code.
proc ::sorma::keys::main words {
    ::sorma::options::suggest ::sorma::DidYouMean
    variable Options
    variable Commands
    if {[lindex $words 0] eq "--complete"} {
        puts [join [lsearch -all -inline -glob [expr {[llength $words] <= 2 ? [dict keys $Commands] : [Names]}] [lindex $words end]*] \n]
        return 0
    }
    try {
        set rest {}
        set settings [::sorma::options::parse $Options $words rest]
        if {[dict get $settings -help] || [dict get $settings --help] || [dict get $settings -h]} {
            puts [::sorma::usage::program sorma-keys]
            return 0
        }
        set rest [lassign $rest command]
        if {![dict exists $Commands $command]} {
            error "expected [join [dict keys $Commands] {, }], got \"$command\"[::sorma::DidYouMean $command [dict keys $Commands]]"
        }
        set takes [dict get $Commands $command]
        set least [llength [lsearch -all -not $takes {\?*}]]
        if {[llength $rest] < $least || [llength $rest] > [llength $takes]} {
            error "$command expects [expr {$takes eq {} ? {nothing more} : [join $takes]}], got \"[join $rest]\""
        }
    } on error message {
        puts stderr "sorma-keys: $message\n[::sorma::usage::program sorma-keys]"
        return 2
    }
    try {
        file mkdir [Folder]
        file attributes [Folder] -permissions 0700
        puts -nonewline [[dict get {
            new-authority NewAuthority new New give Give take Take list List revoke Revoke forget Forget import Import
        } $command] {*}$rest [dict get $settings -days]]
    } on error message {
        puts stderr "sorma-keys: $message"
        return 1
    }
    return 0
}

# ---- the folder ----

proc ::sorma::keys::Folder {} {
    global env
    foreach {variable ending} {SORMA_KEYS {} XDG_CONFIG_HOME sorma/keys HOME .config/sorma/keys} {
        if {[info exists env($variable)] && $env($variable) ne {}} {
            return [file join $env($variable) {*}[file split $ending]]
        }
    }
    return -code error "there is no home: set SORMA_KEYS to a folder"
}

proc ::sorma::keys::Path name {
    return [file join [Folder] $name]
}

proc ::sorma::keys::Read file {
    set in [open $file]
    try {
        return [read $in]
    } finally {
        close $in
    }
}

# Replace a file at once: a daemon that looks has the old one, or the new one.
proc ::sorma::keys::Write {file text} {
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

# Names of our own certificates.
proc ::sorma::keys::Names {} {
    return [lsort [lmap file [glob -nocomplain -tails -directory [Folder] *.pem] {
        set name [file rootname $file]
        if {$name in {authority trusted crl}} continue
        set name
    }]]
}

proc ::sorma::keys::CheckName name {
    if {![regexp {^[A-Za-z0-9_][A-Za-z0-9_.-]{0,62}$} $name]} {
        return -code error "\"$name\" is no name: letters, digits, _ - and . only, as an alias of the dictionary has"
    }
    if {$name in {authority trusted crl own pins revoked issued}} {
        return -code error "\"$name\" is a file of the folder; choose another name"
    }
}

# ---- openssl ----

# Run it with this input, and with texts of files that only it may read: each FILE{n} of the words stands for one.
proc ::sorma::keys::Openssl {words {input {}} args} {
    if {[auto_execok openssl] eq {}} {
        return -code error "the program openssl is not there: install openssl"
    }
    set files {}
    set places {}
    try {
        foreach text $args {
            set file [Path .[pid].[llength $files]]
            file delete $file
            Write $file $text
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

# Read a certificate: dict with name, organisation, serial, from, until (s since 1970).
proc ::sorma::keys::About certificate {
    set said [Openssl {x509 -noout -subject -serial -startdate -enddate -nameopt RFC2253} $certificate]
    foreach {key pattern} {name {CN=([^,\n]*)} organisation {O=([^,\n]*)} serial {serial=(\S+)} from {notBefore=([^\n]*)} until {notAfter=([^\n]*)}} {
        set value {}
        regexp $pattern $said -> value
        dict set about $key [expr {$key in {from until} ? [clock scan [string map {GMT UTC} $value]] : $value}]
    }
    return $about
}

# The certificates, or the key, of a file.
proc ::sorma::keys::Parts {kind text} {
    return [regexp -all -inline -- "-----BEGIN $kind-----.*?-----END $kind-----\n?" $text]
}

proc ::sorma::keys::Date seconds {
    return [clock format $seconds -format %Y-%m-%d -timezone :UTC]
}

proc ::sorma::keys::NewKey {} {
    return [Openssl {genpkey -algorithm EC -pkeyopt ec_paramgen_curve:P-256}]
}

# ---- the commands ----

proc ::sorma::keys::NewAuthority {name days} {
    variable Days
    CheckName $name
    if {[file exists [Path authority.pem]]} {
        return -code error "[Path authority.pem] is there already, of [dict get [About [Read [Path authority.pem]]] organisation]; remove it first if nobody needs it any more"
    }
    set key [NewKey]
    set certificate [Openssl [list req -x509 -new -key FILE0 -config FILE1 -days [expr {$days eq {} ? [dict get $Days authority] : $days}]] {} $key \
        "\[req\]\ndistinguished_name=name\nprompt=no\nx509_extensions=more\n\[name\]\nO=$name\nCN=$name authority\n\[more\]
basicConstraints=critical,CA:TRUE,pathlen:0\nkeyUsage=critical,keyCertSign,cRLSign\nsubjectKeyIdentifier=hash\n"]
    Write [Path authority.key] $key
    Write [Path authority.pem] $certificate
    return "authority $name, until [Date [dict get [About $certificate] until]]: [Path authority.key] stays on this host; keep a copy in a safe place\n"
}

# A key and a certificate of our authority: the text of a file.
proc ::sorma::keys::Make {name days} {
    variable Days
    CheckName $name
    foreach file {authority.key authority.pem} {
        if {![file exists [Path $file]]} {
            return -code error "there is no [Path $file]: sorma-keys new-authority NAME makes one; on another host than the authority's: sorma-keys take FILE"
        }
    }
    set lab [dict get [About [Read [Path authority.pem]]] organisation]
    set key [NewKey]
    set request [Openssl {req -new -key FILE0 -config FILE1} {} $key "\[req\]\ndistinguished_name=name\nprompt=no\n\[name\]\nO=$lab\nCN=$name\n"]
    set certificate [Openssl [list x509 -req -in FILE0 -CA [Path authority.pem] -CAkey [Path authority.key] -extfile FILE1 -set_serial 0x[Serial] \
        -days [expr {$days eq {} ? [dict get $Days name] : $days}]] {} $request \
        "basicConstraints=critical,CA:FALSE\nkeyUsage=critical,digitalSignature\nextendedKeyUsage=serverAuth,clientAuth\nsubjectAltName=DNS:$name\n"]
    set certificate [lindex [Parts CERTIFICATE $certificate] 0]
    file mkdir [Path issued]
    Write [Path issued/$name.[dict get [About $certificate] serial].pem] $certificate
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
    Write [Path $name.pem] $key$certificate
    Own $name
    return "$name, until [Date [dict get [About $certificate] until]]: [Path $name.pem]\n"
}

# The first name that a host has is its own; a daemon with another name shows its own certificate, if there is one.
proc ::sorma::keys::Own name {
    if {![file exists [Path own]]} {
        Write [Path own] $name\n
    }
}

proc ::sorma::keys::Passphrase again {
    global env
    if {[info exists env(SORMA_PASSPHRASE)]} {
        return $env(SORMA_PASSPHRASE)
    }
    if {[catch {fconfigure stdin -mode}]} {
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
        return [Openssl [list {*}$words -pass[expr {$again ? "out" : "in"}] env:SORMA_KEYS_PASSPHRASE] {} {*}$args]
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
        WithPassphrase 1 [list pkcs12 -export -inkey FILE0 -in FILE1 -certfile [Path authority.pem] -name $name -out $file] $key $certificate
    } on error {message options} {
        file delete $file
        return -options $options $message
    }
    return "$name, until [Date [dict get [About $certificate] until]]: bring $file there, and: sorma-keys take $file\n"
}

proc ::sorma::keys::Take {file days} {
    set all [WithPassphrase 0 [list pkcs12 -nodes -in $file]]
    set key [lindex [Parts {PRIVATE KEY} $all] 0]
    set certificates [Parts CERTIFICATE $all]
    if {$key eq {} || [llength $certificates] < 2} {
        return -code error "$file holds no key with its certificate and authority; sorma-keys give makes such files"
    }
    return [Accept $key [lindex $certificates 0] [lindex $certificates end] authority.pem]
}

# Put them into the folder. An authority that is there already is never replaced: the user decides whom to trust.
proc ::sorma::keys::Accept {key certificate authority into} {
    set about [About $certificate]
    set name [dict get $about name]
    CheckName $name
    Openssl {verify -CAfile FILE0 FILE1} {} $authority $certificate
    if {[Openssl {x509 -noout -pubkey -in FILE0} {} $certificate] ne [Openssl {pkey -pubout -in FILE0} {} $key]} {
        return -code error "the key is not that of the certificate"
    }
    if {$authority ne {} && $into eq "authority.pem" && [file exists [Path $into]]} {
        if {[lindex [Parts CERTIFICATE [Read [Path $into]]] 0] ne [string trimright $authority \n] && [string trim [Read [Path $into]]] ne [string trim $authority]} {
            return -code error "[Path $into] is there already, of another authority ([dict get [About [Read [Path $into]]] organisation]); remove it first if it is to be replaced"
        }
    } elseif {$into eq "trusted.pem" && [file exists [Path $into]]} {
        if {[string first [string trim $authority] [Read [Path $into]]] < 0} {
            Write [Path $into] [Read [Path $into]]$authority\n
        }
    } else {
        Write [Path $into] [string trimright $authority \n]\n
    }
    Write [Path $name.pem] [string trimright $key \n]\n[string trimright $certificate \n]\n
    Own $name
    return "$name, until [Date [dict get $about until]]: [Path $name.pem]\n"
}

# Keys of a site's authority: who has one is known by it, and may what the policy says.
proc ::sorma::keys::Import {certificate key args} {
    set certificates [Parts CERTIFICATE [Read $certificate]]
    set authority [if {[llength $args] > 1} {lindex [Parts CERTIFICATE [Read [lindex $args 0]]] 0} else {lindex $certificates end}]
    if {$certificates eq {} || $authority eq {}} {
        return -code error "$certificate holds no certificate, or that of its authority is missing"
    }
    set secret [Openssl {pkey -in FILE0} {} [Read $key]]
    return [Accept $secret [lindex $certificates 0] $authority trusted.pem]
}

proc ::sorma::keys::List days {
    set rows {}
    foreach file [list authority trusted {*}[Names]] {
        if {![file exists [Path $file.pem]]} continue
        foreach certificate [Parts CERTIFICATE [Read [Path $file.pem]]] {
            set about [About $certificate]
            set left [expr {([dict get $about until] - [clock seconds]) / 86400}]
            lappend rows "[format %-20s [dict get $about name]] [format %-12s [dict get $about organisation]] until [Date [dict get $about until]], [expr {
                [dict get $about until] < [clock seconds] ? {EXPIRED} : [dict get $about from] > [clock seconds] + 300 ? {NOT YET VALID} : "$left days left"
            }], $file.pem[expr {$file ni {authority trusted} && ([file attributes [Path $file.pem] -permissions] & 077) ? {, OTHERS MAY READ THE KEY} : {}}]\n"
        }
    }
    if {$rows eq {}} {
        return "[Folder] holds no keys: sorma-keys new-authority NAME, or sorma-keys take FILE\n"
    }
    return [join $rows {}]
}

proc ::sorma::keys::Revoke {name days} {
    set lines {}
    foreach file [glob -nocomplain -directory [Path issued] $name.*.pem] {
        set about [About [Read $file]]
        if {[dict get $about name] eq $name && [dict get $about until] > [clock seconds]} {
            lappend lines "[dict get $about serial] $name, on [Date [clock seconds]]"
        }
    }
    if {$lines eq {}} {
        return -code error "no certificate for $name that holds was made here; where another authority has made it: a line \"revoke $name\" in the policy of the daemons"
    }
    set before [expr {[file exists [Path revoked]] ? [Read [Path revoked]] : {}}]
    set lines [lmap line $lines {
        if {[string first [lindex $line 0] $before] >= 0} continue
        set line
    }]
    Write [Path revoked] $before[join $lines \n][expr {$lines eq {} ? {} : "\n"}]
    return "$name is revoked on this host; on others: copy [Path revoked] there, or write \"revoke $name\" into their policy\n"
}

proc ::sorma::keys::Forget {name days} {
    set before [expr {[file exists [Path pins]] ? [split [string trim [Read [Path pins]]] \n] : {}}]
    set left [lsearch -all -inline -not -glob $before "$name *"]
    if {[llength $left] == [llength $before]} {
        return -code error "no daemon \"$name\" was reached with TLS"
    }
    Write [Path pins] [join $left \n][expr {$left eq {} ? {} : "\n"}]
    return "$name may be spoken to in clear again\n"
}
