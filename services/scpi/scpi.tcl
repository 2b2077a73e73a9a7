# scpi -- speaks to an instrument that understands SCPI (IEEE 488.2): by TCP, VXI-11, HiSLIP, USB or a serial line.
#
#     scpi.psu CTRL -to tcp:192.168.0.9:5025
#     scpi.psu EXEC query MEAS:VOLT?
#
# One request has the line at a time, the others wait in their order: no answer goes to the wrong one. The bus lets a self-test begin while
# an EXEC waits, so the line has turns of its own. When an answer is missing the line is closed, because it may still come.

package require sorma
package require sorma::driver
package require sorma::scpiTable
package require sorma::serial
package require sorma::streamLine

namespace eval ::sorma::scpi {
    # Kinds of lines, as -to has them: the package, and the class of an object for each.
    variable Lines {
        tcp {sorma::streamLine ::sorma::streamLine::tcp}
        serial {sorma::streamLine ::sorma::streamLine::serial}
        vxi11 {sorma::vxi11Client ::sorma::vxi11Client::line}
        hislip {sorma::hislipClient ::sorma::hislipClient::line}
        usbtmc {sorma::service::usbtmc ::sorma::scpi::usb}
    }
    variable Made 0             ;# lines of USB so far
}

# ::sorma::scpi::option --
#       In a class derived from scpi: declare an option of the instrument.
# Arguments:
#       name type args  as of sorma::option, and -set FORMAT: the message that sets it; -get QUESTION: the one that asks for it. Without -set it is a reading
proc ::sorma::scpi::option {name type args} {
    lassign [::sorma::scpiTable::row $name $type $args] row words
    if {[dict get $row set] eq {}} {
        set words [linsert $words 0 -measured 1 -group Readings]
    }
    # Once in a driver and those that derive from it.
    try {
        uplevel 1 {::sorma::option -raw flag -group Line -fixed 1 -danger power -help "EXEC write takes any message, also past the limits of the options"}
    } trap {SORMA CLASS TABLE} {} {}
    uplevel 1 [list ::sorma::option $name $type {*}$words]
    uplevel 1 [list ::oo::define::method Row$name {} [list return $row]]
}

# A line by USB, as instrumentLine.tcl has it: class usbtmc has the device, and waits on a thread.
oo::class create ::sorma::scpi::usb {
    variable Object Path        ;# of class usbtmc, empty: none was needed yet; its -to
    variable Opened
    variable Dirty              ;# something may wait in the device: a request has not ended well

    constructor wait {
        set Object [set Path {}]
        set Opened [set Dirty 0]
    }
    destructor {
        if {$Object ne {}} {
            $Object destroy
        }
    }
    method isOpen {} { return $Opened }
    method idle {} { return [string match "open*" [lindex [$Object DBX -line] 3]] }
    method open {path ms} {
        if {$Object eq {}} {
            set Object [::usbtmc create ::sorma::scpi::usb[incr ::sorma::scpi::Made] -to $path]
        } elseif {$path ne $Path} {
            $Object CTRL -to $path
        }
        set Path $path
        my Ask $ms open
        set Opened 1
    }
    method write {bytes ms} { my Ask $ms -any $bytes write }
    method read {most ms end} { return [dict get [my Ask $ms -ints $most read] any] }
    method status ms { return [lindex [dict get [my Ask $ms status] ints] 0] }
    # What was under way ends first, and what is left in the device is dropped then. The next request comes behind that.
    method shut {} {
        if {$Dirty} {
            sorma::async -timeout 0 -command ::sorma::scpi::Cleared $Object EXEC clear
        } elseif {$Opened} {
            $Object CTRL -close
        }
        set Opened [set Dirty 0]
    }
    method Ask {ms args} {
        set Dirty 1
        set request [sorma::async -timeout 0 $Object exec -floats [expr {$ms / 1000.0}] {*}$args]
        sorma::atCancel [list catch [list $request cancel]]
        try {
            set answer [$request wait]
        } trap {SORMA USBTMC UNREACHABLE} why {
            throw {LINE OPEN} [regsub {^.* cannot be opened: } $why {}]
        } trap {SORMA USBTMC SILENT} {} {
            throw {LINE LATE} "its time is over"
        } trap {SORMA USBTMC TOO_BIG} why {
            throw {LINE BIG} [regsub {^\S+: } $why {}]
        } trap {SORMA USBTMC LOST} why {
            throw {LINE LOST} [regsub {^\S+: } $why {}]
        } trap {SORMA USBTMC} why {
            throw {LINE ERROR} [regsub {^\S+: } $why {}]
        } trap {SORMA COMM CANCELLED} {} {
            throw {LINE WAIT cancelled} "given up"
        } finally {
            sorma::atCancel {}
            catch {$request destroy}
        }
        set Dirty 0
        return $answer
    }
}
proc ::sorma::scpi::Cleared future {
    catch {$future take}
}

# The status byte is there, if the instrument still is.
proc ::sorma::scpi::Requested {publish future} {
    if {![catch {$future take} reply]} {
        catch {{*}$publish request -ints [lindex $reply 4]}
    }
}

oo::class create ::sorma::service::scpi {
    superclass sorma::driver::Device sorma::Service

    sorma::purpose "speaks to an instrument that understands SCPI"
    sorma::option -to string -kind address -help "where it is: tcp:HOST:PORT, vxi11:HOST/inst0, vxi11:HOST:PORT/inst0, hislip:HOST, hislip:HOST:PORT/hislip0, usbtmc:/dev/usbtmc0, or serial:PATH,BAUD,8n1 with ,rtscts or ,xonxoff"
    sorma::option -terminator enum -group Line -choices {lf cr crlf} -default lf -help "what ends a message, both ways"
    sorma::option -patience double -group Line -unit s -range {0.001 3600} -default 5 -help "how long the instrument may be silent: while it is reached, and within an answer"
    sorma::option -check flag -group Line -default 1 -help "ask SYST:ERR? after each write, and when an answer is missing"
    sorma::option -requests flag -group Line -help "hear service requests of the instrument, by VXI-11 or HiSLIP: each is an event request; from the next opening of the line on"
    sorma::option -most int -group Line -unit B -range {64 2147483647} -default 67108864 -help "the longest answer that is taken"
    sorma::option -format enum -group Blocks -choices {real32 real64 int8 uint8 int16 uint16 int32 uint32} -default real32 -help "of the numbers in a block"
    sorma::option -order enum -group Blocks -choices {big little} -default big -help "which byte of a number in a block comes first"
    sorma::option -poll double -group Line -unit s -range {0 86400} -default 0 -help "a driver asks for its readings each so many seconds; 0: only when somebody says read"
    sorma::action -fetch {} "ask the instrument for all settings and readings of its driver" {my fetch [dict keys [my table]]} -right call
    sorma::action -send {} "send all settings of its driver to the instrument" {my give [dict keys [my table]]} -danger power
    sorma::action -close {} "close the line; the next request opens it again" {my Close}
    sorma::inspection -line {} "is the line open, and to what" {my State}
    sorma::writes ints 0.. "" "status: the status byte"
    sorma::words "query TEXT | values TEXT | write TEXT | read ?-OPTION ...? | status"
    sorma::danger power write
    sorma::example "scpi.psu EXEC query *IDN?"

    variable Line Kind Opened   ;# an object, empty: none was needed yet; its kind, as in Lines; what -to was then
    variable Turns              ;# coroutines: the first one has the line, the others wait for it

    method born {} {
        set Line [set Kind [set Opened [set Turns {}]]]
        my begin
    }
    destructor {
        my end
        if {[info exists Line] && $Line ne {}} {        ;# else its recipe was refused: it was not born
            $Line destroy
        }
    }
    method changed options {
        if {"-requests" in $options && [my cget -requests] && ![regexp {^(?:vxi11|hislip):} [my cget -to]]} {
            my Fault REQUESTS "-requests needs VXI-11 or HiSLIP, and -to is \"[my cget -to]\"" [my cget -to]
        }
        if {"-to" in $options && [my cget -to] ne {}} {
            my Parts [my cget -to]
        }
        if {"-poll" in $options} {
            my poll
        }
    }
    # Then the values of those whose messages name a changed option.
    method settle options {
        my give $options
        my fetch [lmap option [dict keys [my table]] {
            if {[lmap other [dict get [my table] $option others] {if {"-$other" ni $options} continue; set other}] eq {}} continue
            set option
        }]
    }
    method selftest {} {
        set said [my Text [my Query *TST?]]
        if {![string is integer -strict $said] || $said != 0} {
            my Fault TEST "*TST? has answered \"$said\", 0 means that all is well" $said
        }
        return [my Text [my Query *IDN?]]
    }

    method exec message {
        set words [dict get $message words]
        set text [string trim "[join [lrange $words 1 end]] [dict get $message text]"]
        set verb [lindex $words 0]
        switch -- $verb {
            {} - query {
                if {$verb eq {} && $text eq {}} {
                    my Fault VERB "an empty request: say query, values, write, read or status" {}
                }
                set answer [my Query $text]
                return [if {[string index $answer 0] eq "#"} {dict create any [my Block $answer]} else {dict create text [my Text $answer]}]
            }
            values { return [dict create floats [my Numbers [my Query $text]]] }
            write {
                my NeedRaw $text
                return [my Write $text [dict get $message any]]
            }
            read { return [my read [lrange $words 1 end]] }
            status { return [dict create ints [my Turn Status]] }
        }
        my Fault VERB "expected query, values, write, read or status, got \"$verb\"" $verb
    }

    # ---- a driver: options of the instrument, each with its SCPI ----

    method language {} { return SCPI }
    method settings options { return [my With set $options] }
    method asked options { return [my With get $options] }
    method askable {} { return "options with a question" }
    # Operators have the limits of its options.
    method NeedRaw text {
        if {[my table] ne {} && ![my cget -raw]} {
            my Fault RAW "write takes any message, also past the limits of its options: set an option, as \"[my name] CTRL [lindex [my With set [dict keys [my table]]] 0] ...\", or let\
                its recipe say -raw 1" $text
        }
    }
    # Those that have a message of this kind: set or get.
    method With {kind options} {
        return [lmap option $options {
            if {![dict exists [my table] $option] || [dict get [my table] $option $kind] eq {}} continue
            set option
        }]
    }
    method put values {
        set parts [lmap {option value} $values {my Of setting $option $value}]
        my Turn Tell [join $parts \;] 0
        return $values
    }
    # A part of a message (setting), the value of an answer (value), or a question (question).
    method Of {verb option args} {
        try {
            set others [concat {*}[lmap other [dict get [set row [dict get [my table] $option]] others] {list $other [my cget -$other]}]]
            return [::sorma::scpiTable::$verb [::sorma::scpiTable::fill $row $others] {*}$args]
        } trap SCPI_TABLE {why how} {
            my Fault [lindex [dict get $how -errorcode] 1] $why [lindex [dict get $how -errorcode] 2]
        }
    }
    method fetch options {
        set options [my With get $options]
        if {$options eq {}} return
        set values {}
        foreach option $options answer [my Turn AskAll [lmap option $options {my Of question $option}]] {
            lappend values $option [my Of value $option [my Text $answer]]
        }
        my learn $values
    }
    method AskAll questions {
        my Open
        return [lmap question $questions {
            my Send $question
            my Receive $question
        }]
    }
    method pollNow {} {
        sorma::async -command [list ::sorma::driver::polled [namespace code {my poll}]] [my name] EXEC read
    }

    # ---- messages ----

    # A message in which each part is a question, and its answer.
    method Query text {
        foreach part [my Heads $text] {
            if {![string match *\\? $part]} {
                my Fault QUESTION "\"$part\" is no question, and may change something: say write" $part
            }
        }
        return [my Turn Ask $text]
    }
    method Ask text {
        my Open
        my Send $text
        return [my Receive $text]
    }
    # Any message, with a block behind it if there are bytes. When it has a question, too, the answer is the result.
    method Write {text bytes} {
        set asks [expr {[lsearch -glob [my Heads $text] *\\?] >= 0}]
        if {$bytes ne {}} {
            set length [string length $bytes]
            append text "#[string length $length]$length$bytes"
        }
        return [my Turn Tell $text $asks]
    }
    method Tell {text asks} {
        my Open
        my Send $text
        set result [if {$asks} {dict create text [my Text [my Receive $text]]}]
        if {[my cget -check]} {
            my Errors $text
        }
        return $result
    }
    # Call a method when those before have ended. A coroutine that is deleted runs no `finally`.
    method Turn args {
        set me [info coroutine]
        set gone [namespace code [list my Gone $me]]
        trace add command $me delete $gone
        lappend Turns $me
        try {
            while {[lindex $Turns 0] ne $me} {
                yield
            }
            if {[sorma::cancelled]} {
                my Fault CANCELLED "given up before \"[string range [lindex $args 1] 0 100]\" was sent"
            }
            return [my {*}$args]
        } finally {
            trace remove command $me delete $gone
            my Next $me
        }
    }
    method Next me {
        set first [lindex $Turns 0]
        set Turns [lsearch -all -inline -not -exact $Turns $me]
        if {$first eq $me && $Turns ne {}} {
            after 0 [list catch [list [lindex $Turns 0]]]
        }
    }
    method Gone {me args} {
        if {[lindex $Turns 0] eq $me} {
            my Close
        }
        my Next $me
    }
    # The instrument's errors, the oldest first, are those of this request.
    method Errors text {
        set errors {}
        for {set n 0} {$n < 100} {incr n} {
            my Send SYST:ERR?
            set said [my Text [my Receive SYST:ERR?]]
            if {![regexp {^\s*([-+]?\d+)\s*(?:,(.*))?$} $said -> number meaning]} {
                my Fault ANSWER "SYST:ERR? has answered \"[string range $said 0 100]\", expected a number and a text" SYST:ERR?
            }
            scan $number %d number
            if {$number == 0} break
            lappend errors [list $number [string trim $meaning " \""]]
        }
        foreach error [lrange $errors 1 end] {
            sorma::warn [list SCPI DEVICE [lindex $error 0]] "[my name]: the instrument says [join $error {, }]"
        }
        if {$errors ne {}} {
            my Fault DEVICE "the instrument says [join [lindex $errors 0] {, }] to \"[string range $text 0 100]\"" [lindex $errors 0 0]
        }
    }
    # An answer is missing: the instrument may say why. The line is closed in any case.
    method Silent {text what} {
        try {
            if {$what eq "late" && [my cget -check] && $text ne "SYST:ERR?"} {
                my Errors $text
            }
        } trap {SORMA SCPI DEVICE} {why how} {
            return -options $how $why
        } trap {SORMA SCPI} {} {
        } finally {
            my Close
        }
        my Fault SILENT "no answer to \"[string range $text 0 100]\" within -patience [my cget -patience] s; the instrument may have executed it" $Opened
    }
    # The first words of the parts of a message. It must be one line.
    method Heads text {
        if {$text eq {} || [regexp {[^\x20-\x7e\t]} $text]} {
            my Fault TEXT "expected one line of ASCII, got \"[string range $text 0 100]\"" $text
        }
        return [lmap part [split [regsub -all {"[^"]*"|'[^']*'} $text {""}] \;] {lindex [split [string trim $part]] 0}]
    }
    method Text answer {
        return [string trim [encoding convertfrom iso8859-1 $answer]]
    }

    # ---- blocks and numbers ----

    method Block answer {
        set digits [string index $answer 1]
        return [if {$digits == 0} {string range $answer 2 end} else {string range $answer 2+$digits end}]
    }
    method Numbers answer {
        if {[string index $answer 0] ne "#"} {
            return [lmap number [split [my Text $answer] ,\;] {
                if {![string is double -strict [string trim $number]]} {
                    my Fault ANSWER "expected numbers, got \"[string range $answer 0 100]\""
                }
                expr {double($number)}
            }]
        }
        set bytes [my Block $answer]
        lassign [dict get {real32 {R r 4} real64 {Q q 8} int8 {c c 1} uint8 {cu cu 1} int16 {S s 2} uint16 {Su su 2} int32 {I i 4} uint32 {Iu iu 4}} [my cget -format]] big little size
        if {[string length $bytes] % $size != 0} {
            my Fault ANSWER "a block of [string length $bytes] bytes has no whole number of [my cget -format]"
        }
        binary scan $bytes [if {[my cget -order] eq "big"} {set big} else {set little}]* numbers
        return $numbers
    }

    # ---- the line ----

    method Parts to {
        if {[regexp {^tcp:(?:\[([^]\s]+)\]|([^:,\s]+)):([1-9]\d{0,4})$} $to -> six four port] && $port <= 65535} {
            return [list tcp $six$four $port]
        }
        if {[string match serial:* $to]} {
            try {
                return [list serial [::sorma::serial::parse [string range $to 7 end]]]
            } trap SERIAL why {
                my Fault ADDRESS "-to serial: $why" $to
            }
        }
        if {[regexp {^vxi11:(?:\[([^]\s]+)\]|([^:/,\s]+))(?::([1-9]\d{0,4}))?/([^/\s]+)$} $to -> six four port device] && ($port eq {} || $port <= 65535)} {
            return [list vxi11 $six$four [expr {$port eq {} ? 0 : $port}] $device]
        }
        if {[regexp {^hislip:(?:\[([^]\s]+)\]|([^:/,\s]+))(?::([1-9]\d{0,4}))?(?:/([^/\s]+))?$} $to -> six four port device] && ($port eq {} || $port <= 65535)} {
            return [list hislip $six$four [expr {$port eq {} ? 4880 : $port}] [expr {$device eq {} ? "hislip0" : $device}]]
        }
        if {[regexp {^usbtmc:(/[^\s,]+)$} $to -> path]} {
            return [list usbtmc $path]
        }
        my Fault ADDRESS "-to expects tcp:HOST:PORT, vxi11:HOST/DEVICE, vxi11:HOST:PORT/DEVICE, hislip:HOST, usbtmc:/dev/usbtmc0 or serial:PATH,BAUD,8n1, got \"$to\"" $to
    }
    method IsOpen {} {
        return [expr {$Line ne {} && [$Line isOpen]}]
    }
    method State {} {
        return [if {[my IsOpen]} {string cat "open to $Opened"} else {string cat closed}]
    }
    method Close {} {
        if {$Line ne {}} {
            $Line shut
        }
        return
    }
    method Open {} {
        set to [my cget -to]
        if {[my IsOpen]} {
            if {$to eq $Opened && [$Line idle]} return
            my Close
        }
        if {$to eq {}} {
            my Fault ADDRESS "no instrument: say \"[my name] CTRL -to tcp:HOST:PORT\""
        }
        set parts [lassign [my Parts $to] kind]
        if {$Line eq {} || $Kind ne $kind} {
            my NewLine $kind
        }
        set Opened $to
        if {$Kind in {vxi11 hislip}} {
            $Line requests [if {[my cget -requests]} {namespace code {my Requested}}]
        }
        try {
            $Line open {*}$parts [my Milliseconds]
        } trap {LINE WAIT} {} {
            my GiveUp UNREACHABLE "$to cannot be reached: nobody answers within -patience [my cget -patience] s; is the instrument switched on?" $to
        } trap {LINE OPEN} why {
            my GiveUp UNREACHABLE "$to cannot be opened: $why" $to
        } trap LINE why {
            my GiveUp UNREACHABLE "$to cannot be reached: $why; is the instrument switched on?" $to
        }
    }
    method NewLine kind {
        lassign [dict get $::sorma::scpi::Lines $kind] package class
        if {[catch {package require $package} why]} {
            my Fault UNREACHABLE "[my cget -to] cannot be opened: $why" [my cget -to]
        }
        if {$Line ne {}} {
            $Line destroy
        }
        set Line [$class new [namespace code {my Wait}]]
        set Kind $kind
    }
    method End {} {
        return [dict get {lf \n cr \r crlf \r\n} [my cget -terminator]]
    }
    method Send text {
        my Try $text write $text[my End] [my Milliseconds]
    }
    # The bytes of one answer, without its terminator.
    method Receive text {
        set answer [my Try $text read [my cget -most] [my Milliseconds] [my End]]
        set size [my Try $text size $answer]
        if {$size > [string length $answer]} {
            my GiveUp ANSWER "a block that ends after [string length $answer] bytes, sooner than it says" $Opened
        }
        return [if {$size < 0} {set answer} else {string range $answer 0 $size-1}]
    }
    # A call of the line for this message.
    method Try {text verb args} {
        try {
            return [if {$verb eq "size"} {::sorma::streamLine::size {*}$args [my End]} else {$Line $verb {*}$args}]
        } trap {LINE WAIT} {- how} {
            my Silent $text [lindex [dict get $how -errorcode] 2]
        } trap {LINE LATE} {} {
            my Silent $text late
        } trap {LINE LOCKED} {} {
            my GiveUp LOCKED "another client has locked the instrument, longer than -patience [my cget -patience] s" $Opened
        } trap {LINE BIG} why {
            my GiveUp TOO_BIG "an answer of $why, -most takes [my cget -most]" $Opened
        } trap {LINE UNSENT} why {
            my GiveUp LOST "the line to $Opened broke before the message was sent: $why" $Opened
        } trap {LINE LOST} why {
            my GiveUp LOST "the line to $Opened broke after \"[string range $text 0 100]\" was sent: $why" $Opened
        } trap LINE why {
            my GiveUp ANSWER "$Opened: $why" $Opened
        }
    }
    # Wait for a channel: ready, late, or cancelled. An object that is removed meanwhile has no coroutine any more.
    method Wait {event channel longer} {
        chan event $channel $event [list catch [list [info coroutine] ready]]
        set timer [after [expr {[my Milliseconds] + $longer}] [list catch [list [info coroutine] late]]]
        sorma::atCancel [list catch [list [info coroutine] cancelled]]
        set what [yield]
        sorma::atCancel {}
        after cancel $timer
        catch {chan event $channel $event {}}
        return $what
    }
    method Milliseconds {} {
        return [expr {int(1000 * [my cget -patience])}]
    }
    # The status byte: most lines have a way of their own.
    method Status {} {
        my Open
        if {$Kind in {vxi11 hislip usbtmc}} {
            return [my Try "the status byte" status [my Milliseconds]]
        }
        my Send *STB?
        set said [my Text [my Receive *STB?]]
        if {![regexp {^\+?\d{1,3}$} $said]} {
            my Fault ANSWER "*STB? has answered \"[string range $said 0 100]\", expected a number" *STB?
        }
        return [scan $said %d]
    }
    # It requests service. Reading the status byte takes its turn, and lets the instrument request it again.
    method Requested {} {
        sorma::async -command [list ::sorma::scpi::Requested [namespace code {my publish}]] [my name] EXEC status
    }
    # The line is of no use any more.
    method GiveUp {symbol text args} {
        my Close
        my Fault $symbol $text {*}$args
    }
    method Fault {symbol text args} {
        sorma::fail [list SCPI $symbol [my name] {*}$args] "[my name]: $text"
    }
}

package provide sorma::service::scpi 1.0
