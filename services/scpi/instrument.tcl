# instrument -- plays a supply, a multimeter or an oscilloscope, for tests without hardware. It speaks SCPI by TCP, VXI-11, HiSLIP or a serial line, with
# noise, and with faults on purpose.
#
#     instrument.sim CTRL -kind supply
#     instrument.sim CTRL -on                 the reply is the port; it listens on this host alone
#     instrument.sim CTRL -vxi11              the reply is another port, of VXI-11; its device is inst0
#     instrument.sim CTRL -serial             the reply is a pseudo terminal, as it were /dev/ttyUSB0
#     instrument.sim EXEC TMSG MEAS:VOLT?     the same without a line
#
# A table has all that it understands. Patterns are as manuals have them: the short form in capitals, what may be left out in brackets. Each line
# has an error queue of its own.

package require sorma
package require sorma::hislip
package require sorma::vxi11
package require sorma::vxi11Rpcbind

namespace eval ::sorma::service::instrument {
    # kind -> pattern -> what: value NAME LOW HIGH and word NAME CHOICES can be set and asked for; set NAME NUMBER has no argument; ask METHOD is
    # a question.
    variable Trees {
        supply {
            {[SOURce:]VOLTage[:LEVel]} {value voltage 0 30}
            {[SOURce:]CURRent[:LEVel]} {value current 0 3}
            {[SOURce:]VOLTage:PROTection[:LEVel]} {value protection 1 33}
            {OUTPut[:STATe]} {value output 0 1}
            {MEASure[:SCALar]:VOLTage[:DC]} {ask Voltage}
            {MEASure[:SCALar]:CURRent[:DC]} {ask Current}
        }
        multimeter {
            {[SENSe:]FUNCtion[:ON]} {word function {VOLT CURR RES}}
            {[SENSe:]VOLTage[:DC]:RANGe} {value range 0.1 1000}
            {[SENSe:]VOLTage[:DC]:NPLCycles} {value cycles 0.02 100}
            {MEASure[:SCALar]:VOLTage[:DC]} {ask Signal}
            {MEASure[:SCALar]:RESistance} {ask Load}
            READ {ask Reading}
        }
        oscilloscope {
            {TIMebase[:MAIN]:SCALe} {value timebase 1e-9 50}
            CHANnel1:SCALe {value scale 0.001 10}
            RUN {set running 1}
            STOP {set running 0}
            SINGle {set running 0}
            WAVeform:SOURce {word source CHAN1}
            WAVeform:FORMat {word format {WORD BYTE}}
            WAVeform:POINts {value points 1 33554432}
            WAVeform:PREamble {ask Preamble}
            WAVeform:XINCrement {ask Increment}
            WAVeform:DATA {ask Wave}
            DISPlay:DATA {ask Screen}
        }
    }
    variable Defaults {voltage 0 current 1 output 0 protection 33 function VOLT range 10 cycles 10
        timebase 1e-4 scale 1 running 1 source CHAN1 format WORD points 1000}
    variable Words {-100 {Command error} -104 {Data type error} -109 {Missing parameter} -113 {Undefined header} -222 {Data out of range} -224 {Illegal parameter value} -350 {Queue overflow}
        -363 {Input buffer overrun} -410 {Query INTERRUPTED} -420 {Query UNTERMINATED}}
    # A regular expression for headers in capitals: [SOURce:]VOLTage -> ^:?(?:SOUR(?:CE)?:)?VOLT(?:AGE)?$
    proc Expression pattern {
        return ^:?[string toupper [regsub -all {[a-z]+} [string map {\[ (?: \] )?} $pattern] {(?:&)?}]]\$
    }
}

oo::class create ::sorma::service::instrument {
    superclass sorma::Service

    sorma::purpose "plays an instrument that understands SCPI, for tests without hardware"
    sorma::option -kind enum -choices {supply multimeter oscilloscope} -default supply -help "what it plays"
    sorma::option -load double -unit ohm -range {0.1 1e6} -default 10 -help "what is connected to the supply, and what the multimeter measures"
    sorma::option -signal double -unit V -range {-1000 1000} -default 5 -help "what multimeter and oscilloscope see"
    sorma::option -noise double -range {0 1} -default 0.001 -help "of what is measured, as a share of it"
    sorma::option -fault enum -choices {none silent half garbage hangup} -default none -help "what becomes of its answers"
    sorma::option -terminator enum -choices {lf cr crlf} -default lf -help "what ends its answers, by TCP and by a serial line; each of them ends a message"
    sorma::option -link string -kind file -help "a name for the pseudo terminal of -serial, which stays the same when it is plugged in again"
    sorma::option -identity string -help "what *IDN? says, so that other programs take it for an instrument that they know; empty: SORMA, kind, name and 1.0"
    sorma::option -rpcbind flag -default 0 -help "rpcbind of this host tells clients the port of -vxi11, as lxi-tools and PyVISA ask for it"
    sorma::action -on {} "switch it on: the reply is the port where it listens, on this host alone" {my On}
    sorma::action -vxi11 {} "switch it on for VXI-11: the reply is the port, which rpcbind tells with -rpcbind alone; it listens on this host alone" {my OnVxi}
    sorma::action -hislip {} "switch it on for HiSLIP: the reply is the port, on this host alone" {my OnHislip}
    sorma::action -serial {} "plug in its serial line: the reply is the path of a pseudo terminal" {my OnSerial}
    sorma::action -off {} "switch it off: lines end, and what was set is forgotten" {my Off}
    sorma::inspection -port {} "where it listens; empty: it is off" {set Port}
    sorma::inspection -heard {} "the last message that it has got" {set Heard}
    sorma::inspection -lines {} "how many clients have a line" {my Clients}
    sorma::reads text 1.. "" "a message in SCPI"
    sorma::writes text 0.. "" "its answer"
    sorma::example "instrument.sim EXEC TMSG *IDN?"

    variable Server Port        ;# the listener and its port; empty: it is off
    variable Lines              ;# dict: channel -> what has come without its end
    variable Serial             ;# the serial line: channel, path, link, and the end that keeps the terminal while no client has it; empty: none
    variable Vxi Told Links     ;# the listener of VXI-11, empty: it is off; rpcbind tells its port; links so far
    variable Hislip             ;# the listener of HiSLIP, empty: it is off
    variable Errors             ;# dict: channel, number of a link, or own -> numbers
    variable Enabled            ;# dict: the same -> *SRE, once it was set: the bits of its status byte that request service
    variable Heard              ;# the last message
    variable Values             ;# dict: name -> number

    method born {} {
        set Server [set Port [set Lines [set Vxi [set Hislip [set Serial {}]]]]]
        set Links [set Told 0]
        set Enabled {}
        set Errors {own {}}
        my Reset
    }
    destructor {
        my Off
    }
    # It is one line of ASCII, without what separates answers.
    method changed options {
        if {"-identity" in $options && [regexp {[^\x20-\x7e]|;} [my cget -identity]]} {
            sorma::fail [list INSTRUMENT IDENTITY [my cget -identity]] "[my name]: -identity expects a line of ASCII without semicolons, got \"[string range [my cget -identity] 0 100]\""
        }
    }
    method dump {} {
        return [join [lmap {name value} $Values {string cat "$name $value"}] \n]
    }
    method exec message {
        return [dict create text [my Answer own [dict get $message text]]]
    }

    # ---- its lines ----

    method On {} {
        if {$Server eq {}} {
            set Server [socket -server [namespace code {my Accept}] -myaddr 127.0.0.1 0]
            set Port [lindex [chan configure $Server -sockname] 2]
        }
        return $Port
    }
    method Off {} {
        foreach channel [dict keys $Lines] {
            my HangUp $channel
        }
        if {$Server ne {}} {
            close $Server
        }
        if {$Vxi ne {}} {
            $Vxi destroy
        }
        if {$Hislip ne {}} {
            $Hislip destroy
        }
        if {$Told} {
            ::sorma::vxi11Rpcbind::forget
        }
        set Told 0
        set Server [set Port [set Lines [set Vxi [set Hislip {}]]]]
        set Errors {own {}}
        set Enabled {}
        my Reset
        return
    }
    method Clients {} {
        return [expr {[dict size $Lines] + ($Vxi eq {} ? 0 : [$Vxi lines]) + ($Hislip eq {} ? 0 : [$Hislip lines])}]
    }
    method Accept {channel args} {
        if {[dict size $Lines] >= 16} {
            return [close $channel]
        }
        chan configure $channel -blocking 0 -buffering none -translation binary
        chan event $channel readable [namespace code [list my Hear $channel]]
        dict set Lines $channel {}
        dict set Errors $channel {}
    }
    method Hear channel {
        if {[catch {read $channel 65536} piece] || [eof $channel] || [string length [dict get $Lines $channel]] > 65536} {
            return [my HangUp $channel]
        }
        dict append Lines $channel $piece
        while {[dict exists $Lines $channel] && [regexp {^([^\r\n]*)[\r\n](.*)$} [dict get $Lines $channel] -> text rest]} {
            dict set Lines $channel $rest
            set answer [my Answer $channel [string trim $text]]
            if {$answer ne {}} {
                my Say $channel $answer[dict get {lf \n cr \r crlf \r\n} [my cget -terminator]]
            }
        }
    }
    method Say {channel answer} {
        switch -- [my cget -fault] {
            silent { return }
            half { set answer [string range $answer 0 [expr {[string length $answer] / 2 - 1}]] }
            garbage { set answer "\xff\x00\x80garbage\n" }
            hangup { return [my HangUp $channel] }
        }
        if {[catch {puts -nonewline $channel $answer}]} {
            my HangUp $channel
        }
    }
    method HangUp channel {
        if {$channel eq [lindex $Serial 0]} {
            my Unplug
        }
        catch {close $channel}
        dict unset Lines $channel
        dict unset Errors $channel
        dict unset Enabled $channel
    }

    # socat has the terminal, and its own input and output are our channel.
    method OnSerial {} {
        if {$Serial ne {}} {
            return [lindex $Serial 1]
        }
        if {[auto_execok socat] eq {}} {
            sorma::fail {INSTRUMENT SERIAL} "[my name]: socat is not installed; it makes pseudo terminals (apt-get install socat)"
        }
        set link [my cget -link]
        if {$link ne {} && ![catch {file type $link} type] && !($type eq "link" && [string match /dev/pts/* [file readlink $link]])} {
            sorma::fail [list INSTRUMENT SERIAL $link] "[my name]: -link expected a new name, got \"$link\": a $type has it"
        }
        lassign [chan pipe] said saying
        set channel [open |[list socat -d -d pty,raw,echo=0 - 2>@$saying] {RDWR}]
        close $saying
        while {[gets $said text] >= 0 && ![regexp {PTY is (/\S+)} $text -> path]} {
        }
        try {
            if {![info exists path]} {
                sorma::fail {INSTRUMENT SERIAL} "[my name]: socat makes no pseudo terminal; it says \"$text\""
            }
            set kept [open $path {RDWR NOCTTY NONBLOCK}]
            if {$link ne {}} {
                file delete $link
                file link -symbolic $link $path
            }
        } on error {why how} {
            catch {close $said}
            catch {close $channel}
            return -options $how $why
        }
        set Serial [list $channel [if {$link eq {}} {set path} else {set link}] $link $kept $said]
        my Accept $channel
        return [lindex $Serial 1]
    }
    method Unplug {} {
        lassign $Serial channel path link kept said
        set Serial {}
        if {$link ne {}} {
            catch {file delete $link}
        }
        catch {exec kill [pid $channel]}
        foreach end [list $kept $said] {
            catch {close $end}
        }
    }

    method OnVxi {} {
        set server [if {$Vxi ne {}} {set Vxi} else {::sorma::vxi11::server new [namespace code {my Vxi}] 127.0.0.1 0}]
        if {[my cget -rpcbind] && !$Told} {
            if {[catch {::sorma::vxi11Rpcbind::tell [$server port] "set -rpcbind 0"} why]} {
                if {$Vxi eq {}} {
                    $server destroy
                }
                sorma::fail {INSTRUMENT RPCBIND} "[my name]: -rpcbind 1: $why"
            }
            set Told 1
        }
        set Vxi $server
        return [$Vxi port]
    }
    method OnHislip {} {
        if {$Hislip eq {}} {
            set Hislip [::sorma::hislip::server new [namespace code {my Vxi}] 127.0.0.1 0]
        }
        return [$Hislip port]
    }
    # The commands that sorma::vxi11 and sorma::hislip want of an instrument.
    method Vxi {verb args} {
        lassign $args id
        switch -- $verb {
            open {
                if {[lindex $args 1] ne "inst0"} return
                dict set Errors [incr Links] {}
                return $Links
            }
            owns { return 1 }
            device { return inst0 }
            whole { return [expr {[string last \n $id] + 1}] }
            message { my Message {*}$args }
            status { return [my Status $id [lindex $args 1]] }
            wrong { my Queue {*}$args }
            close {
                dict unset Errors $id
                dict unset Enabled $id
            }
        }
    }
    method Message {id bytes done} {
        set answers [lmap text [split $bytes \n] {
            if {[set answer [my Answer $id [string trim $text]]] eq {}} continue
            string cat $answer \n
        }]
        set answer [join $answers {}]
        switch -- [if {$answer eq {}} {string cat none} else {my cget -fault}] {
            silent { set answer {} }
            half { return [{*}$done [string range $answer 0 [expr {[string length $answer] / 2 - 1}]] 0] }
            garbage { set answer "\xff\x00\x80garbage\n" }
            hangup { throw {VXI11 HANGUP} "a fault on purpose" }
        }
        {*}$done $answer
    }

    # ---- what it understands ----

    method Reset {} {
        set Values $::sorma::service::instrument::Defaults
        set Heard {}
    }
    # The answers to all parts of a message; an error goes into the queue of who has asked.
    method Answer {who text} {
        if {$text ne {}} {
            set Heard $text
        }
        set answers {}
        foreach part [split $text \;] {
            set part [string trim $part]
            if {$part eq {}} continue
            try {
                set answer [my Part $who {*}[my Split $part]]
                if {$answer ne {}} {
                    lappend answers $answer
                }
            } trap SCPI {number} {
                my Queue $who $number
            }
        }
        return [join $answers \;]
    }
    method Split part {
        regexp {^(\S+)\s*(.*)$} $part -> head argument
        return [list [string toupper [string trimright $head ?]] [string match *\\? $head] $argument]
    }
    method Part {who head asks argument} {
        switch -- $head?$asks {
            *IDN?1 { return [if {[my cget -identity] eq {}} {string cat "SORMA,[my cget -kind],[my name],1.0"} else {my cget -identity}] }
            *RST?0 { my Reset; return }
            *CLS?0 { dict set Errors $who {}; return }
            *OPC?0 - *WAI?0 { return }
            *OPC?1 { return 1 }
            *TST?1 { return 0 }
            *STB?1 { return [my Status $who 0] }
            *SRE?0 { dict set Enabled $who [expr {round([my Number $argument 0 255])}]; return }
            *SRE?1 { return [my Enabled $who] }
            SYST:ERR?1 - SYSTEM:ERROR?1 - SYST:ERR:NEXT?1 - SYSTEM:ERROR:NEXT?1 { return [my NextError $who] }
        }
        dict for {pattern what} [dict get $::sorma::service::instrument::Trees [my cget -kind]] {
            if {[regexp [::sorma::service::instrument::Expression $pattern] $head]} {
                lassign $what how name low high
                if {$how eq "ask" || $how eq "set" && $asks} {
                    return [if {$how eq "ask" && $asks} {my $name} else {throw SCPI -113}]
                }
                return [if {$asks} {dict get $Values $name} else {
                    dict set Values $name [switch -- $how {set {set low} word {my Word $argument $low} default {my Number $argument $low $high}}]
                    list
                }]
            }
        }
        throw SCPI -113
    }
    method Enabled who { return [expr {[dict exists $Enabled $who] ? [dict get $Enabled $who] : 0}] }
    # Bit 4: an error waits; bit 16: an answer; bit 64: one of these requests service.
    method Status {who available} {
        set byte [expr {([dict get $Errors $who] eq {} ? 0 : 4) | ($available ? 16 : 0)}]
        return [expr {$byte | ($byte & [my Enabled $who] ? 64 : 0)}]
    }
    method Word {argument choices} {
        set word [string toupper [string trim $argument "\"'"]]
        return [if {$word in $choices} {set word} else {throw SCPI -224}]
    }
    method Number {argument low high} {
        switch -nocase -- $argument {
            {} { throw SCPI -109 }
            MIN - OFF { return $low }
            MAX - ON { return $high }
        }
        if {![regexp -nocase {^([-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?)\s*([UMK]?)(?:V|A|OHM)?$} $argument -> number scale]} {
            throw SCPI -104
        }
        set number [expr {$number * [dict get {{} 1 U 1e-6 M 1e-3 K 1e3} [string toupper $scale]]}]
        return [if {$number < $low || $number > $high} {throw SCPI -222} else {set number}]
    }
    method Queue {who number} {
        set queue [dict get $Errors $who]
        dict set Errors $who [if {[llength $queue] < 20} {concat $queue $number} else {lreplace $queue end end -350}]
    }
    method NextError who {
        set queue [dict get $Errors $who]
        if {$queue eq {}} {
            return {0,"No error"}
        }
        dict set Errors $who [lassign $queue number]
        return "$number,\"[dict get $::sorma::service::instrument::Words $number]\""
    }

    # ---- what it measures ----

    method Noisy x { return [format %.6E [expr {$x * (1 + [my cget -noise] * (2 * rand() - 1))}]] }
    # A supply limits its current.
    method Volts {} {
        return [expr {[dict get $Values output] * min([dict get $Values voltage], [dict get $Values current] * [my cget -load])}]
    }
    method Voltage {} { return [my Noisy [my Volts]] }
    method Current {} { return [my Noisy [expr {[my Volts] / [my cget -load]}]] }
    method Load {} { return [my Noisy [my cget -load]] }
    method Signal {} {
        return [if {[my cget -kind] eq "multimeter" && abs([my cget -signal]) > [dict get $Values range]} {string cat 9.9E37} else {my Noisy [my cget -signal]}]
    }
    method Reading {} {
        return [switch -- [dict get $Values function] {RES {my Load} CURR {my Noisy [expr {[my cget -signal] / [my cget -load]}]} default {my Signal}}]
    }
    method Increment {} { return 1.0E-6 }
    # A sine of 1 kHz, a 1 MHz sample each, as a block: WORD is int16 in mV, BYTE is uint8 around 128, of which 100 are the peak.
    method Wave {} {
        set peak [expr {1000 * [my cget -signal]}]
        set byte [expr {[dict get $Values format] eq "BYTE"}]
        set period [binary format [expr {$byte ? "c*" : "S*"}] [lmap k [lrepeat 1000 x] {
            set y [expr {sin(8 * atan(1) * [incr n] / 1000)}]
            expr {$byte ? 128 + round(100 * $y) : max(-32768, min(32767, round($peak * $y)))}
        }]]
        set size [expr {($byte ? 1 : 2) * round([dict get $Values points])}]
        return [my Block [string range [string repeat $period [expr {$size / [string length $period] + 1}]] 0 $size-1]]
    }
    method Block bytes {
        set size [string length $bytes]
        return "#[string length $size]$size$bytes"
    }
    # The numbers are format, type, points and count; increment, origin and reference of x; the same of y.
    method Preamble {} {
        set byte [expr {[dict get $Values format] eq "BYTE"}]
        return "[expr {!$byte}],0,[expr {round([dict get $Values points])}],1,1.0E-6,1.0E-6,0,[expr {$byte ? [my cget -signal] / 100.0 : 1e-3}],0,[expr {$byte ? 128 : 0}]"
    }
    # Its screen as a picture (PNG): a period, 200 pixels wide, 100 high.
    method Screen {args} {
        set rows {}
        for {set y 0} {$y < 100} {incr y} {
            append rows \0 [string repeat \0 200]
        }
        for {set x 0} {$x < 200} {incr x} {
            set at [expr {201 * round(50 - 45 * sin(8 * atan(1) * $x / 200)) + 1 + $x}]
            set rows [string replace $rows $at $at \xff]
        }
        set png \x89PNG\r\n\x1a\n
        foreach {type bytes} [list IHDR [binary format IIccccc 200 100 8 0 0 0 0] IDAT [zlib compress $rows] IEND {}] {
            append png [binary format I [string length $bytes]] $type $bytes [binary format I [zlib crc32 $type$bytes]]
        }
        return [my Block $png]
    }
}

package provide sorma::service::instrument 1.0
