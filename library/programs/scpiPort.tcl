# scpiPort.tcl -- the objects of this process as an instrument: SCPI-99 after IEEE 488.2, by lines of TCP on 127.0.0.1.
#
#     ::sorma::scpiPort::listen 5025      then FOO:A:TEMPo presto, FOO:A:TEMPo?, FOO:A:EXEC
#
# Each link is a dict of its own, with its error queue and registers. A link has one request under way, which is cancelled when the client hangs up.
# Requests are asynchronous, and the author is who the kernel says is at the other end. Answers are bytes.

package require sorma
package provide sorma::scpiPort 1.0

namespace eval ::sorma::scpiPort {
    variable Links {}           ;# dict: channel -> dict: who input work future blocks path errors esr ese sre
    variable Works 0            ;# coroutines so far. A name of a channel may come again while one still ends
    variable MostLinks 64
    variable MostInput 65536    ;# bytes of a line
    variable MostOutput 1048576 ;# bytes that a client has not read
    variable Words {
        -102 {Syntax error} -104 {Data type error} -108 {Parameter not allowed} -109 {Missing parameter} -113 {Undefined header}
        -131 {Invalid suffix} -200 {Execution error} -203 {Command protected} -221 {Settings conflict} -222 {Data out of range}
        -224 {Illegal parameter value} -350 {Queue overflow} -363 {Input buffer overrun} -365 {Time out error}
    }
    # Error codes of the bus as numbers of SCPI; the first that fits.
    variable Numbers {
        {SORMA OPTION RANGE *} -222 {SORMA OPTION VALUE *} -224 {SORMA OPTION READONLY *} -221 {SORMA OPTION UNKNOWN *} -113
        {SORMA COMM DENIED *} -203 {SORMA COMM TIMEOUT *} -365 * -200
    }
    variable Scales {EX 1e18 PE 1e15 T 1e12 G 1e9 MA 1e6 K 1e3 {} 1 M 1e-3 U 1e-6 N 1e-9 P 1e-12 F 1e-15 A 1e-18}
}

# ::sorma::scpiPort::listen --
#       Answer SCPI on a port of this host.
# Arguments:
#       port    0: a free one
# Results:
#       The port.
proc ::sorma::scpiPort::listen port {
    set server [socket -server ::sorma::scpiPort::Accept -myaddr 127.0.0.1 $port]
    return [lindex [chan configure $server -sockname] 2]
}

# ---- links ----

proc ::sorma::scpiPort::Accept {channel args} {
    variable Links
    variable MostLinks
    if {[dict size $Links] >= $MostLinks} {
        return [close $channel]
    }
    chan configure $channel -blocking 0 -translation binary
    dict set Links $channel [dict create who [::sorma::WhoIs $channel] input {} work {} future {} blocks {} path {} errors {} esr 128 ese 0 sre 0]
    chan event $channel readable [list ::sorma::scpiPort::Hear $channel]
}

proc ::sorma::scpiPort::HangUp channel {
    variable Links
    if {[dict exists $Links $channel] && [dict get $Links $channel future] ne {}} {
        catch {[dict get $Links $channel future] cancel}
    }
    dict unset Links $channel
    catch {close $channel}
}

proc ::sorma::scpiPort::Hear channel {
    variable Links
    variable MostInput
    variable Works
    if {[catch {read $channel 16384} piece] || [eof $channel]} {
        return [HangUp $channel]
    }
    set input [dict get $Links $channel input]$piece
    dict set Links $channel input $input
    if {[dict get $Links $channel work] ne {}} {
        # One that only sends waits.
        if {[string length $input] > $MostInput} {
            chan event $channel readable {}
        }
    } elseif {[lindex [Take $input] 0] >= 0} {
        dict set Links $channel work ::sorma::scpiPort::work[incr Works]
        coroutine ::sorma::scpiPort::work$Works ::sorma::scpiPort::Work $channel
    } elseif {[string length $input] > $MostInput} {
        Say $channel {-363,"Input buffer overrun"}
        HangUp $channel
    }
}

# The first line: where it ends (-1: it is not whole), the line, and the blocks of bytes (#15hello) in it. In the line each is #B:N.
proc ::sorma::scpiPort::Take input {
    set line {}
    set blocks {}
    set at 0
    while {[regexp -indices -start $at {\n|"[^"\n]*"|'[^'\n]*'|[ \t,]#[1-9]} $input hit]} {
        lassign $hit first last
        append line [string range $input $at $last]
        set at [expr {$last + 1}]
        if {[string index $input $first] eq "\n"} {
            return [list $first [string range $line 0 end-1] $blocks]
        }
        if {[string index $input $last-1] ne "#"} continue
        set digits [string index $input $last]
        set size [string range $input $at [expr {$at + $digits - 1}]]
        if {![string is digit $size]} continue
        if {[string length $size] < $digits || [string length $input] < $at + $digits + [scan $size %lld]} break
        set at [expr {$at + $digits}]
        set line [string range $line 0 end-1]B:[llength $blocks]
        lappend blocks [string range $input $at [expr {$at + [scan $size %lld] - 1}]]
        incr at [scan $size %lld]
    }
    return {-1 {} {}}
}

# Execute the lines that are there, one after another; then read on.
proc ::sorma::scpiPort::Work channel {
    variable Links
    while {[Mine $channel] && [lindex [set taken [Take [dict get $Links $channel input]]] 0] >= 0} {
        lassign $taken end line blocks
        dict set Links $channel input [string range [dict get $Links $channel input] $end+1 end]
        dict set Links $channel blocks $blocks
        Message $channel [string trim $line]
        # Others come first.
        after 0 [list [info coroutine]]
        yield
    }
    if {[Mine $channel]} {
        dict set Links $channel work {}
        chan event $channel readable [list ::sorma::scpiPort::Hear $channel]
    }
}

# Has the link of this coroutine not ended?
proc ::sorma::scpiPort::Mine channel {
    variable Links
    return [expr {[dict exists $Links $channel] && [dict get $Links $channel work] eq [info coroutine]}]
}

proc ::sorma::scpiPort::Say {channel text} {
    variable MostOutput
    if {[catch {puts $channel $text; flush $channel}] || [chan pending output $channel] > $MostOutput} {
        HangUp $channel
    }
}

# All parts of a message; the answers are one line.
proc ::sorma::scpiPort::Message {channel text} {
    variable Links
    dict set Links $channel path {}
    set answers {}
    foreach part [Cut $text \;] {
        if {[set part [string trim $part]] eq {}} continue
        try {
            if {![regexp {^([*:]?[A-Za-z][\w:.-]*)(\??)(?:\s+(.*))?$} $part -> head asks rest]} {
                Fail -102 $part
            }
            set answer [Part $channel $head [string equal $asks ?] [lmap word [Cut $rest ,] {string trim $word}]]
            if {$asks ne {}} {
                lappend answers $answer
            }
        } trap SCPI why {
            set error $why
        } on error {why how} {
            set error [list [NumberOf [dict get $how -errorcode]] $why]
        }
        if {![Mine $channel]} return
        if {[info exists error]} {
            Queue $channel {*}$error
            unset error
        }
    }
    if {$answers ne {}} {
        Say $channel [join $answers \;]
    }
}

# Split at a character that stands outside of quotes. Nothing makes no part.
proc ::sorma::scpiPort::Cut {text at} {
    set parts {}
    set part {}
    foreach piece [regexp -all -inline "\"\[^\"\]*\"?|'\[^'\]*'?|\[^\"'$at\]+|$at" $text] {
        if {$piece eq $at} {
            lappend parts $part
            set part {}
        } else {
            append part $piece
        }
    }
    return [if {$parts eq {} && [string trim $part] eq {}} {list} else {linsert $parts end $part}]
}

# ---- errors and registers ----

proc ::sorma::scpiPort::Fail {number {detail {}}} {
    throw SCPI [list $number $detail]
}

proc ::sorma::scpiPort::NumberOf code {
    variable Numbers
    dict for {pattern number} $Numbers {
        if {[string match $pattern "$code "]} {
            return $number
        }
    }
}

proc ::sorma::scpiPort::Queue {channel number {detail {}}} {
    variable Links
    variable Words
    if {![dict exists $Links $channel]} return
    set text [dict get $Words $number]
    if {$detail ne {}} {
        append text ";[regsub -all {[^ -~]+} $detail ?]"
    }
    set error "$number,[Quoted [string range $text 0 200]]"
    set bit [expr {$number > -200 ? 32 : $number > -300 ? 16 : 8}]
    set errors [dict get $Links $channel errors]
    dict set Links $channel errors [if {[llength $errors] < 20} {linsert $errors end $error} else {lreplace $errors end end {-350,"Queue overflow"}}]
    dict set Links $channel esr [expr {[dict get $Links $channel esr] | $bit}]
}

proc ::sorma::scpiPort::Status channel {
    variable Links
    dict with Links $channel {
        set status [expr {($errors ne {} ? 4 : 0) | (($esr & $ese) ? 32 : 0)}]
        return [expr {$status | (($status & $sre & ~64) ? 64 : 0)}]
    }
}

proc ::sorma::scpiPort::Quoted text {
    return "\"[string map {\" \"\"} $text]\""
}

# ---- commands ----

proc ::sorma::scpiPort::Part {channel head asks words} {
    variable Links
    set head [string toupper $head]
    switch -regexp -matchvar match -- [expr {$asks ? "$head?" : $head}] {
        {^\*IDN\?$} { return "SORMA,sormad,[pid],[package present sorma]" }
        {^\*TST\?$} { return 0 }
        {^\*OPC\?$} { return 1 }
        {^\*STB\?$} { return [Status $channel] }
        {^\*(ES|SR)E\?$} { return [dict get $Links $channel [string tolower [string range $head 1 end]]] }
        {^\*(ES|SR)E$} { return [dict set Links $channel [string tolower [string range $head 1 end]] [Mask $words]] }
        {^\*ESR\?$} {
            set esr [dict get $Links $channel esr]
            dict set Links $channel esr 0
            return $esr
        }
        {^\*CLS$} {
            dict set Links $channel errors {}
            return [dict set Links $channel esr 0]
        }
        {^\*OPC$} { return [dict set Links $channel esr [expr {[dict get $Links $channel esr] | 1}]] }
        {^\*(RST|WAI)$} { return }
        {^:?SYST(EM)?:ERR(OR)?(:NEXT)?\?$} {
            dict set Links $channel errors [lassign [dict get $Links $channel errors] error]
            return [expr {$error eq {} ? "0,\"No error\"" : $error}]
        }
        {^:?SYST(EM)?:ERR(OR)?:COUN(T)?\?$} { return [llength [dict get $Links $channel errors]] }
        {^:?SYST(EM)?:VERS(ION)?\?$} { return 1999.0 }
        {^:?SYST(EM)?:HELP:HEAD(ERS)?\?$} { return [Headers $channel] }
        {^\*} { Fail -113 $head }
    }
    # After FOO:A:TEMP, a header without a colon begins with FOO:A, too.
    set nodes [split [string trimleft $head :] :]
    set path [dict get $Links $channel path]
    if {![string match :* $head] && $path ne {}} {
        set nodes [concat $path $nodes]
    }
    dict set Links $channel path [lrange $nodes 0 end-1]
    return [Object $channel [join [lrange $nodes 0 end-1] .] [lindex $nodes end] $asks $words]
}

proc ::sorma::scpiPort::Mask words {
    if {[llength $words] != 1} {
        Fail [expr {[llength $words] ? -108 : -109}]
    }
    if {![regexp {^\d{1,3}$} $words] || [scan $words %d] > 255} {
        Fail -222 $words
    }
    return [scan $words %d]
}

# A request in the name of who asks. Only this coroutine waits.
proc ::sorma::scpiPort::Ask {channel args} {
    variable Links
    if {![Mine $channel]} {
        Fail -200
    }
    set future [::sorma::async -as [dict get $Links $channel who] -command [info coroutine] {*}$args]
    dict set Links $channel future $future
    yield
    if {[Mine $channel]} {
        dict set Links $channel future {}
    }
    return [$future take]
}

proc ::sorma::scpiPort::Short word {
    set word [string toupper $word]
    return [string range $word 0 [expr {[string length $word] > 4 && [string index $word 3] in {A E I O U} ? 2 : 3}]]
}

proc ::sorma::scpiPort::Object {channel name node asks words} {
    set found [lsearch -exact -inline -nocase [::sorma::names] $name]
    if {$found eq {}} {
        Fail -113 $name:$node
    }
    if {$node eq "EXEC"} {
        return [Execute $channel $found $asks $words]
    }
    set table [::sorma::so::$found configure]
    set fits [lsearch -all -inline -nocase -index 0 -exact $table -$node]
    if {$fits eq {}} {
        set fits [lmap row $table {if {[Short [string range [lindex $row 0] 1 end]] ne $node} continue; set row}]
    }
    if {[llength $fits] != 1} {
        Fail -113 $name:$node
    }
    lassign [lindex $fits 0] option type unit range default
    if {$asks} {
        # The right to inspect is asked for limits, too.
        set value [Ask $channel $found cget $option]
        if {[llength $words] > 1} {
            Fail -108
        }
        return [Shown $type [if {$words eq {}} {set value} else {Limit [lindex $words 0] $range $default}]]
    }
    if {$words eq {}} {
        Fail -109 $option
    }
    if {$type ne "vector" && [llength $words] > 1} {
        Fail -108 $option
    }
    Ask $channel $found CTRL $option [join [lmap word $words {Given $word $type $unit $range $default}]]
    return
}

proc ::sorma::scpiPort::Limit {word range default} {
    switch -nocase -- $word {
        MIN - MINIMUM { set limit [lindex $range 0] }
        MAX - MAXIMUM { set limit [lindex $range end] }
        DEF - DEFAULT { return $default }
        default { Fail -224 $word }
    }
    return [if {[string is double -strict $limit]} {set limit} else {Fail -224 $word}]
}

# A parameter as the option takes it.
proc ::sorma::scpiPort::Given {word type unit range default} {
    variable Scales
    set quoted [regexp {^(["'])(.*)\1$} $word -> quote text]
    if {$quoted} {
        set word [string map [list $quote$quote $quote] $text]
    }
    switch -- $type {
        flag { return [string map -nocase {ON 1 OFF 0} $word] }
        enum {
            set choice [lsearch -exact -inline -nocase $range $word]
            return [expr {$choice eq {} ? $word : $choice}]
        }
        int - double - vector {}
        default { return $word }
    }
    if {$quoted} {
        Fail -104 $word
    }
    if {[regexp -nocase {^(?:MIN|MAX|DEF)} $word]} {
        return [Limit $word $range $default]
    }
    if {![regexp {^([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)$} $word -> number suffix]} {
        Fail -104 $word
    }
    if {$suffix eq {}} {
        return $number
    }
    set suffix [string toupper $suffix]
    set own [string toupper $unit]
    set scale [string range $suffix 0 end-[string length $own]]
    if {$own eq {} || "$scale$own" ne $suffix || ![dict exists $Scales $scale]} {
        Fail -131 $word
    }
    # MHZ and MOHM are mega in SCPI.
    return [expr {$number * ($scale eq "M" && $own in {HZ OHM} ? 1e6 : [dict get $Scales $scale])}]
}

proc ::sorma::scpiPort::Shown {type value} {
    switch -- $type {
        int - double - flag { return $value }
        enum { return [string toupper $value] }
        vector { return [join $value ,] }
    }
    return [encoding convertto utf-8 [Quoted $value]]
}

proc ::sorma::scpiPort::Block bytes {
    return "#[string length [string length $bytes]][string length $bytes]$bytes"
}

# Numbers become floats, quoted parameters the text, blocks the bytes, others words.
proc ::sorma::scpiPort::Execute {channel name asks words} {
    variable Links
    set floats [set rest [set text [set any {}]]]
    foreach word $words {
        if {[regexp {^#B:(\d+)$} $word -> n]} {
            append any [lindex [dict get $Links $channel blocks] $n]
        } elseif {[string is double -strict $word]} {
            lappend floats $word
        } elseif {[regexp {^["']} $word]} {
            append text [Given $word string {} {} {}]
        } else {
            lappend rest $word
        }
    }
    set reply [Ask $channel $name exec -text $text -floats $floats -any $any {*}$rest]
    if {!$asks} return
    set answer {}
    dict for {key value} $reply {
        switch -- $key {
            text { if {$value ne {}} {lappend answer [encoding convertto utf-8 [Quoted $value]]} }
            any { if {$value ne {}} {lappend answer [Block $value]} }
            floats - ints { lappend answer {*}$value }
        }
    }
    return [expr {$answer eq {} ? [dict get $reply code] : [join $answer ,]}]
}

# All headers of objects that one may inspect.
proc ::sorma::scpiPort::Headers channel {
    set all {*IDN? *RST *TST? *OPC *CLS *ESR? *ESE *STB? *SRE *WAI SYSTem:ERRor? SYSTem:ERRor:COUNt? SYSTem:VERSion? SYSTem:HELP:HEADers?}
    foreach name [lsort [::sorma::names]] {
        if {[string match *@* $name] || [catch {Ask $channel $name cget -nothing} why how] && [lrange [dict get $how -errorcode] 0 2] eq {SORMA COMM DENIED}} continue
        set path [string map {. :} [string toupper $name]]
        foreach row [::sorma::so::$name configure] {
            set word [string range [lindex $row 0] 1 end]
            set short [Short $word]
            lappend all $path:$short[string tolower [string range $word [string length $short] end]]
        }
        lappend all $path:EXEC
    }
    return [Block [encoding convertto utf-8 [join $all \n]]]
}
