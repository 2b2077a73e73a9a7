# launchFile.tcl -- what a launch file says: the daemons of an application. Words, never code.
#
#     # comment; a line that ends in a backslash goes on
#     defaults -restart failure -dict common.dict           options of the daemons that follow
#     daemon eye -package sorma::service::echo
#     daemon arm -after eye -on robot@cell2 -port 7014 -host 0.0.0.0 -env MODE=slow
#
# Words are quoted as in requests ("..." '...' {...}). A later option replaces an earlier one; those that take several
# words add to it. Files of daemons on this host are relative to the folder of the launch file.

namespace eval ::sorma::launch {
    # What a daemon may be given: option -> {kind default help}. Kinds: a word; words, up to the next option; text,
    # which is split into words; a whole number or seconds in a range; a boolean; a choice.
    variable Options {
        -package    {words {} "Tcl packages that it loads"}
        -dict       {words {} "dictionaries that it loads"}
        -script     {word {} "Tcl script that it runs before it is ready"}
        -port       {{whole 0 65535} {} "it also listens on TCP; 0: a free port"}
        -host       {word {} "interface for TCP, there; sormad's default is 127.0.0.1"}
        -socket     {word {} "its Unix-domain socket"}
        -rpcbind    {boolean {} "register its port with rpcbind"}
        -program    {word {} "program number there"}
        -allow      {words {} "lines of its policy, one word each: {host 192.168.7.0/24 tune}"}
        -policy     {word {} "file of its policy, there; default ~/.config/sorma/policy"}
        -share      {boolean {} "let other users of that host connect to its Unix-domain socket"}
        -log        {word {} "file for its background errors"}
        -env        {words {} "NAME=VALUE, for its environment"}
        -directory  {word {} "where it runs"}
        -on         {word {} "user@host or host: it runs there, by ssh; else on this host"}
        -after      {words {} "daemons that have to be ready before it is started"}
        -ready      {{seconds 0.1 86400} 20 "time for it to get ready"}
        -restart    {{choice never failure always} never "when it has ended by itself"}
        -limit      {{whole 0 1000000} 5 "restarts in a row; a minute of service begins a new row"}
        -pause      {{seconds 0 3600} 0.5 "before the first restart; doubles each time, up to 30 s"}
        -grace      {{seconds 0 86400} 5 "between asking it to end (SIGTERM) and SIGKILL"}
        -essential  {boolean 0 "when it is gone for good, end all"}
        -sormad     {text sormad "what is run, with first arguments"}
        -ssh        {text ssh "ssh client, with first arguments"}
    }
}

# ::sorma::launch::Read --
#       Read a launch file.
# Arguments:
#       file    its path
# Results:
#       A dict in the order of the file: name of daemon -> dict of its options and of line and place ("FILE:LINE").
#       Fails with {SORMA LAUNCH FILE} and a line FILE:LINE: ... for each thing that is wrong.
proc ::sorma::launch::Read file {
    variable Options
    set wrong [Readable $file]
    if {$wrong ne {}} {
        return -code error -errorcode {SORMA LAUNCH FILE} "$file: $wrong"
    }
    set channel [open $file]
    fconfigure $channel -encoding utf-8
    catch {fconfigure $channel -profile replace}        ;# Tcl 9 is strict otherwise
    set text [read $channel]
    close $channel
    set defaults [dict map {option facts} $Options {lindex $facts 1}]
    set daemons {}
    set wrong {}
    foreach {line entry} [Entries $text] {
        set place $file:$line
        try {
            set words [lassign [::sorma::SplitWords $entry] keyword]
            switch -- $keyword {
                {} {}
                defaults {
                    set defaults [ParseOptions $words $defaults]
                }
                daemon {
                    set words [lassign $words name]
                    if {![regexp {^[A-Za-z0-9_][A-Za-z0-9_.-]*$} $name]} {
                        error "bad name of a daemon \"$name\": letters, digits, _ - and . only"
                    }
                    if {[dict exists $daemons $name]} {
                        error "daemon $name is there already, in line [dict get $daemons $name line]"
                    }
                    dict set daemons $name [dict create line $line place $place {*}$defaults]
                    set settings [ParseOptions $words [dict get $daemons $name]]
                    dict set daemons $name [CheckDaemon [file dirname $file] $settings]
                }
                default {
                    error "unknown word \"$keyword\": must be daemon or defaults"
                }
            }
        } on error message {
            lappend wrong "$place: $message"
        }
    }
    if {[llength $wrong] == 0} {
        set wrong [CheckOrder $daemons]
    }
    if {[dict size $daemons] == 0 && [llength $wrong] == 0} {
        lappend wrong "$file: there is no daemon in it; a line \"daemon NAME\" makes one"
    }
    if {[llength $wrong] > 0} {
        return -code error -errorcode {SORMA LAUNCH FILE} [join $wrong \n]
    }
    return $daemons
}

# Why a file cannot be read; empty: it can.
proc ::sorma::launch::Readable file {
    if {![file exists $file]} {
        return "there is no such file"
    } elseif {[file isdirectory $file]} {
        return "is a folder"
    } elseif {![file readable $file]} {
        return "cannot be read by this user"
    }
}

# Lines that go on are joined. Returns a list of number, text.
proc ::sorma::launch::Entries text {
    set entries {}
    set number 0
    set begun 0
    foreach line [split $text \n] {
        incr number
        set line [string trimright $line \r]
        if {!$begun} {
            set begun $number
            set entry {}
        }
        if {[regexp {(?:^|[^\\])(?:\\\\)*\\$} $line]} {
            append entry [string range $line 0 end-1] { }
            continue
        }
        lappend entries $begun $entry$line
        set begun 0
    }
    if {$begun} {
        lappend entries $begun $entry
    }
    return $entries
}

# Take words of a line over into options.
proc ::sorma::launch::ParseOptions {words settings} {
    variable Options
    while {[llength $words] > 0} {
        set words [lassign $words option]
        if {![dict exists $Options $option]} {
            return -code error "unknown option \"$option\": must be one of [join [lsort [dict keys $Options]] {, }]"
        }
        lassign [dict get $Options $option] kind
        if {$kind eq "words"} {
            for {set n 0} {$n < [llength $words] && ![string match -* [lindex $words $n]]} {incr n} {}
            if {$n == 0} {
                return -code error "$option needs a value"
            }
            dict lappend settings $option {*}[lrange $words 0 $n-1]
            set words [lrange $words $n end]
        } else {
            if {[llength $words] == 0} {
                return -code error "$option needs a value"
            }
            set words [lassign $words value]
            dict set settings $option [CheckValue $option $kind $value]
        }
        if {[string first \0 [dict get $settings $option]] >= 0} {
            return -code error "$option holds a zero character: no program can be given that"
        }
    }
    return $settings
}

# The value as it is used. An error says what was expected.
proc ::sorma::launch::CheckValue {option kind value} {
    lassign $kind type low high
    set good 1
    switch -- $type {
        whole {
            set good [expr {[regexp {^\d{1,9}$} $value] && [scan $value %d] >= $low && [scan $value %d] <= $high}]
            set expected "a whole number from $low to $high"
        }
        seconds {
            set good [expr {[string is double -strict $value] && $value >= $low && $value <= $high}]
            set expected "seconds from $low to $high"
        }
        boolean {
            set good [string is boolean -strict $value]
            set expected "a boolean"
        }
        choice {
            set choices [lrange $kind 1 end]
            set good [expr {$value in $choices}]
            set expected [join [lreplace $choices end end "or [lindex $choices end]"] {, }]
        }
        text {
            set value [::sorma::SplitWords $value]
            set good [expr {[llength $value] > 0}]
            set expected "a command"
        }
        word {
            set good [expr {$value ne {}}]
            set expected "a word that is not empty"
        }
    }
    if {!$good} {
        return -code error "$option expects $expected, got \"$value\""
    }
    return $value
}

# What can be said about a daemon alone. Returns its settings, the files of this host with their full path.
proc ::sorma::launch::CheckDaemon {folder settings} {
    dict with settings {
        foreach word ${-env} {
            if {![regexp {^[A-Za-z_][A-Za-z0-9_]*=} $word]} {
                return -code error "-env expects NAME=VALUE, got \"$word\""
            }
        }
        # What begins with a dash would be an option of ssh.
        if {${-on} ne {} && ![regexp {^([A-Za-z0-9_.][^\s@]*@)?[A-Za-z0-9_\[:][^\s@]*$} ${-on}]} {
            return -code error "-on expects host or user@host, got \"${-on}\""
        }
    }
    if {[dict get $settings -on] ne {}} {
        return $settings
    }
    foreach option {-dict -script -directory -log} {
        set files [lmap file [Values $option $settings] {file normalize [file join $folder $file]}]
        foreach file $files {
            CheckFile $option $file
        }
        if {$option ne "-dict"} {
            set files [lindex $files 0]
        }
        dict set settings $option $files
    }
    return $settings
}

# Is what an option names there, as far as it has to be?
proc ::sorma::launch::CheckFile {option file} {
    if {$option eq "-log"} {
        set file [file dirname $file]
    }
    if {$option in {-log -directory}} {
        if {![file isdirectory $file]} {
            return -code error "$option: there is no folder $file"
        }
    } else {
        set wrong [Readable $file]
        if {$wrong ne {}} {
            return -code error "$option $file: $wrong"
        }
    }
}

# The values of an option as a list: none, one, or several.
proc ::sorma::launch::Values {option settings} {
    variable Options
    set value [dict get $settings $option]
    if {[lindex [dict get $Options $option] 0] in {words text}} {
        return $value
    }
    return [expr {$value eq {} ? {} : [list $value]}]
}

# What is wrong with -after: a list of messages.
proc ::sorma::launch::CheckOrder daemons {
    set wrong {}
    dict for {name settings} $daemons {
        foreach before [dict get $settings -after] {
            if {![dict exists $daemons $before]} {
                lappend wrong "[dict get $settings place]: -after $before: there is no such daemon; there are\
                    [join [dict keys $daemons] {, }]"
            }
        }
    }
    if {[llength $wrong] > 0} {
        return $wrong
    }
    set order [StartOrder $daemons]
    foreach name [dict keys $daemons] {
        if {$name ni $order} {
            set chain [Circle $daemons $order $name]
            set place [dict get $daemons [lindex $chain 0] place]
            return [list "$place: daemons wait for each other in a circle: [join $chain { -after }]"]
        }
    }
    return {}
}

# Names in an order in which they can be started; those that wait in a circle, or for one, are left out.
proc ::sorma::launch::StartOrder daemons {
    set order {}
    for {set before -1} {[llength $order] > $before} {} {
        set before [llength $order]
        dict for {name settings} $daemons {
            set missing [lmap other [dict get $settings -after] {if {$other in $order} continue; set other}]
            if {$name ni $order && [llength $missing] == 0} {
                lappend order $name
            }
        }
    }
    return $order
}

# The circle to which -after leads from a daemon that is not in the order: its names, the first one again at the end.
proc ::sorma::launch::Circle {daemons order name} {
    set chain {}
    while {$name ni $chain} {
        lappend chain $name
        foreach other [dict get $daemons $name -after] {
            if {$other ni $order} {
                set name $other
                break
            }
        }
    }
    return [list {*}[lrange $chain [lsearch -exact $chain $name] end] $name]
}
