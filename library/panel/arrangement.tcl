# arrangement.tcl -- windows that stand together, as a file: one line for each, plain text that people write too.
#
#     # the kitchen
#     console -geometry 800x400+0+0
#     panel -name foo.a@robot -options "-tempo -where" -geometry 420x500+820+0
#     stripchart -plot "probe.y@robot -value" -span 30
#
# Lines are as entries.tcl reads them. Options are those of the widgets, and -geometry: WIDTHxHEIGHT+X+Y, without a place the window comes
# where it was last. -plot may come several times. Other files that are named there count from the file's folder.
#
# The file of a dashboard is alike: its lines are parts of one window (boardFile.tcl).

package require sorma
package require sorma::boardFile
package require sorma::entries
package require sorma::text
package provide sorma::arrangement 1.0

namespace eval ::sorma::arrangement {
    namespace export parse text part console open save
    namespace ensemble create
    # kind -> package, command and options that a line may have. The command is called with the window and the options that were given.
    variable Kinds {
        console {sorma::console ::sorma::console {-keep {{whole 1 {}}}}}
        panel {sorma::panel ::sorma::arrangement::Panel {
            -name {{word {a service object}}} -options any -groups any -layout {{word {a file}}} -live {{whole 1 {}}} -apply {{choice now later}}
            -state {{choice normal readonly}} -make boolean}}
        stripchart {sorma::chart ::sorma::stripchart {
            -plot {{collect {an object and its option}}} -span any -low any -high any -interval {{whole 1 {}}} -paused boolean
            -keep any}}
        form {sorma::form ::sorma::form {
            -file {{word {a file}}} -live {{whole 1 {}}} -apply {{choice now later}} -state {{choice normal readonly}} -make boolean}}
        image {sorma::image ::sorma::image {
            -name {{word {a service object}}} -request {{word {a request}}} -every {{whole 0 {}}} -size any -zoom any}}
        trailview {sorma::trailview ::sorma::trailview {-keys {{word {a pattern}}} -severity any -keep {{whole 1 {}}}}}
        dashboard {sorma::dashboard ::sorma::dashboard {-file {{word {a file}}} -wall boolean}}
    }
    variable Needs {panel -name form -file image -name dashboard -file}
    # Parts of a dashboard, which boardFile.tcl reads: package and command of each.
    variable Parts {
        display {sorma::display ::sorma::display} meter {sorma::lamp ::sorma::meter} led {sorma::lamp ::sorma::led} reading {sorma::lamp ::sorma::reading}
        status {sorma::lamp ::sorma::status} button {sorma::field ::sorma::button} image {sorma::image ::sorma::image} stripchart {sorma::chart ::sorma::stripchart}
    }
    variable Console {}         ;# the toplevel that a line "console" is about; empty: it opens one
}

# ::sorma::arrangement parse TEXT ?WHERE? ?WHAT? --
#       Read an arrangement.
# Arguments:
#       WHERE   the name of the file, for errors
#       WHAT    windows, or parts: of a dashboard
# Results:
#       List of two: windows, each a list of kind and dict of its options; errors, each a line WHERE:LINE: ...
proc ::sorma::arrangement::parse {text {where arrangement} {what windows}} {
    if {$what eq "parts"} {
        return [::sorma::boardFile::parse $text $where]
    }
    set windows {}
    ::sorma::entries::each {place words} $text $where ::sorma::SplitWords {
        lappend windows [Window [lindex $words 0] [lrange $words 1 end]]
    } wrong
    return [list $windows $wrong]
}

# A window's kind and the options that were given.
proc ::sorma::arrangement::Window {kind words} {
    variable Kinds
    variable Needs
    set tables [dict map {its facts} $Kinds {lindex $facts 2}]
    set settings [::sorma::boardFile::settings window $tables $Needs {-geometry {{word {WIDTHxHEIGHT+X+Y}}}} $kind $words]
    if {[dict exists $settings -geometry] && ![regexp {^\d+x\d+(\+-?\d+\+-?\d+)?$} [dict get $settings -geometry]]} {
        ::sorma::boardFile::fail "$kind: -geometry expects WIDTHxHEIGHT+X+Y, got \"[dict get $settings -geometry]\""
    }
    return [list $kind $settings]
}

# ::sorma::arrangement part KIND -- package and command of a part of a dashboard.
proc ::sorma::arrangement::part kind {
    variable Parts
    return [dict get $Parts $kind]
}

# ::sorma::arrangement text WINDOWS -- as parse has them, as text.
proc ::sorma::arrangement::text windows {
    return [join [lmap window $windows {
        lassign $window kind settings
        string cat [::sorma::entries::line [concat $kind {*}[lmap {option value} $settings {
            if {$option eq "-plot"} {concat {*}[lmap plot $value {list $option $plot}]} else {list $option $value}
        }]]] \n
    }] {}]
}

# ::sorma::arrangement console TOPLEVEL -- lines "console" are about this one.
proc ::sorma::arrangement::console top {
    variable Console $top
    ::sorma::window place $top console
}

# ::sorma::arrangement open FILE -- open all its windows. Returns the errors, a line for each; the others are open.
proc ::sorma::arrangement::open file {
    lassign [parse [::sorma::text::readFile $file] $file] windows wrong
    set folder [file dirname [file normalize $file]]
    foreach window $windows {
        lassign $window kind settings
        if {[catch {Show $kind [Located $settings $folder]} message]} {
            lappend wrong "$file: $kind: $message"
        }
    }
    return $wrong
}
# Settings with full names of the files in them; and with those in the folder named from there, so that it can be moved as a whole.
proc ::sorma::arrangement::Located {settings folder} {
    return [dict map {option value} $settings {if {$option in {-layout -file}} {file join $folder $value} else {set value}}]
}
proc ::sorma::arrangement::Relative {settings folder} {
    return [dict map {option value} $settings {
        set path [if {$option in {-layout -file}} {file normalize $value}]
        if {[string equal -length [string length $folder/] $folder/ $path]} {string range $path [string length $folder/] end} else {set value}
    }]
}
proc ::sorma::arrangement::Show {kind settings} {
    variable Kinds
    variable Console
    package require sorma::window
    lassign [dict get $Kinds $kind] package command
    set geometry [if {[dict exists $settings -geometry]} {dict get $settings -geometry}]
    set settings [dict remove $settings -geometry]
    if {$kind eq "console" && [winfo exists $Console]} {
        set top $Console
        [Widget $top] configure {*}$settings
    } else {
        package require $package
        set top [::sorma::window open [list $kind {*}$settings] [Title $kind $settings] $command {*}$settings]
    }
    if {$geometry ne {}} {
        ::sorma::window geometry $top $geometry
    }
    return $top
}
proc ::sorma::arrangement::Title {kind settings} {
    foreach option {-name -plot -file -keys} {
        if {[dict exists $settings $option]} {
            return "[join [dict get $settings $option] {, }][if {$kind ne "panel"} {string cat " " $kind}]"
        }
    }
    return $kind
}
proc ::sorma::arrangement::Panel {window args} {
    ::sorma::panel $window [dict get $args -name] {*}[dict remove $args -name]
}

# ::sorma::arrangement save FILE -- the windows of these kinds that are open.
proc ::sorma::arrangement::save file {
    variable Kinds
    package require sorma::window
    set windows {}
    set folder [file dirname [file normalize $file]]
    dict for {top key} [::sorma::window all] {
        set settings [lassign $key kind]
        if {[dict exists $Kinds $kind]} {
            set settings [Relative [Now $kind $settings [Widget $top]] $folder]
            if {$kind eq "dashboard" && ![dict exists $settings -file]} continue        ;# it has not been saved
            lappend windows [list $kind [dict replace $settings -geometry [wm geometry $top]]]
        }
    }
    ::sorma::text::writeFile $file "# saved by scottwish\n[text $windows]"
}
# What the toplevel shows.
proc ::sorma::arrangement::Widget top {
    return [string trimright $top .].w
}
# Options as they are by now: of those that the widget has, all that are not as ever.
proc ::sorma::arrangement::Now {kind settings widget} {
    variable Kinds
    foreach option [dict keys [lindex [dict get $Kinds $kind] 2]] {
        if {![catch {$widget configure $option} facts] && [lindex $facts 4] ne [lindex $facts 3]} {
            dict set settings $option [lindex $facts 4]
        }
    }
    return $settings
}
