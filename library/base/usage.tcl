# usage.tcl -- how commands and programs are called, as the manual says it. It knows no bus.
#
# The build takes it from the pages' [call] lines and lists of options (doc/pages.tcl). Completion, help and usage messages have it
# from here.

package require sorma::text
package provide sorma::usage 1.0

namespace eval ::sorma::usage {
    variable Folder [file join [file dirname [file normalize [info script]]] manual]
    variable Tables {}          ;# dict: name of a file there -> its content, as far as it has been read
}

# ::sorma::usage::table NAME -- a table that the build has made of the manual; doc/pages.tcl says what is in it. Packages have
# them in the form of gzip.
proc ::sorma::usage::table name {
    variable Folder
    variable Tables
    if {![dict exists $Tables $name]} {
        set content {}
        foreach path [glob -nocomplain -directory $Folder $name $name.gz] {      ;# none while the manual is made
            set file [open $path rb]
            if {[file extension $path] eq ".gz"} {
                zlib push gunzip $file
            }
            fconfigure $file -encoding utf-8
            try {
                set content [read $file]
            } finally {
                close $file
            }
        }
        dict set Tables $name $content
    }
    return [dict get $Tables $name]
}

# ::sorma::usage::commands ?PATTERN? -- commands and programs of the manual.
proc ::sorma::usage::commands {{pattern *}} {
    return [dict keys [table usage] $pattern]
}

# ::sorma::usage::of COMMAND -- list of the ways to call it: "sorma::health daemon ?-timeout ms?". Empty: it has no manual.
proc ::sorma::usage::of command {
    return [lmap usage [Entry $command usages] {lindex $usage 0}]
}

# ::sorma::usage::words COMMAND --
#       The words behind COMMAND that are no options, for each way to call it. A placeholder is <name>; other words are as they
#       are typed. The last one ends in ... when it may be repeated.
proc ::sorma::usage::words command {
    return [lmap usage [Entry $command usages] {lindex $usage 1}]
}

# ::sorma::usage::options COMMAND -- dict: option -> what follows it; empty when it stands alone.
proc ::sorma::usage::options command {
    return [Entry $command options]
}

proc ::sorma::usage::Entry {command what} {
    set usage [table usage]
    return [if {[dict exists $usage $command]} {dict get $usage $command $what}]
}

# ::sorma::usage::wrong COMMAND ?WHY? -- fail: COMMAND was called with words that it does not take.
proc ::sorma::usage::wrong {command {why {wrong # args}}} {
    return -code error -level 2 -errorcode {SORMA REQUEST SYNTAX} "$why: should be [join [lmap usage [of $command] {string cat \"$usage\"}] { or }]"
}

# ::sorma::usage::Ways NAME -- the lines of its -help that say how to call it.
proc ::sorma::usage::Ways name {
    set out {}
    foreach usage [of $name] {
        lappend out {*}[::sorma::text::wrap "[expr {[llength $out] == 0 ? "usage:" : "      "}] $usage" 100 11]
    }
    return $out
}

# ::sorma::usage::refused NAME WHY -- what a program says to a bad command line. The options are not listed: the reason would
# leave the terminal.
proc ::sorma::usage::refused {name why} {
    return [join [list "$name: $why" {*}[Ways $name] "$name --help explains them"] \n]
}

# ::sorma::usage::program NAME -- the text of its -help: the ways to call it, its options, its exit codes.
proc ::sorma::usage::program name {
    set out [Ways $name]
    foreach line [split [listed $name OPTIONS] \n] {
        lappend out "  $line"
    }
    foreach place [if {[dict exists [table places] {section {EXIT CODES}}]} {dict get [table places] {section {EXIT CODES}}}] {
        lassign $place page from to
        if {$page eq $name} {
            set text [lmap line [lrange [table $page.lines] $from+2 $to-1] {lindex $line 2}]
            lappend out {*}[::sorma::text::wrap "Exit codes: [string trim [join $text]]" 100 4]
        }
    }
    return [join $out \n]
}

# ::sorma::usage::listed PAGE SECTION -- the options that a section of a page lists, each with what it is for.
proc ::sorma::usage::listed {page section} {
    set all [table options]
    if {![dict exists $all [list $page $section]]} {
        return {}
    }
    return [::sorma::text::table {} [lmap option [dict get $all [list $page $section]] {
        lassign $option name argument help
        list [string trim "$name $argument"] $help
    }] -width 98 -wrap 1]
}
