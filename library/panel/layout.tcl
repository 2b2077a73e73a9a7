# layout.tcl -- the groups and the order of options in a panel; as a file, plain text that people write too. It knows no window.
#
#     # of the arm
#     group Motion
#     -transferSpeed
#     -approach
#     hide -debug
#     fold Motion
#
# Options before the first group have no title; options that a layout does not name stand behind it. A layout is a dict: groups is a
# list of title and options ..., hidden has options, and folded has titles. The empty text is none. A folded group shows its title alone.
# Lines are as entries.tcl reads them.

package require sorma
package require sorma::entries
package require sorma::text
package provide sorma::layout 1.0

namespace eval ::sorma::layout {
    namespace export of byGroup complete move hide fold text parse read write
    namespace ensemble create
    variable Large 24           ;# options: a class with more opens with its later groups folded
}

# ::sorma::layout of DICT -- title -> options.
proc ::sorma::layout::of groups {
    if {[catch {dict size $groups}]} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "-groups expects a dict, title to list of options, got \"$groups\""
    }
    return [if {$groups ne {}} {dict create groups $groups hidden {} folded {}}]
}

# ::sorma::layout byGroup OPTIONS HINTS -- as the class says it: hints of its table. Options for experts are hidden. Later groups
# of a large class are folded. Groups of which all is measured come first; then the options without a group have a title, too.
proc ::sorma::layout::byGroup {options hints} {
    variable Large
    set groups [dict create {} {}]
    foreach option $options {
        dict lappend groups [if {[dict exists $hints $option group]} {dict get $hints $option group}] $option
    }
    set hidden [lmap option $options {
        if {![dict exists $hints $option expert]} continue
        set option
    }]
    set measured [dict filter $groups script {title members} {
        expr {$title ne {} && [llength [lmap option $members {if {[dict exists $hints $option measured]} continue; set option}]] == 0}
    }]
    if {$measured ne {}} {
        set groups [concat $measured [if {[dict get $groups {}] ne {}} {list Settings [dict get $groups {}]}] [dict remove $groups {} {*}[dict keys $measured]]]
    }
    return [dict create groups $groups hidden $hidden folded [if {[llength $options] - [llength $hidden] > $Large} {Later $groups}]]
}
# The titles of those groups that reach beyond half of what is large; the first one stays open.
proc ::sorma::layout::Later groups {
    variable Large
    set n 0
    set later {}
    foreach {title members} $groups {
        set first [expr {$n == 0}]
        incr n [llength $members]
        if {!$first && $title ne {} && $n > $Large / 2} {
            lappend later $title
        }
    }
    return $later
}

# ::sorma::layout complete LAYOUT OPTIONS -- exactly with these options, each once.
proc ::sorma::layout::complete {layout options} {
    set hidden [lmap option [dict get $layout hidden] {if {$option ni $options} continue; set option}]
    set rest $options
    set groups {}
    foreach {title members} [dict get $layout groups] {
        set here {}
        foreach option $members {
            if {$option in $rest && $option ni $hidden} {
                lappend here $option
                set rest [lsearch -all -inline -exact -not $rest $option]
            }
        }
        if {$here ne {}} {
            lappend groups $title $here
        }
    }
    set rest [lmap option $rest {if {$option in $hidden} continue; set option}]
    if {$rest ne {}} {
        lappend groups [expr {$groups eq {} ? "" : "Other"}] $rest
    }
    return [dict create groups $groups hidden $hidden folded [lmap title [dict get $layout folded] {if {![dict exists $groups $title]} continue; set title}]]
}

# ::sorma::layout move LAYOUT OPTION STEP -- an option up (-1) or down (1), from one group to the next one too; hide LAYOUT OPTION.
#
# ::sorma::layout fold LAYOUT TITLE -- a group that is folded is opened, another one folded.
proc ::sorma::layout::move {layout option step} {
    set flat {}
    foreach {title members} [dict get $layout groups] {
        lappend flat [list group $title] {*}[lmap member $members {list option $member}]
    }
    set at [lsearch -exact $flat [list option $option]]
    set to [expr {$at + $step}]
    if {$at < 0 || $to < 1 || $to >= [llength $flat]} {
        return $layout
    }
    set flat [linsert [lreplace $flat $at $at] $to [list option $option]]
    set groups {}
    foreach item $flat {
        lassign $item what word
        if {$what eq "group"} {
            lappend groups $word {}
        } else {
            lset groups end [concat [lindex $groups end] [list $word]]
        }
    }
    return [dict replace $layout groups $groups]
}
proc ::sorma::layout::hide {layout option} {
    set groups {}
    foreach {title members} [dict get $layout groups] {
        lappend groups $title [lsearch -all -inline -exact -not $members $option]
    }
    return [dict replace $layout groups $groups hidden [concat [dict get $layout hidden] [list $option]]]
}
proc ::sorma::layout::fold {layout title} {
    set folded [dict get $layout folded]
    set others [lsearch -all -inline -exact -not $folded $title]
    return [dict replace $layout folded [expr {[llength $others] < [llength $folded] ? $others : [concat $others [list $title]]}]]
}

# ::sorma::layout text LAYOUT, parse TEXT ?WHERE? -- as text and back. WHERE: the name of the file, for errors.
proc ::sorma::layout::text layout {
    set lines {}
    foreach {title members} [dict get $layout groups] {
        lappend lines {*}[if {$title ne {}} {list [list group $title]}] {*}$members
    }
    foreach option [dict get $layout hidden] {
        lappend lines [list hide $option]
    }
    foreach title [dict get $layout folded] {
        lappend lines [list fold $title]
    }
    return [join [lmap line $lines {::sorma::entries::line $line}] \n]\n
}
proc ::sorma::layout::parse {text {where layout}} {
    set groups [list {} {}]
    set hidden {}
    set folded {}
    ::sorma::entries::each {place words} $text $where ::sorma::SplitWords {
        set words [lassign $words head]
        if {$head eq "group" && $words ne {}} {
            lappend groups [join $words] {}
        } elseif {$head eq "hide" && [llength $words] == 1 && [string match -?* $words]} {
            lappend hidden {*}$words
        } elseif {$head eq "fold" && $words ne {}} {
            lappend folded [join $words]
        } elseif {[string match -?* $head] && $words eq {}} {
            lset groups end [concat [lindex $groups end] [list $head]]
        } else {
            throw {SORMA REQUEST SYNTAX} "expected \"group TITLE\", \"hide -OPTION\", \"fold TITLE\" or \"-OPTION\", got\
                \"[::sorma::entries::line [list $head {*}$words]]\""
        }
    }
    return [dict create groups $groups hidden $hidden folded $folded]
}

# ::sorma::layout read FILE, write FILE LAYOUT
proc ::sorma::layout::read file {
    return [parse [::sorma::text::readFile $file] $file]
}
proc ::sorma::layout::write {file layout} {
    ::sorma::text::writeFile $file [text $layout]
}
