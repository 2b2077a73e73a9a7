# listing.tcl -- what inspectors have found, as text for people. It asks nobody: all that it shows comes as arguments.
#
# Items are dicts. where is what stands after @, empty for here; an item with error instead of a name is a place that gave no answer.

package require sorma::reply
package require sorma::text
package provide sorma::listing 1.0

namespace eval ::sorma::listing {
    namespace export objects tree daemons busiest found tested watched passing rates findings calls table sections microseconds digits
    namespace ensemble create
    variable MostRows 200       ;# of one table
}

# ---- objects and daemons ----

# ::sorma::listing::objects ITEMS -- of where name class calls.
proc ::sorma::listing::objects items {
    return [sections $items {object class calls} {2} {item {
        list [dict get $item name] [dict get $item class] [dict get $item calls]
    }}]
}

# ::sorma::listing::tree ITEMS PATTERN -- of where name class uses (dict: option -> name): objects that fit, with what they use.
proc ::sorma::listing::tree {items pattern} {
    variable MostRows
    set out {}
    foreach {where group} [ByPlace $items] {
        lappend out [Heading $where]
        set used {}
        set byName {}
        foreach item $group {
            if {[dict exists $item error]} {
                lappend out [Trouble [dict get $item error]]
                continue
            }
            dict set byName [dict get $item name] $item
            foreach name [dict values [dict get $item uses]] {
                dict set used $name 1
            }
        }
        set rows 0
        foreach name [dict keys $byName] {
            if {$pattern eq "*" ? ![dict exists $used $name] : [string match $pattern $name]} {
                if {[incr rows] > $MostRows} {
                    lappend out "  ... and more; give a pattern"
                    break
                }
                lappend out {*}[Branch $byName $name {} 1 {}]
            }
        }
    }
    return [join $out \n]
}

proc ::sorma::listing::Branch {byName name option depth above} {
    set label [if {$option ne {}} {string cat "[string range $option 1 end]: "}]
    set class [if {[dict exists $byName $name]} {dict get $byName $name class}]
    set line [string repeat "  " $depth]$label$name[if {$class ne {} && ![string match $class* $name]} {string cat "  ($class)"}]
    set out [list [::sorma::text::cut [::sorma::text::clean $line] [Width]]]
    if {$name in $above} {
        return [list "[lindex $out 0] ..."]
    }
    if {[dict exists $byName $name]} {
        dict for {option used} [dict get $byName $name uses] {
            lappend out {*}[Branch $byName $used $option [expr {$depth + 1}] [concat $above [list $name]]]
        }
    }
    return $out
}

# ::sorma::listing::daemons ITEMS -- of name state objects address error.
proc ::sorma::listing::daemons items {
    set rows [lmap item $items {
        list [Named [dict get $item name] $item] [dict get $item state] [dict get $item objects] [dict get $item address]
    }]
    set out [list [table {daemon state objects address} $rows {2}]]
    foreach item $items {
        if {[dict get $item error] ne {}} {
            lappend out [Trouble "[dict get $item name]: [dict get $item error]"]
        }
    }
    return [join $out \n]
}

# ::sorma::listing::busiest ITEMS -- of where name rate p50 p99 calls underway.
proc ::sorma::listing::busiest items {
    set rows {}
    set errors {}
    foreach item $items {
        set where [dict get $item where]
        if {[dict exists $item error]} {
            lappend errors [Trouble "$where: [dict get $item error]"]
            continue
        }
        set rate [dict get $item rate]
        lappend rows [list [dict get $item name][if {$where ne {}} {string cat @$where}] \
            [format [expr {$rate < 10 ? "%.1f" : "%.0f"}] $rate] [dict get $item p50] [dict get $item p99] \
            [dict get $item calls] [dict get $item underway]]
    }
    return [join [concat [list [table {object EXEC/s p50 p99 calls waiting} $rows {1 2 3 4 5}]] $errors] \n]
}

# ::sorma::listing::found ITEMS -- of where kind name item text.
proc ::sorma::listing::found items {
    return [sections $items {} {} {item {
        list [dict get $item kind] [string trim "[dict get $item name] [dict get $item item]"] [dict get $item text]
    }}]
}

# ::sorma::listing::findings ITEMS -- of the doctor: what state text mend.
proc ::sorma::listing::findings items {
    set out {}
    set wrong 0
    foreach finding $items {
        dict with finding {}
        set head [format "%-5s %-14s" $state $what]
        set colour [dict get {ok {} note dim wrong error} $state]
        incr wrong [expr {$state eq "wrong"}]
        lappend out [::sorma::text::hang [::sorma::text::paint $head $colour [Style]] 20 $text [Style]]
        if {$mend ne {}} {
            lappend out [::sorma::text::block [string repeat { } 21] "mend: $mend" {} [Style]]
        }
    }
    lappend out [expr {$wrong == 0 ? "nothing is wrong" : $wrong == 1 ? "1 thing is wrong" : "$wrong things are wrong"}]
    return [join $out \n]
}

# ::sorma::listing::tested ITEM -- of where name passed seconds text.
proc ::sorma::listing::tested item {
    set where [dict get $item where]
    if {[dict exists $item error]} {
        return [Trouble "$where: [dict get $item error]"]
    }
    set passed [dict get $item passed]
    set head [format "%-6s %8s  %-20s" [expr {$passed ? "passed" : "failed"}] [microseconds [expr {1e6 * [dict get $item seconds]}]] \
        [dict get $item name][if {$where ne {}} {string cat @$where}]]
    return [::sorma::text::hang [::sorma::text::paint $head [expr {$passed ? {} : "error"}] [Style]] 38 [::sorma::text::clean [dict get $item text]] [Style]]
}

# ---- what happens ----

# ::sorma::listing::watched NEWS -- what a watch tells: 10:31:02.123 foo.a  -tempo presto (was largo)
proc ::sorma::listing::watched news {
    set head "[::sorma::text::time [expr {1000 * [dict get $news time]}]] [dict get $news name]"
    if {[dict exists $news error]} {
        return [::sorma::text::paint "$head  [::sorma::text::clean [dict get $news error]]" error [Style]]
    }
    if {[dict exists $news event]} {
        set event [dict get $news event]
        set text "[dict get $event event] "
        foreach key {text words floats ints} {
            if {[dict exists $event $key] && [dict get $event $key] ne {}} {
                append text " " [if {$key in {floats ints}} {::sorma::reply::numbers [dict get $event $key] [Style]} else {dict get $event $key}]
            }
        }
        if {[dict exists $event lost] && [dict get $event lost] != 0} {
            append text "  (some were lost before)"
        }
        return [::sorma::text::cut [::sorma::text::clean "$head  [string map {\n { }} $text]"] [Width]]
    }
    set lines {}
    foreach change [dict get $news changes] {
        lassign $change key old new
        set was [if {$old ne {}} {string cat "  (was $old)"}]
        lappend lines [::sorma::text::cut [::sorma::text::clean [string map {\n { }} "$head  $key $new$was"]] [Width]]
    }
    return [join $lines \n]
}

# ::sorma::listing::passing NEWS -- what a monitor tells: 10:31:02.123 robot > foo.a CTRL -tempo presto  (anna@lab tclsh[4711], 12)
proc ::sorma::listing::passing news {
    dict with news {}
    set head "[::sorma::text::time $time] $where"
    set text [::sorma::text::clean [string map {\n { }} $text]]
    set colour {}
    switch -- $kind {
        request { set line "> [string trimright "$object $method $text"]  ($caller, $number)" }
        reply {
            set line "< [string trimright "$object RET $code $text"]  ($number, [microseconds $ran])"
            set colour [expr {$code < 0 ? "error" : $code > 0 ? "warning" : {}}]
        }
        event { set line "* $object $method $text" }
        default { set line "- $method $text" }
    }
    if {$lost != 0} {
        append line "  ([if {$lost > 0} {set lost} else {string cat some}] lost before)"
    }
    return [::sorma::text::paint [::sorma::text::cut "$head $line" [Width]] $colour [Style]]
}

# ::sorma::listing::rates ITEMS -- of event count rate mean min max jitter lost.
proc ::sorma::listing::rates items {
    set rows [lmap item $items {
        dict with item {}
        list $event $count [if {$rate ne {}} {string cat [digits $rate] /s}] {*}[lmap value [list $mean $min $max $jitter] {
            if {$value ne {}} {microseconds [expr {1e6 * $value}]}
        }] [if {$lost != 0} {set lost}]
    }]
    return [table {event count rate mean min max jitter lost} $rows {1 2 3 4 5 6 7}]
}

# ---- what these have in common ----

# ::sorma::listing::calls TREE -- the tree of sorma::trace: a line for each call, those that it makes below it, and its times.
proc ::sorma::listing::calls tree {
    set rows {}
    CallRows $tree 0 rows
    return [table {call state whole waiting running wire} $rows {2 3 4 5}]
}

proc ::sorma::listing::CallRows {span depth rowsVar} {
    upvar 1 $rowsVar rows
    set name [dict get $span name]
    set kind [dict get $span kind]
    set what [switch $kind {
        event - listener { string cat $kind { } [expr {[dict exists $span event] ? [dict get $span event] : {}}] }
        oneway { string cat [dict get $span method] { one-way} }
        default { dict get $span method }
    }]
    set row [list "[string repeat {  } $depth][if {$name eq {}} {string cat (hidden)} else {string cat $name { } $what}]" [dict get $span state]]
    foreach time {whole waiting running wire} {
        lappend row [microseconds [dict get $span $time]]
    }
    lappend rows $row
    foreach call [dict get $span calls] {
        CallRows $call [expr {$depth + 1}] rows
    }
    if {[dict exists $span more]} {
        lappend rows [list "[string repeat {  } [expr {$depth + 1}]]([dict get $span more] more)" {} {} {} {} {}]
    }
}

# ::sorma::listing::microseconds N -- a time in the unit that fits.
proc ::sorma::listing::microseconds us {
    if {![string is double -strict $us]} {
        return ?
    }
    return [if {$us < 1000} {string cat [digits $us] " us"} elseif {$us < 1000000} {
        string cat [digits [expr {$us / 1e3}]] " ms"
    } else {
        string cat [digits [expr {$us / 1e6}]] " s"
    }]
}

# ::sorma::listing::digits X -- three digits, without an exponent.
proc ::sorma::listing::digits x {
    set places [expr {abs($x) >= 100 || $x == int($x) ? 0 : abs($x) >= 10 ? 1 : 2}]
    return [format %.${places}f $x]
}

# ::sorma::listing::table HEADS ROWS RIGHT ?wrap? -- right: numbers of columns that end at the right.
proc ::sorma::listing::table {heads rows right {wrap 0}} {
    set style [dict filter [Style] key -colour -width]
    return [::sorma::text::table $heads $rows {*}$style -right $right -wrap $wrap]
}

# ::sorma::listing::sections ITEMS HEADS RIGHT ROW -- for each place a table whose rows a lambda makes of its items, and its errors.
proc ::sorma::listing::sections {items heads right row} {
    set out {}
    foreach {where group} [ByPlace $items] {
        set rows {}
        set errors {}
        foreach item $group {
            if {[dict exists $item error]} {
                lappend errors [dict get $item error]
            } else {
                lappend rows [apply $row $item]
            }
        }
        lappend out {*}[Section [Named $where [lindex $group 0]] $heads $rows $right $errors]
    }
    return [join $out \n]
}

# A place with its table, and what is wrong there.
proc ::sorma::listing::Section {where heads rows right errors} {
    variable MostRows
    set out [list [Heading $where]]
    set more [expr {[llength $rows] - $MostRows}]
    if {[llength $rows] > 0} {
        set style [Style]
        set width [dict get $style -width]
        set text [::sorma::text::table $heads [lrange $rows 0 $MostRows-1] -colour [dict get $style -colour] \
            -width [expr {$width > 0 ? max(10, $width - 2) : 0}] -right $right -wrap [expr {$heads eq {}}]]
        lappend out {*}[lmap line [split $text \n] {string cat "  " $line}]
    }
    if {$more > 0} {
        lappend out "  ... and $more more; give a pattern"
    }
    foreach error $errors {
        lappend out [Trouble $error]
    }
    return $out
}

# where {items} ...
proc ::sorma::listing::ByPlace items {
    set groups {}
    foreach item $items {
        dict lappend groups [dict get $item where] $item
    }
    return $groups
}

# A place, and in parentheses what an item says that it is called on its host.
proc ::sorma::listing::Named {where item} {
    return [if {[dict exists $item called] && [dict get $item called] ne {}} {string cat "$where ([dict get $item called])"} else {set where}]
}

proc ::sorma::listing::Heading where {
    return [::sorma::text::paint [if {$where eq {}} {string cat here} else {string cat @$where}] strong [Style]]
}

proc ::sorma::listing::Trouble text {
    return [::sorma::text::block "  " $text warning [Style]]
}

proc ::sorma::listing::Style {} {
    return [::sorma::showDefaults]
}

proc ::sorma::listing::Width {} {
    return [dict get [::sorma::showDefaults] -width]
}
