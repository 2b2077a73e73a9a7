# launch.tcl -- the program sorma-launch: starts the daemons of an application, shows what they say, ends them.
#
# Each daemon runs in a session of its own, so that Ctrl-C reaches only the launcher. Its standard input is a pipe: sormad
# -until-eof ends when the launcher does, however that dies. One on another host has ssh between, which
# hands that end on. Processes that are left in the session of an ended daemon are killed.

package require sorma
package require sorma::commandLine
package require sorma::keys
package require sorma::launchDaemon
package require sorma::launchFile
package require sorma::launchMembers
package require sorma::packages
package require sorma::usage
package provide sorma::launch 1.0

# Control characters but the tab, each with what is shown instead: no daemon writes where it likes on a terminal.
proc ::sorma::launch::ControlMap {} {
    set map {}
    for {set code 0} {$code < 160} {incr code} {
        if {$code != 9 && ($code < 32 || $code >= 127)} {
            lappend map [format %c $code] [format {\x%02x} $code]
        }
    }
    return $map
}

namespace eval ::sorma::launch {
    variable Flags {--times flag  --only {{collect {the name of a daemon}}}  --until-eof flag  --ready flag  --check flag  --list flag  --keys flag  --options flag}
}

# ::sorma::launch::main --
#       Run the program sorma-launch.
# Arguments:
#       words   command line, as the manual says
# Results:
#       Exit code of the program, as the manual says.
proc ::sorma::launch::main words {
    variable Flags
    return [::sorma::commandLine::run sorma-launch $Flags $words ::sorma::launch::Main -check ::sorma::launch::Files -leading 1]
}
proc ::sorma::launch::Files {settings words} {
    if {[llength $words] != 1 && ![dict get $settings --options]} {
        error "expects one FILE"
    }
}
proc ::sorma::launch::Main {settings words} {
    dict with settings {}
    if {${--options}} {
        return [puts [::sorma::usage::listed sorma-launch {THE FILE}]]
    }
    set file [lindex $words 0]
    try {
        set daemons [::sorma::launchFile::read $file]
    } trap {SORMA LAUNCH FILE} message {
        puts stderr [regsub -all -line ^ $message {sorma-launch: }]
        return 2
    }
    if {[llength ${--only}] > 0} {
        foreach name ${--only} {
            if {![dict exists $daemons $name]} {
                puts stderr "sorma-launch: --only \"$name\"[::sorma::DidYouMean $name [dict keys $daemons]]: $file has no such daemon; it has [join [dict keys $daemons] {, }]"
                return 2
            }
        }
        # Those that are left out run already, or are not wanted.
        set daemons [dict map {name settings} [dict filter $daemons script {name settings} {expr {$name in ${--only}}}] {
            set after [lmap other [dict get $settings -after] {if {$other ni ${--only}} continue; set other}]
            dict replace $settings -after $after members [dict map {label own} [dict get $settings members] {dict replace $own -after $after}]
        }]
    }
    if {${--check}} {
        return [Check $file $daemons]
    } elseif {${--list}} {
        return [List $daemons]
    } elseif {${--keys}} {
        return [BringKeys $file $daemons]
    }
    return [[Launcher new ${--times} ${--ready}] run $daemons ${--until-eof}]
}

# ---- --check and --list ----

proc ::sorma::launch::Check {file daemons} {
    set members [members $daemons]
    dict for {name settings} $members {
        if {[dict get $settings -on] ne {} && [dict get $settings -port] ne {} && [dict get $settings -host] eq {} && ![dict get $settings -one-of]} {
            puts "[dict get $settings place]: note: without -host, $name listens on 127.0.0.1 of\
                [dict get $settings -on] only"
        }
    }
    set missing [concat {*}[lmap {name settings} $members {Missing $settings}]]
    if {[llength $missing] > 0} {
        puts stderr [join [lmap line $missing {string cat "sorma-launch: " $line}] \n]
        return 2
    }
    puts "$file is good; daemons, as they are started: [join [::sorma::launchFile::startOrder $daemons] {, }]"
    return 0
}

# Packages that a daemon would not find: a line each. Not known for those on another host, or with a program of their own.
proc ::sorma::launch::Missing settings {
    dict with settings {}
    if {[llength ${-package}] == 0} {
        return
    }
    if {${-on} ne {} || ${-sormad} ne "sormad"} {
        puts "$place: note: the packages [join ${-package} {, }] are not looked for: they are found\
            [expr {${-on} ne {} ? "on ${-on}" : "by ${-sormad}"}]"
        return
    }
    return [lmap line [::sorma::packages::missing ${-package} ${-path} ${-env}] {string cat "$place: -package: " $line}]
}

proc ::sorma::launch::List daemons {
    set found [Running]
    set rows [list {NAME ON STATE AFTER RESTART}]
    dict for {name settings} [members $daemons] {
        lappend rows [list $name [Place $settings] [State $name $settings $found] \
            [join [dict get $settings -after] ,] [dict get $settings -restart]]
    }
    set widths {}
    for {set column 0} {$column < 5} {incr column} {
        lappend widths [tcl::mathfunc::max {*}[lmap row $rows {string length [lindex $row $column]}]]
    }
    foreach row $rows {
        puts [string trimright [join [lmap word $row width $widths {format %-*s $width $word}] {  }]]
    }
    return 0
}

proc ::sorma::launch::Place settings {
    return [expr {[dict get $settings -on] eq {} ? "this host" : [dict get $settings -on]}]
}

# How a daemon is, in a few words. Asked over the network only where its address is known.
proc ::sorma::launch::State {name settings running} {
    set as [dict get $settings as]
    if {[dict get $settings -one-of]} {
        return [expr {[dict exists $running $as] ? "$as is [dict get $running $as]" : "nobody is known to own $as"}]
    }
    if {[Local $settings]} {
        return [expr {[dict exists $running $as] ? [dict get $running $as] : "not running"}]
    }
    set port [dict get $settings -port]
    if {[dict get $settings -on] eq {}} {
        set address [dict get $settings -socket]
    } elseif {$port ni {{} 0}} {
        set address [regsub {^.*@} [dict get $settings -on] {}]:$port
    } else {
        set address {}
    }
    if {$address eq {}} {
        return "not known from here"
    }
    try {
        return "[dict get [::sorma::health $address -timeout 2000] state] at $address"
    } on error {} {
        return "no answer from $address"
    }
}

# Does it listen in the runtime folder of this process?
proc ::sorma::launch::Local settings {
    return [expr {[dict get $settings -on] eq {} && [dict get $settings -socket] eq {} &&
        [lsearch -glob [dict get $settings -env] SORMA_RUNTIME_DIR=*] < 0}]
}

# Daemons of this user on this host: dict of name -> state and who.
proc ::sorma::launch::Running {} {
    set running {}
    foreach found [::sorma::daemons] {
        if {[dict get $found state] ne "dead"} {
            dict set running [dict get $found name] "[dict get $found state], [dict get $found identity]"
        }
    }
    return $running
}

# ---- the whole ----

oo::class create ::sorma::launch::Launcher {
    superclass ::sorma::launch::lines
    variable Daemons        ;# dict: name, or name and host -> object of class Daemon, in the order of the file
    variable Started        ;# names in the order in which they were started first
    variable Told           ;# dict: name -> 1, once it has been said that it is ready
    variable Times          ;# does each line begin with the time?
    variable Shown          ;# channel of what is for people
    variable Tells          ;# is a program told when all are ready?
    variable Complete       ;# have all been ready?
    variable Stopping       ;# 1: asked to end, 2: asked again
    variable Unheard        ;# it stops because standard input has ended: a signal is the first one
    variable Code           ;# of the program
    variable Done           ;# set at the end
    variable Width          ;# of the names that stand before lines
    variable Colours        ;# those for names; empty without a terminal
    variable Visible        ;# control characters -> what is shown in their place

    constructor {times tells} {
        namespace path [list {*}[namespace path] ::sorma::launch]
        next
        set Times $times
        set Tells $tells
        set Shown [expr {$tells ? "stderr" : "stdout"}]
        set Daemons [set Started [set Told [set Colours {}]]]
        set Complete [set Stopping [set Unheard [set Code 0]]]
        set Width 1
        set Visible [ControlMap]
    }

    # Start all, and wait for the end. untilEof: they end with standard input, too. Returns the exit code.
    method run {daemons untilEof} {
        set running [dict filter [Running] script {name state} {expr {![string match listed,* $state]}}]     ;# on this host
        set refused 0
        set members [members $daemons]
        dict for {name settings} $members {
            set as [dict get $settings as]
            if {[Local $settings] && [dict exists $running $as]} {
                my Complain "[dict get $settings place]: daemon $as is running already ([dict get $running $as]);\
                    end it, or choose another name"
                set refused 1
            }
        }
        if {$refused} {
            return 1
        }
        if {[Terminal $Shown]} {
            set Colours {36 32 33 35 34 96 92 95}
        }
        set Width [tcl::mathfunc::max {*}[lmap name [dict keys $members] {string length $name}]]
        fconfigure $Shown -buffering line
        if {$untilEof} {
            fconfigure stdin -blocking 0
            fileevent stdin readable [namespace code {my Input}]
        }
        interp bgerror {} [namespace code {my Unexpected}]
        ::sorma::atSignal [namespace code {my Signalled}] HUP
        my group $daemons
        dict for {name settings} $members {
            dict set Daemons $name [Daemon new [self] $name $settings]
        }
        my startDue
        if {![info exists Done]} {
            vwait [my varname Done]
        }
        catch {flush $Shown}
        return $Code
    }

    method Unexpected {message options} {
        set Code 1
        my Complain "unexpected: [dict get $options -errorinfo]"
        my Stop
    }

    method Signalled {} {
        if {[llength $Colours] > 0} {
            catch {puts -nonewline $Shown "\r\x1b\[K"}      ;# over the ^C that the terminal has shown
        }
        if {!$Stopping || $Unheard} {
            set Unheard 0
            my say * "told to end; once more kills what still runs"
            my Stop
        } elseif {$Stopping == 1} {
            set Stopping 2
            my say * "told to end once more"
            foreach daemon [dict values $Daemons] {
                $daemon kill
            }
        }
    }

    # When the starter of this program ends in any way, all daemons end.
    method Input {} {
        if {[catch {read stdin}] || [eof stdin]} {
            fileevent stdin readable {}
            set Unheard 1
            my say * "standard input has ended"
            my Stop
        }
    }

    # Start those whose turn it is. Called whenever one has got ready.
    method startDue {} {
        dict for {name daemon} $Daemons {
            if {[$daemon state] eq "waiting" && !$Stopping && [my allReady [$daemon after]]} {
                lappend Started $name
                $daemon start
            }
        }
        if {!$Complete && !$Stopping && [my allSettled]} {
            set Complete 1
            my say * "ready: [join [lmap {name daemon} $Daemons {if {[$daemon state] ne "ready"} continue; set name}] { }]"
            if {$Tells} {
                catch {
                    puts ready
                    flush stdout
                }
            }
        }
    }

    method gotReady {name took role} {
        if {[[dict get $Daemons $name] state] eq "ready"} {     ;# it may have ended in the same breath
            dict set Told $name 1
            my say * "$name is ready after $took s[if {$role eq "standby"} {string cat ", and stands by"}]"
            my expectOwner $name
            my startDue
        }
    }

    # A daemon has ended and is not started again. At the beginning nothing is complete without it; later the others go on, unless it was
    # essential.
    method gone {name failed essential message last} {
        if {$failed || $essential || !$Complete} {
            set Code 1
        }
        set others [my partners $name]
        if {[llength $others] > 0} {
            my say * "$message[if {[llength $last] > 0} {string cat ": " [lindex $last end]}]; [join $others {, }] [expr {[llength $others] == 1 ? "goes" : "go"}] on" 31
            my startDue
            my goOn
            return
        }
        if {$Complete && !$essential} {
            my say * [expr {$failed ? "$message; the others go on" : "$name has ended"}] [expr {$failed ? 31 : {}}]
        } else {
            if {[llength $last] > 0} {
                append message "; it said last:\n[join [lmap line $last {string cat "    " $line}] \n]"
            }
            my Complain $message
            set Stopping 1
        }
        my goOn
    }

    # End all, the last one started first: each when the one before has ended.
    method Stop {} {
        if {!$Stopping} {
            set Stopping 1
            my goOn
        }
    }

    # One has ended: go on with the next that has to end. Nothing is left to do when there is none.
    method goOn {} {
        if {$Stopping} {
            foreach name [my stopOrder $Started] {
                if {[[dict get $Daemons $name] stop]} {
                    return
                }
            }
        } else {
            foreach daemon [dict values $Daemons] {
                if {[$daemon state] ne "ended"} {
                    return
                }
            }
        }
        my say * "all have ended"
        set Done 1
    }

    # Is all to end? 1: asked to, 2: asked again.
    method stopping {} {
        return $Stopping
    }

    # The program has failed.
    method failed {} {
        set Code 1
    }

    # ---- what is shown ----

    # A line, behind the name it is about; * is the launcher itself. mark: "|", or ":" when the line goes on.
    method say {name line {colour {}} {mark |}} {
        set head [format "%*s %s" $Width $name $mark]
        if {$Times} {
            set head "[::sorma::text::time [clock microseconds]] $head"
        }
        set line [string map $Visible $line]
        if {[llength $Colours] > 0} {
            set index [lsearch -exact [dict keys $Daemons] $name]
            set paint [expr {$index < 0 ? 1 : [lindex $Colours [expr {$index % [llength $Colours]}]]}]
            set head "\x1b\[${paint}m$head\x1b\[0m"
            if {$colour ne {}} {
                set line "\x1b\[${colour}m$line\x1b\[0m"
            }
        }
        try {
            puts $Shown "$head $line"
        } trap {POSIX EPIPE} {} - trap {POSIX EIO} {} {
            after 0 [namespace code {my Stop}]           ;# the reader of our output has ended
        } on error {} {
            # for example a full disk: that is no reason to end the daemons
        }
    }

    method Complain message {
        set message [join [lmap line [split $message \n] {string map $Visible $line}] \n]
        set message "sorma-launch: $message"
        if {[Terminal stderr]} {
            set message "\x1b\[31m$message\x1b\[0m"
        }
        catch {flush $Shown}
        catch {puts stderr $message}
    }
}


# May colours be used there?
proc ::sorma::launch::Terminal channel {
    global env
    if {[info exists env(NO_COLOR)] && $env(NO_COLOR) ne {} || [info exists env(TERM)] && $env(TERM) eq "dumb"} {
        return 0
    }
    return [expr {![catch {exec test -t 1 >@$channel}]}]
}

# ---- --keys ----

# Make a key for each daemon on another host, and bring it there by ssh, on its standard input.
proc ::sorma::launch::BringKeys {file daemons} {
    set daemons [dict filter [members $daemons] script {name settings} {expr {[dict get $settings -on] ne {}}}]
    if {[dict size $daemons] == 0} {
        puts stderr "sorma-launch: no daemon of $file runs on another host (-on HOST); on this one: sorma-keys new NAME"
        return 2
    }
    set status 0
    dict for {name settings} $daemons {
        set command [lmap word [dict get $settings -sormad] {expr {[file tail $word] eq "sormad" ? [file join [file dirname $word] sorma-keys] : $word}}]
        if {[dict get $settings -sormad] eq "sormad"} {
            set command sorma-keys
        }
        try {
            set pipe [open [list | sh -c [Placed $settings [list {*}$command take -]] 2>@1] r+]
            fconfigure $pipe -encoding utf-8
            puts -nonewline $pipe [::sorma::keys::stream [dict get $settings as]]
            close $pipe write
            set said [string trim [read $pipe]]
            close $pipe
            puts "[dict get $settings -on]: $said"
        } on error message {
            puts stderr "sorma-launch: the key of $name is not on [dict get $settings -on]: [expr {[info exists said] && $said ne {} ? $said : $message}]"
            set status 1
        }
        unset -nocomplain said
    }
    return $status
}

# ---- commands ----

# One word that a shell reads as it stands.
proc ::sorma::launch::Quoted word {
    if {[regexp {^[A-Za-z0-9_./:=@%+,-]+$} $word]} {
        return $word
    }
    return '[string map {' '\\''} $word]'
}

# A command for a shell, in the environment of a daemon: here, or on its own host.
proc ::sorma::launch::Placed {settings command} {
    set words {}
    if {[dict get $settings -directory] ne {} || [llength [dict get $settings -env]] > 0} {
        lappend words env
        if {[dict get $settings -directory] ne {}} {
            lappend words -C [dict get $settings -directory]
        }
        lappend words {*}[lmap word [dict get $settings -env] {
            # A daemon of this host needs the package that we have.
            if {[dict get $settings -on] eq {} && [string match TCLLIBPATH=* $word]} {
                append word " " [list [file dirname $::sorma::library]]
            }
            set word
        }]
    }
    set text "exec [join [lmap word [list {*}$words {*}$command] {Quoted $word}]]"
    if {[dict get $settings -on] eq {}} {
        return $text
    }
    # Do not ask for a password; both sides notice a dead connection.
    set words [list {*}[dict get $settings -ssh] -T -o BatchMode=yes -o ConnectTimeout=10 \
        -o ServerAliveInterval=5 -o ServerAliveCountMax=3 -- [dict get $settings -on] $text]
    return "exec [join [lmap word $words {Quoted $word}]]"
}

# The command of a daemon.
proc ::sorma::launch::commandText {name settings} {
    set program [dict get $settings -sormad]
    if {$program eq "sormad" && [dict get $settings -on] eq {}} {
        set program [list [Beside sormad]]
    }
    set words [list {*}$program -name $name -until-eof]
    foreach option {-allow -owned} {
        foreach line [dict get $settings $option] {
            lappend words $option $line
        }
    }
    foreach option {-standby -port -host -socket -rpcbind -program -policy -share -strict -selftest -log -script} {
        if {[dict get $settings $option] ne {}} {
            lappend words $option [dict get $settings $option]
        }
    }
    # It has as long as the launcher waits; the usual time is sormad's, too.
    if {[dict get $settings -grace] != 5} {
        lappend words -grace [dict get $settings -grace]
    }
    foreach option {-dict -path -package -make} {
        if {[llength [dict get $settings $option]] > 0} {
            lappend words $option {*}[dict get $settings $option]
        }
    }
    return [Placed $settings $words]
}

# A program of ours: the one that lies where this one does, else one along PATH.
proc ::sorma::launch::Beside program {
    set file [file join [file dirname [file normalize [info script]]] $program]
    return [expr {[info script] ne {} && [file executable $file] ? $file : $program}]
}
