# scpiLink.tcl -- the objects of this process as an instrument: SCPI-99 after IEEE 488.2. One place turns messages into answers, for all doors.
#
#     set id [::sorma::scpiLink open $channel]        ::sorma::scpiLink message $id {FOO:A:TEMPo?} $done
#
# Each link is a dict of its own, with its error queue and registers. A link has one request under way, which is cancelled when the link ends.
# Requests are asynchronous, and the author is who the kernel says is at the other end. Messages and answers are bytes. The commands are those
# that sorma::vxi11 wants of an instrument.

package require sorma
package require sorma::scpiEvents
package provide sorma::scpiLink 1.0

namespace eval ::sorma::scpiLink {
    namespace export open owns device first whole message trigger status wrong watch clear close
    namespace ensemble create
    variable Links {}           ;# dict: id -> dict: who device home path errors esr ese sre work future blocks
    variable Serial 0           ;# links so far
    variable Works 0            ;# coroutines so far. One that was cancelled may still end
    variable MostAnswer 134217728   ;# bytes of an answer
    variable Words {
        -102 {Syntax error} -104 {Data type error} -108 {Parameter not allowed} -109 {Missing parameter} -113 {Undefined header}
        -131 {Invalid suffix} -161 {Invalid block data} -200 {Execution error} -203 {Command protected} -221 {Settings conflict} -222 {Data out of range}
        -224 {Illegal parameter value} -350 {Queue overflow} -363 {Input buffer overrun} -365 {Time out error} -410 {Query INTERRUPTED}
        -420 {Query UNTERMINATED} -430 {Query DEADLOCKED}
    }
    # Error codes of the bus as numbers of SCPI; the first that fits.
    variable Numbers {
        {SORMA OPTION RANGE *} -222 {SORMA OPTION VALUE *} -224 {SORMA OPTION READONLY *} -221 {SORMA OPTION UNKNOWN *} -113
        {SORMA COMM DENIED *} -203 {SORMA COMM TIMEOUT *} -365 * -200
    }
    # Headers of SYSTem in their short forms.
    variable Forms {:SYSTEM: SYST: SYSTEM: SYST: :SYST: SYST: ERROR ERR COUNT COUN VERSION VERS HEADERS HEAD EVENT EVEN}
    variable Scales {EX 1e18 PE 1e15 T 1e12 G 1e9 MA 1e6 K 1e3 {} 1 M 1e-3 U 1e-6 N 1e-9 P 1e-12 F 1e-15 A 1e-18}
}

# ---- links ----

# ::sorma::scpiLink::open --
#       A new link.
# Arguments:
#       channel     of TCP: who is at the other end is the author
#       device      inst0 is all of this process, another name an object: its options need no path
# Results:
#       Its id. Empty: there is no such object, or not for this author.
proc ::sorma::scpiLink::open {channel {device inst0}} {
    variable Links
    variable Serial
    set who [::sorma::WhoIs $channel]
    set home {}
    set device [string tolower $device]
    if {$device ne "inst0"} {
        set found [lsearch -exact -inline -nocase [::sorma::names] $device]
        if {$found eq {} || ![::sorma::scpiEvents::may $who $found]} return
        set home [split [string toupper $found] .]
        set device $found
    }
    dict set Links [incr Serial] [dict create who $who device $device home $home path {} errors {} esr 128 ese 0 sre 0 work {} future {} blocks {}]
    return $Serial
}

proc ::sorma::scpiLink::close id {
    variable Links
    clear $id
    if {[dict get $Links $id work] ni [list {} [info coroutine]]} {
        rename [dict get $Links $id work] {}
    }
    ::sorma::scpiEvents::end $id
    dict unset Links $id
}

# ::sorma::scpiLink::clear ID -- cancel what is executed. Its coroutine ends when it hears of that.
proc ::sorma::scpiLink::clear id {
    variable Links
    set future [dict get $Links $id future]
    if {$future ne {}} {
        dict set Links $id work {}
        dict set Links $id future {}
        catch {$future cancel}
    }
}

# ::sorma::scpiLink::watch ID PREFIX -- call PREFIX when the status byte may have changed without a message.
proc ::sorma::scpiLink::watch {id prefix} {
    ::sorma::scpiEvents::watch $id $prefix
}

# ::sorma::scpiLink::owns ID CHANNEL -- does the link belong to who is at the other end there?
proc ::sorma::scpiLink::owns {id channel} {
    variable Links
    return [expr {[dict get $Links $id who] eq [::sorma::WhoIs $channel]}]
}

proc ::sorma::scpiLink::device id {
    variable Links
    return [dict get $Links $id device]
}

# ::sorma::scpiLink::trigger ID -- the message of a trigger; inst0 has none.
proc ::sorma::scpiLink::trigger id {
    variable Links
    return [if {[dict get $Links $id home] ne {}} {string cat EXEC}]
}

# ---- messages ----

# ::sorma::scpiLink::first BYTES -- how many bytes the first line has, with its end; 0: it is not whole.
proc ::sorma::scpiLink::first bytes {
    return [expr {[lindex [Take $bytes 0] 0] + 1}]
}

# ::sorma::scpiLink::whole BYTES -- how many of these bytes are lines that are whole.
proc ::sorma::scpiLink::whole bytes {
    set size 0
    while {[set end [lindex [Take $bytes $size] 0]] >= 0} {
        set size [expr {$end + 1}]
    }
    return $size
}

# ::sorma::scpiLink::message ID BYTES DONE -- execute lines, and call DONE with the answer: a line for each that asks. The
# last one needs no end. The message before must have ended, or be cancelled.
proc ::sorma::scpiLink::message {id bytes done} {
    variable Links
    variable Works
    if {[dict get $Links $id work] eq {}} {
        # A new one for each message would cost more than most messages.
        dict set Links $id work ::sorma::scpiLink::work[incr Works]
        coroutine ::sorma::scpiLink::work$Works ::sorma::scpiLink::Work $id
    }
    [dict get $Links $id work] [list $bytes $done]
}

proc ::sorma::scpiLink::Work id {
    while 1 {
        lassign [yield] bytes done
        set answer [Answer $id $bytes]
        if {![Mine $id]} return
        {*}$done $answer
        if {![Mine $id]} return
    }
}

proc ::sorma::scpiLink::Answer {id bytes} {
    variable Links
    variable MostAnswer
    set answer {}
    set at 0
    while {$at < [string length $bytes]} {
        lassign [Take $bytes $at] end line blocks
        if {$end < 0} {
            lassign [Take [append bytes \n] $at] end line blocks
        }
        if {$end < 0} {
            wrong $id -161
            break
        }
        set at [expr {$end + 1}]
        dict set Links $id blocks $blocks
        set answers [Message $id [string trim $line]]
        if {![Mine $id]} break
        if {$answers ne {}} {
            append answer [join $answers \;] \n
        }
        if {[string length $answer] > $MostAnswer} {
            wrong $id -430
            return
        }
    }
    return $answer
}

# Has the message of this coroutine not been cancelled?
proc ::sorma::scpiLink::Mine id {
    variable Links
    return [expr {[dict exists $Links $id] && [dict get $Links $id work] eq [info coroutine]}]
}

# The line that begins at an index: where it ends (-1: it is not whole), the line, and the blocks of bytes (#15hello) in it. In the line each is #B:N.
proc ::sorma::scpiLink::Take {input at} {
    set line {}
    set blocks {}
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

# The answers to all parts of a line.
proc ::sorma::scpiLink::Message {id text} {
    variable Links
    dict set Links $id path [dict get $Links $id home]
    set answers {}
    foreach part [Cut $text \;] {
        if {[set part [string trim $part]] eq {}} continue
        try {
            # Subexpressions for all of it would take a hundred times as long.
            if {![regexp -indices {^[*:]?[A-Za-z][A-Za-z0-9_:.-]*\??(?=\s|$)} $part hit]} {
                Fail -102 $part
            }
            set head [string range $part 0 [lindex $hit 1]]
            set asks [string match *\\? $head]
            set words [lmap word [Cut [string range $part [lindex $hit 1]+1 end] ,] {string trim $word}]
            set answer [Part $id [string trimright $head ?] $asks $words]
            if {$asks} {
                lappend answers $answer
            }
        } trap SCPI why {
            set error $why
        } on error {why how} {
            set error [list [NumberOf [dict get $how -errorcode]] $why]
        }
        if {![Mine $id]} break
        if {[info exists error]} {
            wrong $id {*}$error
            unset error
        }
    }
    return $answers
}

# Split at a character that stands outside of quotes. Nothing makes no part.
proc ::sorma::scpiLink::Cut {text at} {
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

proc ::sorma::scpiLink::Fail {number {detail {}}} {
    throw SCPI [list $number $detail]
}

proc ::sorma::scpiLink::NumberOf code {
    variable Numbers
    dict for {pattern number} $Numbers {
        if {[string match $pattern "$code "]} {
            return $number
        }
    }
}

# ::sorma::scpiLink::wrong ID NUMBER ?DETAIL? -- put an error into its queue.
proc ::sorma::scpiLink::wrong {id number {detail {}}} {
    variable Links
    variable Words
    if {![dict exists $Links $id]} return
    set text [dict get $Words $number]
    if {$detail ne {}} {
        append text ";[regsub -all {[^ -~]+} $detail ?]"
    }
    set error "$number,[Quoted [string range $text 0 200]]"
    set bit [expr {$number > -200 ? 32 : $number > -300 ? 16 : $number > -400 ? 8 : 4}]
    set errors [dict get $Links $id errors]
    dict set Links $id errors [if {[llength $errors] < 20} {linsert $errors end $error} else {lreplace $errors end end {-350,"Queue overflow"}}]
    dict set Links $id esr [expr {[dict get $Links $id esr] | $bit}]
}

# ::sorma::scpiLink::status ID ?AVAILABLE? -- the status byte. AVAILABLE: an answer waits to be read.
proc ::sorma::scpiLink::status {id {available 0}} {
    variable Links
    set link [dict get $Links $id]
    set status [expr {([::sorma::scpiEvents::count $id] ? 2 : 0) | ([dict get $link errors] ne {} ? 4 : 0) | ($available ? 16 : 0) | (([dict get $link esr] & [dict get $link ese]) ? 32 : 0)}]
    return [expr {$status | (($status & [dict get $link sre] & ~64) ? 64 : 0)}]
}

proc ::sorma::scpiLink::Quoted text {
    return "\"[string map {\" \"\"} $text]\""
}

# ---- commands ----

proc ::sorma::scpiLink::Part {id head asks words} {
    variable Links
    variable Forms
    set head [string toupper $head]
    set what [expr {$asks ? "$head?" : $head}]
    if {[string match {*SYST*:*} $what]} {
        set what [string map $Forms $what]
    }
    switch -- $what {
        *IDN? { return "SORMA,[expr {[dict get $Links $id home] eq {} ? "sormad" : [dict get $Links $id device]}],[pid],[package present sorma]" }
        *TST? { return 0 }
        *OPC? { return 1 }
        *STB? { return [status $id] }
        *ESE? - *SRE? { return [dict get $Links $id [string tolower [string range $head 1 end]]] }
        *ESE - *SRE { return [dict set Links $id [string tolower [string range $head 1 end]] [Mask $words]] }
        *ESR? {
            set esr [dict get $Links $id esr]
            dict set Links $id esr 0
            return $esr
        }
        *CLS {
            dict set Links $id errors {}
            ::sorma::scpiEvents::clear $id
            return [dict set Links $id esr 0]
        }
        *OPC { return [dict set Links $id esr [expr {[dict get $Links $id esr] | 1}]] }
        *RST - *WAI { return }
        SYST:ERR? - SYST:ERR:NEXT? {
            dict set Links $id errors [lassign [dict get $Links $id errors] error]
            return [expr {$error eq {} ? "0,\"No error\"" : $error}]
        }
        SYST:ERR:COUN? { return [llength [dict get $Links $id errors]] }
        SYST:EVEN? - SYST:EVEN:NEXT? { return [Event $id] }
        SYST:EVEN:COUN? { return [::sorma::scpiEvents::count $id] }
        SYST:VERS? { return 1999.0 }
        SYST:HELP:HEAD? { return [Headers $id] }
    }
    if {[string match {[*]*} $head]} {
        Fail -113 $head
    }
    # After FOO:A:TEMP, a header without a colon begins with FOO:A, too.
    set nodes [split [string trimleft $head :] :]
    set path [dict get $Links $id path]
    if {![string match :* $head] && $path ne {}} {
        set nodes [concat $path $nodes]
    }
    dict set Links $id path [lrange $nodes 0 end-1]
    return [Object $id [join [lrange $nodes 0 end-1] .] [lindex $nodes end] $asks $words]
}

proc ::sorma::scpiLink::Mask words {
    if {[llength $words] != 1} {
        Fail [expr {[llength $words] ? -108 : -109}]
    }
    if {![regexp {^\d{1,3}$} $words] || [scan $words %d] > 255} {
        Fail -222 $words
    }
    return [scan $words %d]
}

# A request in the name of who asks. Only this coroutine waits.
proc ::sorma::scpiLink::Ask {id args} {
    variable Links
    if {![Mine $id]} {
        Fail -200
    }
    set future [::sorma::async -as [dict get $Links $id who] -command [info coroutine] {*}$args]
    dict set Links $id future $future
    yield
    if {[Mine $id]} {
        dict set Links $id future {}
    }
    return [$future take]
}

proc ::sorma::scpiLink::Short word {
    set word [string toupper $word]
    return [string range $word 0 [expr {[string length $word] > 4 && [string index $word 3] in {A E I O U} ? 2 : 3}]]
}

proc ::sorma::scpiLink::Object {id name node asks words} {
    set found [lsearch -exact -inline -nocase [::sorma::names] $name]
    if {$found eq {}} {
        Fail -113 $name:$node
    }
    if {$node eq "EXEC"} {
        return [Execute $id $found $asks $words]
    }
    set table [::sorma::so::$found configure]
    set fits [lsearch -all -inline -nocase -index 0 -exact $table -$node]
    if {$fits eq {}} {
        set fits [lmap row $table {if {[Short [string range [lindex $row 0] 1 end]] ne $node} continue; set row}]
    }
    if {$fits eq {} && $node in {SUBS SUBSCRIBE}} {
        return [Subscribe $id $found $asks $words]
    }
    if {[llength $fits] != 1} {
        Fail -113 $name:$node
    }
    lassign [lindex $fits 0] option type unit range default
    if {$asks} {
        # The right to inspect is asked for limits, too.
        set value [Ask $id $found cget $option]
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
    Ask $id $found CTRL $option [join [lmap word $words {Given $word $type $unit $range $default}]]
    return
}

proc ::sorma::scpiLink::Limit {word range default} {
    switch -nocase -- $word {
        MIN - MINIMUM { set limit [lindex $range 0] }
        MAX - MAXIMUM { set limit [lindex $range end] }
        DEF - DEFAULT { return $default }
        default { Fail -224 $word }
    }
    return [if {[string is double -strict $limit]} {set limit} else {Fail -224 $word}]
}

# A parameter as the option takes it.
proc ::sorma::scpiLink::Given {word type unit range default} {
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
    if {[regexp {^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?$} $word]} {
        return $word
    }
    if {![regexp {^([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)$} $word -> number suffix]} {
        Fail -104 $word
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

proc ::sorma::scpiLink::Shown {type value} {
    switch -- $type {
        int - double - flag { return $value }
        enum { return [string toupper $value] }
        vector { return [join $value ,] }
    }
    return [encoding convertto utf-8 [Quoted $value]]
}

proc ::sorma::scpiLink::Block bytes {
    return "#[string length [string length $bytes]][string length $bytes]$bytes"
}

# Numbers become floats, quoted parameters the text, blocks the bytes, others words.
proc ::sorma::scpiLink::Execute {id name asks words} {
    variable Links
    set floats [set rest [set text [set any {}]]]
    foreach word $words {
        if {[regexp {^#B:(\d+)$} $word -> n]} {
            append any [lindex [dict get $Links $id blocks] $n]
        } elseif {[string is double -strict $word]} {
            lappend floats $word
        } elseif {[regexp {^["']} $word]} {
            append text [Given $word string {} {} {}]
        } else {
            lappend rest $word
        }
    }
    set reply [Ask $id $name exec -text $text -floats $floats -any $any {*}$rest]
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

# FOO:A:SUBScribe 'PATTERN', and FOO:A:SUBScribe?
proc ::sorma::scpiLink::Subscribe {id name asks words} {
    variable Links
    if {[llength $words] > ($asks ? 0 : 1)} {
        Fail -108 $name:SUBScribe
    }
    if {![::sorma::scpiEvents::may [dict get $Links $id who] $name]} {
        Fail -203 "you may not inspect $name"
    }
    if {$asks} {
        return [Shown string [::sorma::scpiEvents::pattern $id $name]]
    }
    if {[string match *@* $name]} {
        Fail -221 "$name is elsewhere: subscribe at its own daemon"
    }
    if {$words ne {} && ![regexp {^["']} [lindex $words 0]]} {
        Fail -104 [lindex $words 0]
    }
    if {![::sorma::scpiEvents::subscribe $id [dict get $Links $id who] $name [expr {$words eq {} ? "*" : [Given [lindex $words 0] string {} {} {}]}]]} {
        Fail -221 "a link subscribes to [::sorma::scpiEvents::most] objects at most"
    }
    return
}

# The oldest event: object, name, how many were lost before it, text; then numbers, words, and bytes.
proc ::sorma::scpiLink::Event id {
    set event [::sorma::scpiEvents::take $id]
    if {$event eq {}} {
        return {"","",0,""}
    }
    set said [dict merge {text {} floats {} ints {} any {} words {}} $event]
    dict with said {
        set answer [list [Shown string $object] [Shown string $event] $lost [Shown string $text] {*}$floats {*}$ints {*}[lmap word $words {Shown string $word}]]
        if {$any ne {}} {
            lappend answer [Block $any]
        }
    }
    return [join $answer ,]
}

# All headers of objects that one may inspect.
proc ::sorma::scpiLink::Headers id {
    set all {*IDN? *RST *TST? *OPC *CLS *ESR? *ESE *STB? *SRE *WAI SYSTem:ERRor? SYSTem:ERRor:COUNt? SYSTem:EVENt? SYSTem:EVENt:COUNt? SYSTem:VERSion? SYSTem:HELP:HEADers?}
    foreach name [lsort [::sorma::names]] {
        if {[string match *@* $name] || [catch {Ask $id $name cget -nothing} why how] && [lrange [dict get $how -errorcode] 0 2] eq {SORMA COMM DENIED}} continue
        set path [string map {. :} [string toupper $name]]
        foreach row [::sorma::so::$name configure] {
            set word [string range [lindex $row 0] 1 end]
            set short [Short $word]
            lappend all $path:$short[string tolower [string range $word [string length $short] end]]
        }
        lappend all $path:EXEC $path:SUBScribe
    }
    return [Block [encoding convertto utf-8 [join $all \n]]]
}
