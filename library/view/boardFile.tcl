# boardFile.tcl -- the file of a dashboard: a line for each part, as entries.tcl reads them. It knows no window.
#
#     display -name arm.left@cell -option -speed -at "0 0 6 4"
#     stripchart -plot "arm.left@cell -speed" -span 60 -at "6 0 18 8"
#
# -at is COLUMN ROW WIDTH HEIGHT, in steps of boardGrid.tcl. -plot may come several times. A part is a list of its kind and a dict of its options.

package require sorma
package require sorma::boardGrid
package require sorma::entries
package require sorma::options
package provide sorma::boardFile 1.0

namespace eval ::sorma::boardFile {
    # kind -> options that a line may have.
    variable Parts {
        display {-name any -option {{word {an option}}} -index {{whole 0 {}}} -format any -text any}
        meter {-name any -option any -low any -high any -warn any -alarm any -format any -text any}
        led {-name any -option any -good any -bad any -text any}
        reading {-name any -request any -part any -index any -unit any -every any -text any}
        status {-name any -text any}
        button {-name any -request any -text any}
        image {-name any -request any -every {{whole 0 {}}} -size any -zoom any -text any}
        stripchart {-plot {{collect {an object and its option}}} -span any -low any -high any -keep any -text any}
        text {-text any}
    }
    variable Needs {
        display {-name -option} meter {-name -option} led {-name -option} reading -name status -name button {-name -request} image -name text -text
    }
}

# ::sorma::boardFile::parse TEXT WHERE -- list of two: parts; errors, each a line WHERE:LINE: ...
proc ::sorma::boardFile::parse {text where} {
    set parts {}
    ::sorma::entries::each {place words} $text $where ::sorma::SplitWords {
        lappend parts [Part [lindex $words 0] [lrange $words 1 end]]
    } wrong
    return [list $parts $wrong]
}
proc ::sorma::boardFile::Part {kind words} {
    variable Parts
    variable Needs
    set settings [settings part $Parts $Needs {-at {{word {COLUMN ROW WIDTH HEIGHT}}}} $kind $words]
    if {[dict exists $settings -at] && ![regexp {^(\d+) +(\d+) +([1-9]\d*) +([1-9]\d*)$} [dict get $settings -at]]} {
        fail "$kind: -at expects COLUMN ROW WIDTH HEIGHT, got \"[dict get $settings -at]\""
    }
    return [list $kind $settings]
}

# ::sorma::boardFile::settings WHAT TABLES NEEDS PLACE KIND WORDS -- the options that a line gives, as a dict.
# Arguments:
#       WHAT    it is, for errors
#       TABLES  dict: kind -> its options;  NEEDS: dict: kind -> those that it must have
#       PLACE   an option that each kind has, and its type
proc ::sorma::boardFile::settings {what tables needs place kind words} {
    if {![dict exists $tables $kind]} {
        fail "bad kind of $what \"$kind\": must be [::sorma::options::oneOf [lsort [dict keys $tables]]]"
    }
    set table [dict merge [dict get $tables $kind] $place]
    set defaults [::sorma::options::defaults $table]
    set settings [dict filter [::sorma::options::parse $table $words] script {option value} {expr {$value ne [dict get $defaults $option]}}]
    foreach needed [if {[dict exists $needs $kind]} {dict get $needs $kind}] {
        if {![dict exists $settings $needed]} {
            fail "$kind: $needed must say what it shows"
        }
    }
    foreach plot [if {[dict exists $settings -plot]} {dict get $settings -plot}] {
        if {[catch {llength $plot} n] || $n < 2 || $n % 2 || ![regexp {^(?:-\S+|EXEC\y.*)$} [lindex $plot 1]]} {
            fail "$kind: -plot expects an object and its option, or a request EXEC, got \"$plot\""
        }
    }
    return $settings
}
proc ::sorma::boardFile::fail message {
    return -code error -errorcode {SORMA REQUEST SYNTAX} $message
}

# ::sorma::boardFile::title KIND SETTINGS -- what stands above a part.
proc ::sorma::boardFile::title {kind settings} {
    if {[dict exists $settings -text]} {
        return [dict get $settings -text]
    } elseif {[dict exists $settings -plot]} {
        return [join [lsort -unique [lmap plot [dict get $settings -plot] {string trimleft [lindex $plot 1] -}]] {, }]
    }
    set what [lmap option {-name -option -request} {if {![dict exists $settings $option]} continue; string trimleft [dict get $settings $option] -}]
    return [join $what]
}

# ::sorma::boardFile::size KIND -- {WIDTH HEIGHT} of a part that has no place.
proc ::sorma::boardFile::size kind {
    return [switch -- $kind {
        text { list 24 1 }
        stripchart { list 12 6 }
        image { list 8 6 }
        default { list 4 3 }
    }]
}

# ::sorma::boardFile::places PARTS -- the place of each, a dict: its index -> place. Those without one come where there is room.
proc ::sorma::boardFile::places parts {
    set places {}
    set n -1
    foreach part $parts {
        lassign $part kind settings
        set place [if {[dict exists $settings -at]} {dict get $settings -at} else {::sorma::boardGrid::free $places {*}[size $kind]}]
        dict set places [incr n] $place
        set places [::sorma::boardGrid::settle $places $n]
    }
    return $places
}
