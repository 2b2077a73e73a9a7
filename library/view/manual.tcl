# manual.tcl -- the manual pages at the prompt, and what they say of classes, which is taken from the classes' own tables.
#
# Pages are written in doctools (doc/*.man). What a class's table knows is not written there by hand but included:
# [include fork.options]. The build puts it in, and installs the pages beside the package; nroff and HTML are made of the
# same ones. No tcllib is needed to read them here.

package require sorma::show
package provide sorma::manual 1.0
namespace eval ::sorma::manual {
    variable Pages {}           ;# dict: page -> its blocks, as far as they have been read
    variable Marks              ;# of the page that is being read: list of {kind word ...}, in the order of its commands
}

# ::sorma::manual ?NAME? ?-width n? --
#       What the manual says of a name, as text for a terminal.
# Arguments:
#       NAME    a page (sormad), a class (fork), a command (sorma::async, or async), a section of a page, or the area and
#               symbol of an error (COMM TIMEOUT). An object's name stands for its class. Without: a list of all pages
#       n       columns; default 80, 0: no limit
# Results:
#       Text without a newline at its end. Fails with SORMA MANUAL UNKNOWN.
proc ::sorma::manual {args} {
    set width 80
    if {[lindex $args end-1] eq "-width"} {
        set width [lindex $args end]
        set args [lrange $args 0 end-2]
        if {![string is integer -strict $width] || $width < 0} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "-width expects a number of columns, got \"$width\""
        }
    }
    if {[llength $args] > 1 && ![regexp {^[A-Z]+( [A-Z_]+)+$} $args]} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} {wrong # args: should be "sorma::manual ?name? ?-width n?"}
    }
    if {[llength $args] == 0} {
        return [manual::Contents $width]
    }
    set name [join $args]
    set blocks [manual::Find $name]
    if {[llength $blocks] == 0} {
        return -code error -errorcode [list SORMA MANUAL UNKNOWN $name] \
            "the manual has nothing of that name: \"$name\"; there are the pages [join [manual::pages] {, }], their sections, classes, commands and errors"
    }
    return [manual::Render $blocks $width]
}

# ---- pages ----

# ::sorma::manual::pages -- names of all pages.
proc ::sorma::manual::pages {} {
    return [lsort [lmap file [glob -nocomplain -tails -directory [Folder] *.man] {file rootname $file}]]
}

# ::sorma::manual::titles -- a dict: page -> what it is about.
proc ::sorma::manual::titles {} {
    set titles {}
    foreach page [pages] {
        dict set titles $page [lindex [Page $page] 0 2]
    }
    return $titles
}

proc ::sorma::manual::Folder {} {
    return [file join $::sorma::library manual]
}

proc ::sorma::manual::Page name {
    variable Pages
    if {![dict exists $Pages $name]} {
        set file [open [file join [Folder] $name.man]]
        fconfigure $file -encoding utf-8
        try {
            dict set Pages $name [Read [read $file]]
        } finally {
            close $file
        }
    }
    return [dict get $Pages $name]
}

proc ::sorma::manual::Contents width {
    set rows {}
    dict for {page title} [titles] {
        lappend rows [list $page $title]
    }
    return [::sorma::text::table {} $rows -width $width -wrap 1]
}

# The blocks that tell about a name; none: nothing does.
proc ::sorma::manual::Find name {
    set plain [string trimleft $name :]
    if {$plain in [pages]} {
        return [Page $plain]
    }
    # A page bears a name of its own, too: man sorma-cpp. Another one that man knows: sorma::serviceClass.
    foreach page [pages] {
        if {$plain in [list [lindex [Page $page] 0 1] sorma::$page]} {
            return [Page $page]
        }
    }
    # An object stands for its class; a command may be named without its namespace.
    set class [lindex [split $plain .@] 0]
    foreach {kind wanted} [list section [string toupper $class] call [list $plain sorma::$plain] def $plain section [string toupper $plain]] {
        set found {}
        foreach page [pages] {
            lappend found {*}[Portion [Page $page] $kind $wanted]
        }
        if {[llength $found] > 0} {
            return $found
        }
    }
    return {}
}

# Of a page: the section of that heading; or the items of lists that tell about a command or an error.
proc ::sorma::manual::Portion {blocks kind wanted} {
    set found {}
    set in 0            ;# depth of the list whose item it is; for sections 1
    set depth 0
    set last {}
    foreach block $blocks {
        lassign $block what text
        if {$kind eq "section"} {
            if {$what eq "section"} {
                set in [expr {[string toupper $text] eq $wanted}]
            }
        } elseif {$what eq "begin"} {
            incr depth
        } elseif {$what eq "end"} {
            if {$depth <= $in} {
                set in 0
            }
            incr depth -1
        } elseif {$what eq "item" && ($in == 0 || $depth <= $in)} {
            # Several heads in a row have one text.
            set is [expr {$kind eq "call" ? [lindex [split $text] 0] in $wanted : [Names $text $wanted]}]
            if {$is || $last ne "item"} {
                set in [expr {$is ? $depth : 0}]
            }
        }
        set last $what
        if {$in} {
            lappend found $block
        }
    }
    return $found
}

# Does an item's head, "COMM TOO_BIG, LIMIT, DENIED", tell about an error?
proc ::sorma::manual::Names {head wanted} {
    foreach item [split $head ,] {
        set item [string trim $item]
        if {[llength [split $item]] == 2} {
            set area [lindex [split $item] 0]
        } elseif {[info exists area]} {
            set item "$area $item"
        }
        if {$item eq $wanted} {
            return 1
        }
    }
    return 0
}

# ---- reading doctools ----

# The blocks of a page, in order: {page NAME TITLE SECTION}, {section HEADING}, {para TEXT}, {example TEXT},
# {begin KIND} ... {end} of a list, {item HEAD} in it.
#
# A page is text with commands in brackets, whose words are commands and text again: just what Tcl's subst does, here in an
# interpreter that has no other commands than those of doctools. Commands that make blocks leave a mark in the text.
proc ::sorma::manual::Read text {
    variable Marks {}
    set reader [interp create -safe]
    try {
        $reader hide subst
        foreach command [$reader eval {info commands}] {
            $reader hide $command
        }
        foreach command {cmd method const option arg package var namespace emph strong file term type class fun syscmd sectref uri widget} {
            interp alias $reader $command {} ::sorma::manual::Inline
        }
        foreach {command kind} {section section subsection section para para nl para list_begin begin list_end end item item def item call item
                opt_def item arg_def item cmd_def item enum item example example example_begin verbatim example_end text
                manpage_begin page titledesc title} {
            interp alias $reader $command {} ::sorma::manual::Mark $kind
        }
        foreach command {comment moddesc require see_also keywords manpage_end description copyright category vset} {
            interp alias $reader $command {} ::sorma::manual::Nothing
        }
        interp alias $reader lb {} ::sorma::manual::Inline \[
        interp alias $reader rb {} ::sorma::manual::Inline \]
        interp alias $reader opt {} ::sorma::manual::Optional
        set text [interp invokehidden $reader subst -nobackslashes -novariables $text]
    } finally {
        interp delete $reader
    }
    set blocks {}
    set verbatim 0
    set page {page {} {} {}}
    foreach piece [split $text \0] {
        if {$verbatim} {
            lappend blocks [list example [string trim $piece \n]]
            set verbatim 0
            continue
        }
        if {[regexp {^\x01(\d+)\x02$} $piece -> mark]} {
            set words [lassign [lindex $Marks $mark] kind]
            switch -- $kind {
                page { set page [list page [lindex $words 0] {} [lindex $words 1]] }
                title { lset page 2 [lindex $words 0] }
                verbatim { set verbatim 1 }
                para - text {}
                section { lappend blocks [list section [Flat [lindex $words 0]]] }
                example { lappend blocks [list example [string trim [lindex $words 0] \n]] }
                begin { lappend blocks [list begin [lindex $words 0]] }
                end { lappend blocks [list end] }
                item { lappend blocks [list item [Flat [join $words]]] }
            }
        } elseif {[string trim $piece] ne {}} {
            lappend blocks [list para [Flat $piece]]
        }
    }
    return [linsert $blocks 0 $page]
}

proc ::sorma::manual::Flat text {
    return [string trim [regsub -all {\s+} $text { }]]
}
proc ::sorma::manual::Inline args {
    return [join $args]
}
proc ::sorma::manual::Optional args {
    return ?[join $args]?
}
proc ::sorma::manual::Nothing args {}
proc ::sorma::manual::Mark {kind args} {
    variable Marks
    lappend Marks [list $kind {*}$args]
    return \0\x01[expr {[llength $Marks] - 1}]\x02\0
}

# ---- writing for a terminal ----

proc ::sorma::manual::Render {blocks width} {
    set out {}
    set depth 0
    set kinds {}
    set last {}
    foreach block $blocks {
        lassign $block kind text title section
        set margin [string repeat { } [expr {4 + 4 * $depth}]]
        switch -- $kind {
            page { lappend out {*}[::sorma::text::wrap "$text ($section) -- $title" $width 4] }
            section { lappend out {} [string toupper $text] }
            begin {
                incr depth
                lappend kinds $text
            }
            end {
                incr depth -1
                set kinds [lrange $kinds 0 end-1]
            }
            item {
                set margin [string range $margin 4 end]
                if {$text eq {}} {
                    set bullet 1
                    continue
                }
                if {$last ne "item"} {
                    lappend out {}
                }
                lappend out {*}[::sorma::text::wrap $margin$text $width [expr {[string length $margin] + 8}]]
            }
            para {
                if {$last ni {item section page}} {
                    lappend out {}
                }
                if {[info exists bullet]} {
                    unset bullet
                    set margin [string replace $margin end-1 end-1 *]
                }
                lappend out {*}[::sorma::text::wrap $margin$text $width [string length $margin]]
            }
            example {
                lappend out {}
                foreach line [split $text \n] {
                    lappend out [string trimright "$margin    $line"]
                }
            }
        }
        set last $kind
    }
    while {[llength $out] > 0 && [lindex $out 0] eq {}} {
        set out [lrange $out 1 end]
    }
    return [join $out \n]
}

# ---- what a class's table says ----

# ::sorma::manual::fragment --
#       What pages include, in doctools.
# Arguments:
#       class   service class; it is loaded
#       part    options, actions (words of CTRL and DBX), exec (what EXEC reads and writes), or table: all, with the purpose
proc ::sorma::manual::fragment {class part} {
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
            return "[Plain [Sentence [dict get $table purpose]]].\n\[para]\n[Exec $table]\n[Options $table]\n[Actions $table]"
        }
        default {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "bad part \"$part\": must be actions, exec, options, or table"
        }
    }
}

proc ::sorma::manual::Options table {
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
        if {$name in [dict get $table fixed]} {
            lappend facts "Only a recipe may set it"
        }
        append out "\n\[opt_def $name \"[Quoted $argument]\"]\n[Plain $help]"
        append out [join [linsert $facts 0 {}] {. }]
        append out ". Default: [if {$default eq {}} {string cat none} else {Plain $default}]"
    }
    return "$out\n\[list_end]"
}

# Limits as one would write them: 1 .. 1e+06 is 1 .. 1000000.
proc ::sorma::manual::Limits range {
    return [lmap word $range {
        if {[regexp {^-?[0-9.]+e\+?[0-9]+$} $word] && abs($word) < 1e15 && $word == wide($word)} {
            set word [expr {wide($word)}]
        }
        set word
    }]
}

proc ::sorma::manual::Actions table {
    set class [dict get $table class]
    set out {}
    foreach {key method} {actions CTRL inspections DBX} {
        foreach action [dict get $table $key] {
            lassign $action name usage help
            append out "\n\[call $class \[const $method] \[option $name][Usage $usage]]\n[Plain [Sentence $help]]."
        }
    }
    if {$out eq {}} {
        return {}
    }
    return "\[list_begin definitions]$out\n\[list_end]"
}

proc ::sorma::manual::Exec table {
    set class [dict get $table class]
    set out {}
    foreach line [split [dict get $table signature] \n] {
        if {![regexp {^(reads|writes) (\w+): (.*)$} $line -> verb part rest]} continue
        set rest [regsub {^any number of(?=,|$)} $rest {}]
        set rest [string trim $rest {, }]
        append out "\n\[def \"$verb \[const $part]\"] [if {$rest eq {}} {string cat {any number}} else {Plain $rest}]"
    }
    if {$out ne {}} {
        set out "\[const EXEC]\n\[list_begin definitions]$out\n\[list_end]\n"
    }
    if {[dict get $table example] ne {}} {
        append out "Try:\n\[example_begin]\n[Plain [dict get $table example]]\n\[example_end]"
    }
    return $out
}

proc ::sorma::manual::Usage usage {
    if {$usage eq {}} {
        return {}
    }
    # ?word ...? is [opt "[arg word]..."].
    return " [string map {{ ...} ...} [regsub -all {\?([^?]+)\?} [regsub -all {[^\s?.]+} $usage {[arg &]}] {[opt "\1"]}]]"
}

proc ::sorma::manual::Sentence text {
    return [string toupper $text 0]
}
# A text between commands, and in the quotes of one.
proc ::sorma::manual::Plain text {
    return [string map {\[ {[lb]} \] {[rb]}} $text]
}
proc ::sorma::manual::Quoted text {
    return [string map [list \" \\\" \\ \\\\ \$ \\\$] $text]
}
