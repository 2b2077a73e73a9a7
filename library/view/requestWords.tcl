# requestWords.tcl -- words that can follow NAME METHOD in a request, a hint for the next one, and slips of the pen in them.
#
# Options, actions and the signature of EXEC come from the class's table (table.tcl): nothing is made, nobody is waited for.

package require sorma::candidates
package require sorma::line
package require sorma::table
package require sorma::text
package provide sorma::requestWords 1.0
namespace eval ::sorma::requestWords {
    variable Infos {actions class dump example help inspections location methods name options purpose signature trail version}
}

# {candidates hint ?skip?} for the next word of NAME METHOD WORD...
proc ::sorma::requestWords::next {words partial} {
    variable Infos
    set rest [lassign $words name method]
    set table [::sorma::table guess $name]
    if {$table eq {}} {
        return [list {} {}]
    }
    switch -- $method {
        CTRL { return [Words $name $table 1 $rest $partial] }
        DBX { return [Words $name $table 0 $rest $partial] }
        EXEC { return [Exec $table $rest $partial] }
        exec {
            set waits [expr {[lindex $rest end] in {-text -floats -ints -any}}]
            return [list [if {!($waits)} {string cat {-any -floats -ints -text}}] [Signature $table]]
        }
        configure {
            if {[llength $rest] % 2 == 1} {
                return [Value $table [lindex $rest end] $partial]
            }
            return [list [::sorma::candidates::without [OptionNames $table] $rest] [NameHint $table $partial 1]]
        }
        cget {
            return [list [if {[llength $rest] == 0} {OptionNames $table}] [NameHint $table $partial 1]]
        }
        info {
            if {[llength $rest] == 0} {
                return [list $Infos "$name info what"]
            }
            return [list [if {$rest eq "options"} {OptionNames $table}] [NameHint $table $partial 1]]
        }
    }
    return [list {} {}]
}

proc ::sorma::requestWords::OptionNames table {
    return [lmap option [dict get $table options] {lindex $option 0}]
}

# CTRL and DBX: names of the table, or what follows the last of them.
proc ::sorma::requestWords::Words {name table ctrl words partial} {
    lassign [State $table $ctrl $words] what item index open
    set names [::sorma::candidates::without [KnownNames $table $ctrl] $words]
    if {$what eq "value"} {
        lassign [Value $table [lindex $item 0] $partial] candidates hint skip
        return [list [if {$open} {concat $candidates $names} else {set candidates}] $hint $skip]
    }
    if {$what eq "argument"} {
        lassign [Argument $name $table $item [lrange $words end-[expr {$index - 1}] end] $partial] candidates hint skip
        return [list [if {$open} {concat $candidates $names} else {set candidates}] $hint $skip]
    }
    return [list $names [NameHint $table $partial $ctrl]]
}

# dict of all words that CTRL or DBX of a class knows -> {option ITEM} or {action ITEM}.
proc ::sorma::requestWords::KnownItems {table ctrl} {
    set known {}
    if {$ctrl} {
        foreach item [dict get $table options] {
            dict set known [lindex $item 0] [list option $item]
        }
    }
    set own [dict get $table [expr {$ctrl ? "actions" : "inspections"}]]
    foreach item [concat [lindex [::sorma::table common] [expr {!$ctrl}]] $own] {
        dict set known [lindex $item 0] [list action $item]
    }
    return $known
}

proc ::sorma::requestWords::KnownNames {table ctrl} {
    return [dict keys [KnownItems $table $ctrl]]
}

# Where words lead: {name}; {value OPTION 0 OPEN}; {argument ACTION INDEX OPEN}. OPEN: another name may come instead.
proc ::sorma::requestWords::State {table ctrl words} {
    set known [KnownItems $table $ctrl]
    set n [llength $words]
    for {set i 0} {$i < $n} {} {
        set word [lindex $words $i]
        incr i
        if {![dict exists $known $word]} {
            continue
        }
        lassign [dict get $known $word] kind item
        if {$kind eq "option"} {
            set flag [expr {[lindex $item 1] eq "flag"}]
            if {$i == $n} {
                return [list value $item 0 $flag]
            }
            if {!$flag || ![string match -* [lindex $words $i]]} {
                incr i
            }
            continue
        }
        lassign $item - usage - least most
        set count 0
        while {$i < $n && ($count < $least || $most == -1 || ($count < $most && ![dict exists $known [lindex $words $i]]))} {
            incr i
            incr count
        }
        if {$i == $n && ($most == -1 || $count < $most)} {
            return [list argument $item $count [expr {$count >= $least && $most != -1}]]
        }
    }
    return {name}
}

# {candidates hint} for the value of an option.
proc ::sorma::requestWords::Value {table name partial} {
    set option [lsearch -inline -index 0 -exact [dict get $table options] $name]
    if {$option eq {}} {
        return [list {} {}]
    }
    lassign $option name type unit range default value help
    switch -- $type {
        enum { set candidates $range }
        flag { set candidates {0 1} }
        service { set candidates [::sorma::candidates::names $partial] }
        default {
            set candidates {}
            foreach known [list $value $default] {
                if {$known ne {}} {
                    lappend candidates $known
                }
            }
            if {$type eq "string" && [regexp -nocase {file|folder|path|socket|script} "$name $help"]} {
                set candidates [concat $candidates [::sorma::candidates::files $partial]]
            }
        }
    }
    return [list $candidates [optionHint $table $option]]
}

# An option in one line: -transferSpeed double [m/s] 0.01 .. 1.5, default 0.5, now 0.2: speed while loaded
proc ::sorma::requestWords::optionHint {table option} {
    lassign $option name type unit range default value help
    set text "$name $type"
    if {$unit ne {}} {
        append text " \[$unit\]"
    }
    if {$range ne {}} {
        append text " " [if {$type eq "enum"} {join $range |} else {set range}]
    }
    if {$default ne {}} {
        append text ", default [OneLine $default]"
    }
    if {[dict get $table exists]} {
        append text ", now [if {$value eq {}} {string cat empty} else {OneLine $value}]"
        if {[dict exists $table age] && [dict get $table age] ne {}} {
            append text " ([dict get $table age])"
        }
    }
    if {[dict exists $table hints $name measured]} {
        append text ", measured"
    } elseif {$name in [dict get $table fixed]} {
        append text ", recipe only"
    }
    if {$help ne {}} {
        append text ": $help"
    }
    return $text
}

# A value of any kind in one line, harmless to a terminal.
proc ::sorma::requestWords::OneLine value {
    return [string map {\n \\n} [::sorma::text::clean $value]]
}

proc ::sorma::requestWords::ActionHint item {
    lassign $item name usage help
    return [string trimright "[string trimright "$name $usage"]: $help" ": "]
}

# About the name that is being typed, when it can only be one.
proc ::sorma::requestWords::NameHint {table partial ctrl} {
    set known [KnownItems $table $ctrl]
    if {[dict exists $known $partial]} {
        set found [list $partial]
    } else {
        set found [dict keys $known [::sorma::text::escape $partial]*]
    }
    if {$partial eq {} || [llength $found] != 1} {
        return {}
    }
    lassign [dict get $known [lindex $found 0]] kind item
    return [if {$kind eq "option"} {optionHint $table $item} else {ActionHint $item}]
}

# {candidates hint ?skip?} for an argument of an action; before: its arguments so far. Its name in the usage tells its meaning.
proc ::sorma::requestWords::Argument {name table item before partial} {
    set index [llength $before]
    lassign $item action usage
    set hint [ActionHint $item]
    set placeholders [lmap word $usage {
        set word [string trim $word ?]
        if {$word eq "..."} continue
        set word
    }]
    set what [lindex $placeholders [expr {min($index, [llength $placeholders] - 1)}]]
    lassign [::sorma::table locate $name] service where
    set class [dict get $table class]
    if {$class eq "dict" && $action eq "-add" && $index > 0 || $class eq "sorm" && $action eq "-create" && $index > 0} {
        set skip [expr {[string last { } $partial] + 1}]
        set typed [concat [lrange $before 1 end] [::sorma::line::words [string range $partial 0 $skip-1]]]
        # An entry at a daemon is for its objects, of classes that perhaps it alone knows.
        set entry [lindex $before 0]
        set object [expr {$where ne {} && $class eq "dict" && [string first @ $entry] < 0 ? "$entry@$where" : $entry}]
        lassign [recipe $object $typed [string range $partial $skip end] [expr {$class eq "dict" ? $where : {}}]] candidates more
        return [list $candidates [if {$more eq {}} {set hint} else {set more}] $skip]
    }
    switch -glob -- $what {
        option { set candidates [OptionNames $table] }
        file - folder - path - script { set candidates [::sorma::candidates::files $partial] }
        word { set candidates [if {$class eq "dict"} {concat [::sorma::table words $where] [Classes $action $where]}] }
        name - target - pattern - object {
            set candidates [if {$action eq "-classes"} {::sorma::table classes $where} else {::sorma::table objects $where}]
            if {$what eq "pattern" && $class eq "dict"} {
                set candidates [::sorma::table words $where]
            }
        }
        class { set candidates [::sorma::table classes $where] }
        what {
            set candidates $::sorma::requestWords::Infos
            if {$action eq "-inventory"} {
                set candidates {addresses classes names objects serves words}
            }
        }
        daemon { set candidates [::sorma::world names] }
        0..2 { set candidates {0 1 2} }
        default { set candidates [Alternatives $what] }
    }
    return [list $candidates $hint]
}

# New entries may be for any class, old ones are those that there are.
proc ::sorma::requestWords::Classes {action where} {
    return [if {$action eq "-add"} {::sorma::table classes $where}]
}

# Literal words of a usage text: a|b|c. A single word is the name of something.
proc ::sorma::requestWords::Alternatives usage {
    return [if {[string match *|* $usage]} {lsearch -all -inline -regexp [split $usage |?] {^[\w-]+$}}]
}

# A recipe: words of CTRL of the class of NAME, and -SUBST with an entry of the dictionary.
# where: the daemon of that dictionary; empty: here.
proc ::sorma::requestWords::recipe {name words partial {where {}}} {
    if {[lindex $words end] eq "-SUBST"} {
        return [list [::sorma::table words $where] "-SUBST word: what that entry says is put here"]
    }
    set table {}
    if {[regexp {^[[:alpha:]]} $name]} {
        set table [::sorma::table guess $name]
    }
    if {$table eq {}} {
        return [list -SUBST {}]
    }
    dict set table actions {}
    lassign [State $table 1 $words] what item
    if {$what eq "value"} {
        lassign [Value $table [lindex $item 0] $partial] candidates hint
        if {[lindex $item 1] ne "flag"} {
            return [list $candidates $hint]
        }
    } else {
        set candidates {}
        set hint [NameHint $table $partial 1]
    }
    return [list [concat $candidates -SUBST [::sorma::candidates::without [OptionNames $table] $words]] $hint]
}

# EXEC: parts of a message, and words of the class's own. {candidates hint}
proc ::sorma::requestWords::Exec {table words partial} {
    set hint [Signature $table]
    set used {}
    for {set i 0} {$i < [llength $words]} {} {
        set word [lindex $words $i]
        incr i
        switch -- $word {
            TMSG - AMSG {
                if {$i == [llength $words]} {
                    return [list {} $hint]
                }
                incr i
            }
            FMSG - IMSG {
                if {$i == [llength $words]} {
                    return [list [Count $table $word] $hint]
                }
                set count [lindex $words $i]
                if {![string is integer -strict $count]} {
                    return [list {} $hint]
                }
                if {[llength $words] - $i - 1 < $count} {
                    return [list {} "$word: number [expr {[llength $words] - $i}] of $count; $hint"]
                }
                incr i [expr {1 + $count}]
            }
        }
        lappend used $word
    }
    set keys {}
    foreach part [dict get $table reads] {
        lappend keys [dict get {text TMSG floats FMSG ints IMSG any AMSG} [lindex $part 0]]
    }
    if {[llength $keys] == 0} {
        set keys {TMSG FMSG IMSG AMSG}
    }
    return [list [::sorma::candidates::without [concat $keys [Alternatives [dict get $table words]]] $used] $hint]
}

# How many numbers EXEC reads, where the table says so.
proc ::sorma::requestWords::Count {table key} {
    set part [lsearch -inline -index 0 [dict get $table reads] [expr {$key eq "FMSG" ? "floats" : "ints"}]]
    lassign $part - low high
    return [if {$low ne {} && $low eq $high} {set low}]
}

proc ::sorma::requestWords::Signature table {
    set text [string map {\n "; "} [dict get $table signature]]
    if {[dict get $table example] ne {}} {
        append text [expr {$text eq {} ? {} : "; "}] "as in: " [dict get $table example]
    }
    return $text
}

# What is wrong after NAME METHOD while something known is near: an option, a word, or one of the choices of an option. Empty: nothing.
proc ::sorma::requestWords::slip {name method words} {
    set table [if {$method in {CTRL DBX cget configure info}} {::sorma::table guess $name}]
    if {$table eq {}} {
        return {}
    }
    if {$method eq "info"} {
        return [if {[llength $words] > 0} {::sorma::candidates::unknown [lindex $words 0] $::sorma::requestWords::Infos {}}]
    }
    set ctrl [expr {$method ne "DBX"}]
    set known [if {$method in {CTRL DBX}} {KnownNames $table $ctrl} else {OptionNames $table}]
    set before {}
    foreach word $words {
        lassign [State $table $ctrl $before] what item
        lappend before $word
        set slip {}
        if {$what eq "value" && [lindex $item 1] eq "enum"} {
            set slip [::sorma::candidates::unknown $word [lindex $item 3] "[lindex $item 0] "]
        } elseif {$what eq "name" || [regexp {^-[[:alpha:]]} $word]} {
            set slip [::sorma::candidates::unknown $word $known {}]
        }
        if {$slip ne {}} {
            return $slip
        }
    }
    return {}
}
