# manual.tcl -- the manual pages at the prompt.
#
# Pages are written in doctools (doc/*.man). The build lets doctools read them (doc/pages.tcl has the rules), and puts
# their text and its index beside the package.

package require sorma::text
package require sorma::options
package require sorma::usage
package provide sorma::manual 1.0

namespace eval ::sorma::manual {}

# ::sorma::manual ?NAME? ?-width n? --
#       What the manual says of a name, as text for a terminal.
# Arguments:
#       NAME    a page (sormad), a class (fork), a command (sorma::async, or async), a section of a page, or the area and
#               symbol of an error (COMM TIMEOUT). An object's name stands for its class. Without: a list of all pages
#       n       columns; default 80, 0: no limit
# Results:
#       Text without a newline at its end. Fails with SORMA MANUAL UNKNOWN.
proc ::sorma::manual args {
    set width [dict get [::sorma::options::parse {-width {{whole 0 {}} 80}} $args words] -width]
    if {[llength $words] > 1 && ![regexp {^[A-Z]+( [A-Z_]+)+$} $words]} {
        ::sorma::usage::wrong sorma::manual
    }
    if {[llength $words] == 0} {
        return [::sorma::text::table {} [lmap {page title} [manual::titles] {list $page $title}] -width $width -wrap 1]
    }
    set name [join $words]
    set places [manual::Find $name]
    if {[llength $places] == 0} {
        return -code error -errorcode [list SORMA MANUAL UNKNOWN $name] \
            "the manual has nothing of that name: \"$name\"[::sorma::DidYouMean $name [concat [manual::pages] [::sorma::classes]]]; there are the pages [join [manual::pages] {, }], their sections, classes, commands and errors"
    }
    return [join [lmap place $places {manual::Text {*}$place $width}] \n]
}

# ::sorma::manual::pages -- names of all pages.
proc ::sorma::manual::pages {} {
    return [lsort [lmap entry [::sorma::usage::table contents] {lindex $entry 0}]]
}

# ::sorma::manual::titles -- a dict: page -> what it is about.
proc ::sorma::manual::titles {} {
    set titles {}
    foreach entry [lsort -index 0 [::sorma::usage::table contents]] {
        dict set titles [lindex $entry 0] [lindex $entry 2]
    }
    return $titles
}

# Where something is told about a name: list of {PAGE FROM TO}.
proc ::sorma::manual::Find name {
    set plain [string trimleft $name :]
    # A page bears a name of its own, too: man sorma-cpp. Another one that man knows: sorma::serviceClass.
    if {$plain in [pages]} {
        return [list [list $plain 0 end]]
    }
    foreach entry [::sorma::usage::table contents] {
        lassign $entry page own
        if {$plain in [list $own sorma::$page]} {
            return [list [list $page 0 end]]
        }
    }
    # An object stands for its class; a command may be named without its namespace.
    set class [lindex [split $plain .@] 0]
    set places [::sorma::usage::table places]
    foreach {kind words} [list section [string toupper $class] call [list $plain sorma::$plain] def [list $plain] section [list [string toupper $plain]]] {
        set found {}
        foreach word $words {
            if {[dict exists $places [list $kind $word]]} {
                lappend found {*}[dict get $places [list $kind $word]]
            }
        }
        if {[llength $found] > 0} {
            return $found
        }
    }
    return {}
}

# Lines of a page, broken at a width; as far to the left as they can be.
proc ::sorma::manual::Text {page from to width} {
    set lines [::sorma::usage::table $page.lines]
    set lines [if {$to eq "end"} {set lines} else {lrange $lines $from $to-1}]
    while {[lindex $lines 0 2] eq {} && [llength $lines] > 0} {
        set lines [lrange $lines 1 end]
    }
    set left [lindex $lines 0 0]
    set out {}
    foreach line $lines {
        lassign $line margin hang text
        set line [string trimright [string repeat { } [expr {$margin - $left}]]$text]
        lappend out {*}[if {$hang < 0} {list $line} else {::sorma::text::wrap $line $width [expr {$hang - $left}]}]
    }
    return [join $out \n]
}
