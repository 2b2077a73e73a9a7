# classPage.tcl -- what a class's own table says, in doctools, for pages that include it: [include fork.options].

namespace eval ::classPage {}

# ::classPage::fragment --
#       What pages include, in doctools.
# Arguments:
#       class   service class; it is loaded
#       part    options, actions (words of CTRL and DBX), exec (what EXEC reads and writes), or table: all, with the purpose
proc ::classPage::fragment {class part} {
    # The first object of a class teaches what its options' defaults are.
    if {![catch {::sorma::create $class}]} {
        ::sorma::remove $class
    }
    set table [lindex [::sorma::so::sorm DBX -describe $class] 3]
    switch -- $part {
        options { return [Options $table] }
        actions { return [Actions $table] }
        exec { return [Exec $table] }
        table {
            return "[plain [Sentence [dict get $table purpose]]].\n\[para]\n[Exec $table]\n[Options $table]\n[Actions $table]"
        }
        default {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "bad part \"$part\": must be actions, exec, options, or table"
        }
    }
}

proc ::classPage::Options table {
    if {[llength [dict get $table options]] == 0} {
        return "It has no options."
    }
    set out "\[list_begin options]"
    foreach option [dict get $table options] {
        lassign $option name type unit range default value help
        set argument [if {$type eq "flag"} {string cat ?boolean?} elseif {$type eq "enum"} {join $range |} else {set type}]
        if {$unit ni {{} 1}} {
            append argument " \[lb]$unit\[rb]"
        }
        set facts {}
        if {$range ne {} && $type ne "enum"} {
            lappend facts "Range: [Limits $range]"
        }
        foreach {limits said} {warn Warning alarm Alarm} {
            if {[dict exists $table hints $name $limits]} {
                lassign [dict get $table hints $name $limits] low high
                lappend facts "$said [expr {$low eq {} ? "above $high" : $high eq {} ? "below $low" : "outside $low .. $high"}]"
            }
        }
        if {[dict exists $table hints $name measured]} {
            lappend facts "Measured: nobody sets it"
        } elseif {$name in [dict get $table fixed]} {
            lappend facts "Only a recipe may set it"
        }
        if {[dict exists $table hints $name expert]} {
            lappend facts "For experts"
        }
        append out "\n\[opt_def $name \"[Quoted $argument]\"]\n[plain $help]"
        append out [join [linsert $facts 0 {}] {. }]
        append out ". Default: [if {$default eq {}} {string cat none} else {plain $default}]"
    }
    return "$out\n\[list_end]"
}

# Limits as one would write them: 1 .. 1e+06 is 1 .. 1000000.
proc ::classPage::Limits range {
    return [lmap word $range {
        if {[regexp {^-?[0-9.]+e\+?[0-9]+$} $word] && abs($word) < 1e15 && $word == wide($word)} {
            set word [expr {wide($word)}]
        }
        set word
    }]
}

proc ::classPage::Actions table {
    set class [dict get $table class]
    set out {}
    foreach {key method} {actions CTRL inspections DBX} {
        foreach action [dict get $table $key] {
            lassign $action name usage help
            append out "\n\[call $class \[const $method] \[option $name][Usage $usage]]\n[plain [Sentence $help]]."
        }
    }
    if {$out eq {}} {
        return {}
    }
    return "\[list_begin definitions]$out\n\[list_end]"
}

proc ::classPage::Exec table {
    set class [dict get $table class]
    set out {}
    foreach line [split [dict get $table signature] \n] {
        if {![regexp {^(reads|writes) (\w+): (.*)$} $line -> verb part rest]} continue
        set rest [regsub {^any number of(?=,|$)} $rest {}]
        set rest [string trim $rest {, }]
        append out "\n\[def \"$verb \[const $part]\"] [if {$rest eq {}} {string cat {any number}} else {plain $rest}]"
    }
    if {$out ne {}} {
        set out "\[const EXEC]\n\[list_begin definitions]$out\n\[list_end]\n"
    }
    if {[dict get $table example] ne {}} {
        append out "Try:\n\[example_begin]\n[plain [dict get $table example]]\n\[example_end]"
    }
    return $out
}

proc ::classPage::Usage usage {
    if {$usage eq {}} {
        return {}
    }
    # ?word ...? is [opt "[arg word]..."].
    return " [string map {{ ...} ...} [regsub -all {\?([^?]+)\?} [regsub -all {[^\s?.]+} $usage {[arg &]}] {[opt "\1"]}]]"
}

proc ::classPage::Sentence text {
    return [string toupper $text 0]
}
# A text between commands, and in the quotes of one.
proc ::classPage::plain text {
    return [string map {\[ {[lb]} \] {[rb]}} $text]
}
proc ::classPage::Quoted text {
    return [string map [list \" \\\" \\ \\\\ \$ \\\$] $text]
}
