# modbus -- speaks to a device by Modbus.
#
#     modbus.plc CTRL -to tcp:192.168.0.9:502 -unit 1
#     modbus.plc EXEC get 40101 2
#
# A driver derives from it and declares the registers of its device as options. Objects with the same -to share a line (class modbusline),
# which has one request at a time.

package require sorma
package require sorma::driver
package require sorma::service::modbusline

namespace eval ::sorma::modbus {
    variable Lines {}           ;# dict: -to -> {command, number of objects that use it}
    variable Made 0             ;# lines so far
    # -as -> registers of a value, and its format as `binary` has it
    variable Types {int16 {1 S} uint16 {1 Su} int32 {2 I} uint32 {2 Iu} int64 {4 W} uint64 {4 Wu} float32 {2 R} float64 {4 Q} text {1 a}}
    variable Row {type {} unit {} register {} as uint16 scale 1 offset 0 words big bytes big choices {} codes {} length 1 bit {} reading {} every 1}
}

# ::sorma::modbus::option --
#       In a class derived from modbus: declare what is in registers of the device.
# Arguments:
#       name type args  as of sorma::option, and the words of Row; -register is needed. The page modbus of the manual tells of each.
proc ::sorma::modbus::option {name type args} {
    variable Row
    set row [dict replace $Row type $type]
    set words {}
    foreach {word value} $args {
        set key [string range $word 1 end]
        if {$key ne "type" && [dict exists $Row $key]} {
            dict set row $key $value
        }
        if {$key ni {register as scale offset words bytes codes bit reading every} && !($key eq "length" && $type eq "string")} {
            lappend words $word $value
        }
    }
    set row [Complete $name $row]
    if {[dict get $row reading]} {
        set words [linsert $words 0 -measured 1 -group Readings]
    }
    uplevel 1 [list ::sorma::option $name $type {*}$words]
    uplevel 1 [list ::oo::define::method Row$name {} [list return $row]]
}

# The row, checked, with the table and the address of its first register, and how many registers it has.
proc ::sorma::modbus::Complete {name row} {
    variable Types
    dict with row {
        lassign [Register $register] table address
        if {$table eq {}} {
            Refuse $name "-register expects [RegisterSyntax], got \"$register\""
        }
        set bits [expr {$table in {coil discrete}}]
        if {$type ni [expr {$bits ? {flag vector} : {flag int double string enum vector}}]} {
            Refuse $name "a [expr {$bits ? "coil is a flag, or a vector of them" : "register is a flag, int, double, string, enum or vector"}], no $type"
        }
        if {$type eq "string"} {
            set as text
        }
        if {![dict exists $Types $as] || ($as eq "text") != ($type eq "string")} {
            Refuse $name "-as expects [join [lrange [dict keys $Types] 0 end-1] {, }] for a number, got \"$as\""
        }
        if {$words ni {big little}} {
            Refuse $name "-words expects big or little, got \"$words\""
        }
        if {$bytes ni {big little}} {
            Refuse $name "-bytes expects big or little, got \"$bytes\""
        }
        foreach number {scale offset} {
            if {![string is double -strict [set $number]] || $number eq "scale" && $scale == 0} {
                Refuse $name "-$number expects a number[expr {$number eq "scale" ? ", not 0" : ""}], got \"[set $number]\""
            }
        }
        foreach {number low high} {length 1 125 every 1 1000000} {
            if {![string is integer -strict [set $number]] || [set $number] < $low || [set $number] > $high} {
                Refuse $name "-$number expects a number from $low to $high, got \"[set $number]\""
            }
        }
        if {$type eq "enum"} {
            if {$codes eq {}} {
                set codes [lmap choice $choices {llength [lappend codes {}]}]
                set codes [lmap code $codes {expr {$code - 1}}]
            }
            if {[llength $codes] != [llength $choices] || [lsearch -regexp -not $codes {^-?\d+$}] >= 0} {
                Refuse $name "-codes expects [llength $choices] whole numbers, one for each of -choices, got \"$codes\""
            }
        }
        if {$bit ne {}} {
            if {$type ne "flag" || $bits || ![string is integer -strict $bit] || $bit < 0 || $bit > 15} {
                Refuse $name "-bit expects a number from 0 to 15, for a flag in a register, got \"$bit\""
            }
        }
        # A bit is written only when the driver says so: the others of its register may be anything.
        if {$reading eq {}} {
            set reading [expr {$bit ne {}}]
        }
        if {![string is boolean -strict $reading]} {
            Refuse $name "-reading expects 0 or 1, got \"$reading\""
        }
        if {$table in {discrete input}} {
            set reading 1
        }
        set count [expr {$bits ? $length : $length * [lindex [dict get $Types $as] 0]}]
        if {$count > ($reading ? 125 : 123) || $address + $count > 65536} {
            Refuse $name "it has $count registers from $register, and one request takes [expr {$reading ? 125 : 123}], up to the last register"
        }
    }
    return [dict merge $row [dict create table $table address $address count $count bits $bits]]
}
proc ::sorma::modbus::Refuse {name text} {
    return -level 3 -code error -errorcode [list SORMA MODBUS TABLE $name] "$name: $text"
}

# ::sorma::modbus::Register --
#       A register as manuals have it (40101), or as messages have it (holding:100): table, and address from 0. Empty: it is none.
proc ::sorma::modbus::Register text {
    if {[regexp {^([0134])(\d{4,5})$} $text -> digit number]} {
        scan $number %d number
        if {$number >= 1 && $number <= 65536} {
            return [list [dict get {0 coil 1 discrete 3 input 4 holding} $digit] [expr {$number - 1}]]
        }
    }
    if {[regexp {^(coil|discrete|input|holding):(\d{1,5})$} $text -> table number] && [scan $number %d] <= 65535} {
        return [list $table [scan $number %d]]
    }
}
proc ::sorma::modbus::RegisterSyntax {} {
    return "a number as in 40101 (0 coil, 1 discrete input, 3 input register, 4 holding register, and its number from 1), or holding:100 (counted from 0)"
}

# The line to a place: a command, which `release` gives back.
proc ::sorma::modbus::take to {
    variable Lines
    variable Made
    if {![dict exists $Lines $to]} {
        dict set Lines $to [list [::modbusline create [namespace current]::line[incr Made] -to $to] 0]
    }
    lassign [dict get $Lines $to] line users
    dict set Lines $to [list $line [incr users]]
    return $line
}
proc ::sorma::modbus::release to {
    variable Lines
    lassign [dict get $Lines $to] line users
    dict set Lines $to [list $line [incr users -1]]
    if {$users == 0} {
        dict unset Lines $to
        $line destroy
    }
}

oo::class create ::sorma::service::modbus {
    superclass sorma::driver::Device sorma::Service

    sorma::purpose "speaks to a device by Modbus"
    sorma::option -to string -kind address -help "where it is: tcp:HOST:PORT, or rtu:PATH,BAUD,8n1 for a serial line"
    sorma::option -unit int -range {0 255} -default 1 -help "number of the device on its line, or behind its gateway"
    sorma::option -patience double -unit s -range {0.001 60} -default 1 -help "how long the line may need to open, and each answer to come"
    sorma::option -poll double -unit s -range {0 86400} -default 0 -help "a driver asks for its readings each so many seconds; 0: only when somebody says read"
    sorma::action -fetch {} "ask the device for all settings and readings of its driver" {my fetch [dict keys [my table]]} -right call
    sorma::action -send {} "send all settings of its driver to the device" {my give [dict keys [my table]]} -danger power
    sorma::action -close {} "close the line when it is free; the next request opens it again" {my Close}
    sorma::inspection -line {} "is the line open, and to what" {my State}
    sorma::reads ints 0.. "" "write: what goes into the registers or coils"
    sorma::words "get REGISTER ?COUNT? | write REGISTER | read ?-OPTION ...?"
    sorma::writes ints 0.. "" "get: what the registers or coils have"
    sorma::writes floats 0.. "" "read: numbers"
    sorma::writes text 0.. "" "read: texts, a line for each"
    sorma::danger power write
    sorma::example "modbus.plc EXEC get 40101 2"

    variable Line Taken         ;# the line and the -to that it was taken for; empty: none
    variable Polls              ;# how many there were

    method born {} {
        set Line [set Taken {}]
        set Polls 0
        my Take
        my begin
    }
    destructor {
        my end
        if {[info exists Line] && $Line ne {}} {        ;# else its recipe was refused: it was not born
            ::sorma::modbus::release $Taken
        }
    }
    method changed options {
        foreach option [my settings $options] {
            my Encode $option [my cget $option]
        }
        if {"-to" in $options} {
            my Take
        }
        if {"-poll" in $options} {
            my poll
        }
    }
    method settle options {
        my give $options
    }
    method selftest {} {
        set options [dict keys [my table]]
        if {$options eq {}} {
            return "no driver: there is nothing to ask for"
        }
        my fetch $options
        return "the device has answered for [llength $options] options"
    }

    method exec message {
        lassign [dict get $message words] verb register count
        switch -- $verb {
            get { return [dict create ints [my Ask [list "read [my cget -unit] [my Place $register] [expr {$count eq {} ? 1 : $count}]"]]] }
            write {
                if {[dict get $message ints] eq {}} {
                    my Fault VALUE "write expects values, as in \"[my name] EXEC write 40101 IMSG 1 215\"" $register
                }
                my Ask [list "write [my cget -unit] [my Place $register] [dict get $message ints]"]
                return
            }
            read { return [my read [lrange [dict get $message words] 1 end]] }
        }
        my Fault VERB "expected get, write or read, got \"$verb\"" $verb
    }

    # ---- a driver: options of the device, each with its registers ----

    method language {} { return MODBUS }
    method askable {} { return "options of the device" }
    method asked options {
        return [lmap option $options {if {![dict exists [my table] $option]} continue; set option}]
    }
    method settings options {
        return [lmap option $options {
            if {![dict exists [my table] $option] || [dict get [my table] $option reading]} continue
            set option
        }]
    }
    method put values {
        set operations {}
        set taken {}
        dict for {option value} $values {
            set registers [my Encode $option $value]
            lappend taken $option [my Decode $option $registers]
            set row [dict get [my table] $option]
            lappend operations [if {[dict get $row bit] ne {}} {
                string cat "mask [my cget -unit] holding [dict get $row address] [expr {1 << [dict get $row bit]}] $registers"
            } else {
                string cat "write [my cget -unit] [dict get $row table] [dict get $row address] $registers"
            }]
        }
        my Ask $operations
        return $taken
    }
    # Registers that follow one another are one request.
    method fetch options {
        if {$options eq {}} return
        set blocks {}           ;# {table address count}
        set last {}             ;# dict: table -> index of its last block
        set places {}           ;# option, index of its block, and its place there
        foreach item [lsort -integer -index 2 [lmap option $options {
            list $option {*}[lmap key {table address count} {dict get [my table] $option $key}]
        }]] {
            lassign $item option table address count
            set at [expr {[dict exists $last $table] ? [dict get $last $table] : -1}]
            lassign [lindex $blocks $at] - first have
            if {$at < 0 || $address > $first + $have || $address + $count - $first > 125} {
                set at [llength $blocks]
                dict set last $table $at
                lappend blocks [list $table [set first $address] [set have 0]]
            }
            lset blocks $at 2 [expr {max($have, $address + $count - $first)}]
            lappend places $option $at [expr {$address - $first}]
        }
        set read [my Ask [lmap block $blocks {string cat "read [my cget -unit] " $block}]]
        set starts {}
        set sum 0
        foreach block $blocks {
            lappend starts $sum
            incr sum [lindex $block 2]
        }
        set values {}
        foreach {option block place} $places {
            set start [expr {[lindex $starts $block] + $place}]
            lappend values $option [my Decode $option [lrange $read $start [expr {$start + [dict get [my table] $option count] - 1}]]]
        }
        my learn $values
    }
    method pollNow {} {
        set due [lmap option [my readings] {if {$Polls % [dict get [my table] $option every] != 0} continue; set option}]
        incr Polls
        if {$due eq {}} {
            return [my poll]
        }
        sorma::async -command [list ::sorma::driver::polled [namespace code {my poll}]] [my name] EXEC read {*}$due
    }

    # ---- values and registers ----

    # The registers for a value.
    method Encode {option value} {
        set row [dict get [my table] $option]
        dict with row {
            if {$as eq "text"} {
                if {[string length $value] > 2 * $count || [regexp {[^\x01-\xff]} $value]} {
                    my Fault VALUE "$option has [expr {2 * $count}] bytes in the device: \"[string range $value 0 100]\" does not fit" $option
                }
                binary scan [binary format a[expr {2 * $count}] [encoding convertto iso8859-1 $value]] [dict get {big Su* little su*} $bytes] registers
                return $registers
            }
            if {$bit ne {}} {
                return [expr {($value != 0) << $bit}]
            }
            lassign [dict get $::sorma::modbus::Types $as] size format
            return [concat {*}[lmap element [expr {$type eq "vector" ? $value : [list $value]}] {
                if {$bits} {
                    if {$element ni {0 1 0.0 1.0}} {
                        my Fault VALUE "$option goes into coils: expected 0 or 1, got $element" $option
                    }
                    expr {int($element)}
                } else {
                    if {$type eq "enum"} {
                        set element [lindex $codes [lsearch -exact $choices $element]]
                    }
                    binary scan [binary format $format [my Raw $option $element $row]] Su* registers
                    my Ordered $registers $row
                }
            }]]
        }
    }
    # The registers of a number in the order of the device, and back.
    method Ordered {registers row} {
        if {[dict get $row words] eq "little"} {
            set registers [lreverse $registers]
        }
        return [if {[dict get $row bytes] eq "big"} {set registers} else {lmap register $registers {expr {($register & 255) << 8 | $register >> 8}}}]
    }
    # The number that stands for an element in its registers.
    method Raw {option element row} {
        dict with row {
            set raw [expr {$scale == 1 && $offset == 0 ? $element : ($element - double($offset)) / $scale}]
            if {[string match float* $as]} {
                return $raw
            }
            set wide [expr {1 << [regexp -inline {\d+} $as]}]
            set low [expr {[string match u* $as] ? 0 : -($wide / 2)}]
            if {$raw < $low - 0.5 || $raw >= $low + $wide - 0.5} {
                my Fault VALUE "$option $element is $raw in the device, and does not fit $as: expected $low to [expr {$low + $wide - 1}]" $option
            }
            return [expr {round($raw)}]
        }
    }
    # The value that registers have.
    method Decode {option registers} {
        set row [dict get [my table] $option]
        dict with row {
            if {$bits} {
                return $registers
            }
            if {$bit ne {}} {
                return [expr {$registers >> $bit & 1}]
            }
            if {$as eq "text"} {
                return [encoding convertfrom iso8859-1 [string trimright [lindex [split [binary format [dict get {big S* little s*} $bytes] $registers] \0] 0]]]
            }
            lassign [dict get $::sorma::modbus::Types $as] size format
            set elements {}
            for {set at 0} {$at < $count} {incr at $size} {
                set part [lrange $registers $at [expr {$at + $size - 1}]]
                binary scan [binary format S* [my Ordered $part $row]] $format raw
                lappend elements [my Element $option $raw $row]
            }
            return [expr {$type eq "vector" ? $elements : [lindex $elements 0]}]
        }
    }
    # A scaled number is rounded to the digits that count: 215 * 0.1 is 21.5.
    method Element {option raw row} {
        dict with row {
            if {$type eq "enum"} {
                set at [lsearch -exact -integer $codes $raw]
                if {$at < 0} {
                    my Fault ANSWER "the register of $option has $raw, expected one of [join $codes {, }]" $option
                }
                return [lindex $choices $at]
            }
            if {![string is double -strict $raw] || [regexp -nocase {nan|inf} $raw]} {
                return $raw
            }
            set value [expr {$scale == 1 && $offset == 0 ? $raw : $scale * double($raw) + $offset}]
            switch -- $type {
                flag { return [expr {$value != 0}] }
                int { return [expr {round($value)}] }
            }
            return [expr {double([format [expr {$as eq "float32" ? "%.7g" : $as eq "float64" ? "%.17g" : "%.12g"}] $value])}]
        }
    }

    # ---- the line ----

    method Take {} {
        set to [my cget -to]
        if {$to eq $Taken} return
        set fresh [if {$to ne {}} {my Try {::sorma::modbus::take $to}}]
        if {$Taken ne {}} {
            ::sorma::modbus::release $Taken
        }
        set Line $fresh
        set Taken $to
    }
    # The result of requests on the line: what was read.
    method Ask operations {
        my Take
        if {$Line eq {}} {
            my Fault ADDRESS "no device: say \"[my name] CTRL -to tcp:HOST:PORT\""
        }
        set request [sorma::async -timeout 0 $Line exec -floats [my cget -patience] {*}$operations]
        sorma::atCancel [list catch [list $request cancel]]
        try {
            set answer [my Try {$request wait}]
        } finally {
            sorma::atCancel {}
            $request destroy
        }
        return [expr {[dict exists $answer ints] ? [dict get $answer ints] : {}}]
    }
    # The line's errors are ours.
    method Try script {
        try {
            return [uplevel 1 $script]
        } trap {SORMA MODBUS} {why how} {
            regsub {^::sorma::modbus::line\S+: } $why {} why
            lassign [dict get $how -errorcode] - - symbol - number
            my Fault $symbol $why {*}$number
        }
    }
    method Close {} {
        if {$Line ne {}} {
            $Line CTRL -close
        }
        return
    }
    method State {} {
        return [if {$Line eq {}} {string cat closed} else {lindex [$Line DBX -line] 3}]
    }
    # The table and the address of a register.
    method Place register {
        set place [::sorma::modbus::Register $register]
        if {$place eq {}} {
            my Fault REGISTER "expected [::sorma::modbus::RegisterSyntax], got \"$register\"" $register
        }
        return $place
    }
    method Fault {symbol text args} {
        sorma::fail [list MODBUS $symbol [my name] {*}$args] "[my name]: $text"
    }
}

package provide sorma::service::modbus 1.0
