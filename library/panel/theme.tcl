# theme.tcl -- the themes sorma-light and sorma-dark: flat surfaces, one accent, focus that can be seen. On ttk's clam; shapes and marks are images
# drawn once at run time, at the display's scale. Colours are those of colours.tcl.
#
# Spaces are steps of 4 pixels at 96 dots per inch; what one clicks or types in is 30 high. A program around us keeps its own theme unless it
# asks for one of these.
#
# Styles besides ttk's own. Other themes know nothing of them, and take the style behind the last dot:
#   Page.TFrame, Page.TLabel, Page.TLabelframe, Page.TCheckbutton, Page.Toolbutton    on the window's ground, between cards
#   Card.TFrame                 a card, on the ground
#   Strong.Toolbutton           a title that can be pressed
#   Heading.Toolbutton          the title of a group that folds
#   Value.Toolbutton            a number that can be pressed; Error.Value.Toolbutton: of errors
#   Link.Toolbutton             a word beside a text that can be pressed
#   Accent.TButton              the main action of a card
#   Sorma.TEntry                a field of its natural height, as panels have them
#   Quiet.TLabel, Unit.TLabel   what is read second: units, ages, help

package require Tk
package require sorma::colours
package require sorma::style
package provide sorma::theme 1.0

namespace eval ::sorma::theme {
    namespace export use program desktop names
    namespace ensemble create
    variable Families {Inter Cantarell {Noto Sans} {DejaVu Sans}}
    variable Colours            ;# array: those of the theme that is being made
    variable Ramps              ;# array: FROM,TO -> 17 colours
    variable Corners            ;# array: RADIUS,THICK -> rows of a corner
    variable Strokes            ;# array: SIZE,THICK,POINTS -> what that line covers
}

# ::sorma::theme use ?NAME? -- the theme of this program from now on. It is auto (light or dark, as the desktop is), light, dark, or any theme
# of ttk or of a package. The first three also set Tk's own fonts, and colours for menus and texts that are made later.
proc ::sorma::theme::use {{name auto}} {
    if {$name eq "auto"} {
        set name [dict get [desktop] shade]
    }
    set shade [dict get [dict merge [list $name {}] {light light sorma-light light dark dark sorma-dark dark}] $name]
    if {$shade eq {}} {
        try {
            if {$name ni [ttk::style theme names]} {
                package require ttk::theme::$name
            }
            ttk::style theme use $name
        } on error {} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "theme \"$name\" is not one of [join [names] {, }], nor the package of one"
        }
        return
    }
    if {"sorma-$shade" ni [ttk::style theme names]} {
        Fonts
        Make $shade
    }
    ttk::style theme use sorma-$shade
    Classic $shade
}

# ::sorma::theme names -- what use takes, without the packages.
proc ::sorma::theme::names {} {
    return [lsort -unique [concat auto light dark [lsearch -all -inline -not -glob [ttk::style theme names] sorma-*]]]
}

# ::sorma::theme program ?NAME? -- use for a program of ours: without a name, what was chosen before it, by the X resource *TkTheme or a command,
# else auto.
proc ::sorma::theme::program {{name {}}} {
    if {$name ne {}} {
        use $name
    } elseif {[ttk::style theme use] eq "default" && [option get . tkTheme TkTheme] eq {}} {
        use auto
    }
}

# ::sorma::theme desktop -- what the desktop wants, as far as it says: shade, light or dark; font, {FAMILY SIZE} or empty. Asked once, when
# the program begins: environment and files of GTK and KDE, then GNOME's settings.
proc ::sorma::theme::desktop {} {
    global env
    set home [expr {[info exists env(XDG_CONFIG_HOME)] && $env(XDG_CONFIG_HOME) ne {} ? $env(XDG_CONFIG_HOME) : [info exists env(HOME)] ? "$env(HOME)/.config" : {}}]
    set desktop [expr {[info exists env(XDG_CURRENT_DESKTOP)] ? [string tolower $env(XDG_CURRENT_DESKTOP)] : {}}]
    set dark 0
    set font {}
    set gtk [Words [file join $home gtk-3.0 settings.ini]]
    regexp -line {^gtk-application-prefer-dark-theme\s*=\s*(1|true)$} $gtk dark
    regexp -line {^gtk-font-name\s*=\s*(.+)$} $gtk -> font
    if {[string match *kde* $desktop]} {
        set kde [Words [file join $home kdeglobals]]
        set dark [regexp -nocase -line {^ColorScheme\s*=.*dark} $kde]
        if {[regexp -line {^font\s*=\s*([^,]+),(\d+)} $kde -> family size]} {
            set font "$family $size"
        }
    } elseif {$desktop ne {} && [auto_execok gsettings] ne {}} {
        catch {set dark [string match *prefer-dark* [exec gsettings get org.gnome.desktop.interface color-scheme 2> /dev/null]]}
        catch {set font [string trim [exec gsettings get org.gnome.desktop.interface font-name 2> /dev/null] "' "]}
    }
    if {[info exists env(GTK_THEME)]} {
        set dark [string match -nocase *dark* $env(GTK_THEME)]
    }
    set dark [expr {$dark ni {{} 0}}]
    return [list shade [expr {$dark ? "dark" : "light"}] font [if {[regexp {^(.*\S)\s+(\d+)(?:\.\d+)?$} $font -> family size]} {list $family $size}]]
}
proc ::sorma::theme::Words file {
    if {[catch {open $file} channel]} return
    try {
        return [read $channel 100000]
    } finally {
        close $channel
    }
}

# Tk's own fonts: the desktop's, else the first that is installed.
proc ::sorma::theme::Fonts {} {
    variable Families
    lassign [dict get [desktop] font] family size
    set there [font families]
    set family [lindex [lmap name [concat [list $family] $Families] {if {$name ni $there} continue; set name}] 0]
    if {$family eq {}} return
    set size [expr {$size ne {} ? min(16, max(8, $size)) : 10}]
    foreach {font size weight} [list TkDefaultFont $size normal TkTextFont $size normal TkMenuFont $size normal TkHeadingFont $size bold \
            TkCaptionFont [expr {$size + 1}] bold TkSmallCaptionFont [expr {$size - 1}] normal TkTooltipFont [expr {$size - 1}] normal TkIconFont $size normal] {
        font configure $font -family $family -size $size -weight $weight
    }
    font configure TkFixedFont -size $size
}

# Tk's own widgets know no styles: windows and menus that are there, and all that will be.
proc ::sorma::theme::Classic shade {
    set colours [::sorma::colours::of $shade]
    dict with colours {}
    foreach {pattern value} [list \
            *Toplevel.background $ground *Menu.background $surface *Menu.foreground $text *Menu.activeBackground $tint *Menu.activeForeground $text \
            *Menu.disabledForeground $off *Menu.selectColor $accent *Menu.relief flat *Menu.borderWidth [::sorma::style pixels 1] *Menu.activeBorderWidth 0 \
            *Text.background $surface *Text.foreground $text *Text.insertBackground $text *Text.selectBackground $tint *Text.selectForeground $text \
            *Text.inactiveSelectBackground $tint *Text.highlightColor $accent *Text.highlightBackground $line *Text.relief flat \
            *Listbox.background $surface *Listbox.foreground $text *Listbox.selectBackground $tint *Listbox.selectForeground $text \
            *TCombobox*Listbox.relief flat *TCombobox*Listbox.highlightThickness 0 *TCombobox*Listbox.font TkDefaultFont] {
        option add $pattern $value widgetDefault
    }
    Paint . $ground $surface $text $tint
}
proc ::sorma::theme::Paint {window ground surface text tint} {
    switch -- [winfo class $window] {
        Menu { $window configure -background $surface -foreground $text -activebackground $tint -activeforeground $text -relief flat }
        default {
            if {[winfo toplevel $window] eq $window && [llength [$window configure -background]] == 5} {
                $window configure -background $ground
            }
        }
    }
    foreach child [winfo children $window] {
        Paint $child $ground $surface $text $tint
    }
}

# ---- pictures ----

# 17 colours between two.
proc ::sorma::theme::Ramp {from to} {
    variable Ramps
    if {![info exists Ramps($from,$to)]} {
        for {set i 0} {$i <= 16} {incr i} {
            lappend Ramps($from,$to) [::sorma::colours::mix $from $to [expr {$i / 16.0}]]
        }
    }
    return $Ramps($from,$to)
}

# The upper left corner of a round rectangle, row by row: below zero, so many sixteenths of the filling in the edge; else of what is behind it.
proc ::sorma::theme::Corner {radius thick} {
    variable Corners
    if {![info exists Corners($radius,$thick)]} {
        set rows {}
        for {set y 0} {$y < $radius} {incr y} {
            set row {}
            for {set x 0} {$x < $radius} {incr x} {
                set d [expr {hypot($radius - $x - 0.5, $radius - $y - 0.5) - $radius}]         ;# from the outline; outside > 0
                lappend row [expr {round(16 * ($d > -0.5 ? min(1.0, $d + 0.5) : -min(1.0, max(0.0, 0.5 - $d - $thick))))}]
            }
            lappend rows $row
        }
        set Corners($radius,$thick) $rows
    }
    return $Corners($radius,$thick)
}

# A round rectangle: WIDTH by HEIGHT with corners of RADIUS, an edge of so many pixels and a filling; behind it BACK, and nothing outside.
proc ::sorma::theme::Box {width height radius fill edge thick back} {
    set image [image create photo -width $width -height $height]
    $image put $edge -to 0 0 $width $height
    $image put $fill -to $thick $thick [expr {$width - $thick}] [expr {$height - $thick}]
    set inward [Ramp $edge $fill]
    set outward [Ramp $edge $back]
    set corner [Corner $radius $thick]
    set rows [lmap row $corner {lmap part $row {if {$part < 0} {lindex $inward [expr {-$part}]} else {lindex $outward $part}}}]
    set mirrored [lmap row $rows {lreverse $row}]
    set right [expr {$width - $radius}]
    set low [expr {$height - $radius}]
    $image put $rows -to 0 0
    $image put $mirrored -to $right 0
    $image put [lreverse $rows] -to 0 $low
    $image put [lreverse $mirrored] -to $right $low
    set y 0
    foreach row $corner {
        foreach x [lsearch -all -exact $row 16] {
            foreach i [list $x [expr {$width - 1 - $x}]] {
                foreach j [list $y [expr {$height - 1 - $y}]] {
                    $image transparency set $i $j 1
                }
            }
        }
        incr y
    }
    return $image
}

# A picture of nothing, or with a rectangle of a colour in it.
proc ::sorma::theme::Blank {width height {colour {}} args} {
    set image [image create photo -width $width -height $height]
    if {$colour ne {}} {
        $image put $colour -to {*}$args
    }
    return $image
}

# A line through points, in hundredths of SIZE, on a picture that is there or a new one.
proc ::sorma::theme::Stroke {size colour back thick points {image {}}} {
    variable Strokes
    if {$image eq {}} {
        set image [image create photo -width $size -height $size]
    }
    set key $size,$thick,$points
    if {![info exists Strokes($key)]} {
        set Strokes($key) [Covered $size $thick [lmap value $points {expr {$value * $size / 100.0}}]]
    }
    set ramp [Ramp $back $colour]
    foreach {x y part} $Strokes($key) {
        $image put [lindex $ramp $part] -to $x $y
    }
    return $image
}
# The pixels that a line covers: x, y, sixteenths.
proc ::sorma::theme::Covered {size thick points} {
    set covered {}
    for {set y 0} {$y < $size} {incr y} {
        for {set x 0} {$x < $size} {incr x} {
            set near 1e9
            foreach {ax ay} [lrange $points 0 end-2] {bx by} [lrange $points 2 end] {
                set t [expr {(($x + 0.5 - $ax) * ($bx - $ax) + ($y + 0.5 - $ay) * ($by - $ay)) / (($bx - $ax) ** 2 + ($by - $ay) ** 2)}]
                set t [expr {min(1, max(0, $t))}]
                set near [expr {min($near, hypot($x + 0.5 - $ax - $t * ($bx - $ax), $y + 0.5 - $ay - $t * ($by - $ay)))}]
            }
            set part [expr {round(16 * min(1, max(0, $thick / 2.0 - $near + 0.5)))}]
            if {$part > 0} {
                lappend covered $x $y $part
            }
        }
    }
    return $covered
}

# ---- the theme ----

# An element of images: NAME {image state image ...} option value ... -- padding is the style's.
proc ::sorma::theme::Element {name images args} {
    ttk::style element create $name image $images -padding 0 {*}$args
}

proc ::sorma::theme::Make shade {
    variable Colours
    array set Colours [::sorma::colours::of $shade]
    ttk::style theme create sorma-$shade -parent clam -settings {
        Root
        Buttons
        Fields
        Indicators
        Bars
        Containers
        Tables
    }
}

proc ::sorma::theme::Px n {
    return [::sorma::style pixels $n]
}
# How high that is what one clicks or types in: 30, more with a large font.
proc ::sorma::theme::High {} {
    return [expr {max([Px 30], [font metrics TkDefaultFont -linespace] + 2 * [Px 3])}]
}
# The padding that makes a part of a height that high; ASIDE: left and right of it.
proc ::sorma::theme::Padding {aside {part 0}} {
    set room [expr {[High] - max($part, [font metrics TkDefaultFont -linespace])}]
    return [list $aside [expr {$room / 2}] $aside [expr {$room - $room / 2}]]
}

proc ::sorma::theme::Root {} {
    variable Colours
    ttk::style configure . -background $Colours(surface) -foreground $Colours(text) -font TkDefaultFont -bordercolor $Colours(line) \
        -lightcolor $Colours(surface) -darkcolor $Colours(surface) -troughcolor $Colours(line) -fieldbackground $Colours(surface) \
        -selectbackground $Colours(tint) -selectforeground $Colours(text) -insertcolor $Colours(text) -insertwidth [expr {max(1, [Px 1])}] \
        -focuscolor $Colours(accent) -borderwidth 0 -shiftrelief 0
    ttk::style map . -foreground [list disabled $Colours(off)] -background {}
    foreach {style colour} {Quiet.TLabel quiet Unit.TLabel quiet} {
        ttk::style configure $style -foreground $Colours($colour)
    }
    foreach style {Page.TFrame Page.TLabel Page.TCheckbutton Page.Toolbutton Page.Sorma.Vertical.TScrollbar} {
        ttk::style configure $style -background $Colours(ground)
    }
    ttk::style configure Card.TFrame -background $Colours(ground)       ;# seen outside its round corners
    ttk::style configure TSeparator -background $Colours(line)
}

# The pictures of what is pressed: a list for Element. {state fill edge thick} ...; the first is the normal one.
proc ::sorma::theme::Shapes {radius looks {high 0} {wide 0}} {
    variable Colours
    set wide [expr {$wide ? $wide : 2 * $radius + [Px 96]}]          ;# what is wider is tiled; few tiles are soon drawn
    set high [expr {$high ? $high : 2 * $radius + [Px 24]}]
    return [concat {*}[lmap {state fill edge thick} $looks {
        list {*}[if {$state ne {}} {list $state}] [Box $wide $high $radius $Colours($fill) $Colours($edge) [expr {max(1, [Px $thick])}] $Colours(surface)]
    }]]
}

proc ::sorma::theme::Buttons {} {
    variable Colours
    set radius [Px 5]
    set side [list -border [expr {$radius + [Px 1]}] -sticky nsew -width 4 -height 4]
    Element sorma.button [Shapes $radius {{} surface edge 1 disabled surface line 1 pressed tint accent 1 focus surface accent 2 active hover edge 1}] {*}$side
    Element sorma.accent [Shapes $radius {{} accent accent 1 disabled line line 1 pressed press press 1 focus accent text 2 active press press 1}] {*}$side
    set none [Blank [Px 32] [Px 32]]
    Element sorma.tool [list $none disabled $none \
        {*}[Shapes $radius {pressed tint tint 1 selected tint tint 1 focus surface accent 2 active hover hover 1}]] {*}$side
    foreach {style element} {TButton sorma.button Accent.TButton sorma.accent Toolbutton sorma.tool} {
        ttk::style layout $style [list $element -sticky nswe -children {Button.padding -sticky nswe -children {Button.label -sticky nswe}}]
    }
    ttk::style layout TMenubutton {sorma.button -sticky nswe -children {
        sorma.down -side right -sticky {} Menubutton.padding -expand 1 -sticky nswe -children {Menubutton.label -sticky nswe}}}
    foreach style {TButton Accent.TButton TMenubutton} {
        ttk::style configure $style -padding [Padding [Px 12]] -anchor center -width {}
    }
    ttk::style configure Accent.TButton -foreground $Colours(on)
    ttk::style map Accent.TButton -foreground [list disabled $Colours(off)]
    ttk::style configure Toolbutton -padding [list [Px 8] [Px 4]] -anchor center
    ttk::style configure Strong.Toolbutton -font TkHeadingFont
    ttk::style configure Heading.Toolbutton -font TkHeadingFont -anchor w
    ttk::style configure Value.Toolbutton -font [::sorma::style font title] -padding 0
    ttk::style configure Error.Value.Toolbutton -foreground $Colours(error)
    ttk::style configure Link.Toolbutton -foreground $Colours(accent) -padding [list [Px 4] 0]
    foreach style {TButton TMenubutton Toolbutton} {
        ttk::style map $style -background {}
        Filled $style {{} surface disabled surface pressed tint active hover}
    }
    Filled Accent.TButton {{} accent disabled line pressed press active press}
}
# The colour behind the text, for a style with an image as its shape; ttk itself does not use it.
proc ::sorma::theme::Filled {style looks} {
    variable Colours
    ttk::style configure $style -fill $Colours([lindex $looks 1])
    ttk::style map $style -fill [concat {*}[lmap {state colour} [lrange $looks 2 end] {list [split $state ,] $Colours($colour)}]]
}

proc ::sorma::theme::Fields {} {
    variable Colours
    set radius [Px 5]
    Element sorma.field [Shapes $radius {{} surface edge 1 disabled ground line 1 readonly surface edge 1 invalid surface error 2 focus surface accent 2}] \
        -border [expr {$radius + [Px 1]}] -sticky nsew -width 4 -height 4
    # This one has its natural height and three pieces: X is told of each piece by itself, and a panel has many fields.
    Element sorma.line [Shapes $radius {{} surface edge 1 disabled ground line 1 readonly surface edge 1 invalid surface error 2 focus surface accent 2} [High]] \
        -border [list [expr {$radius + [Px 1]}] 0] -sticky ew -width 4
    ttk::style layout Sorma.TEntry {sorma.line -sticky we -children {Entry.padding -sticky nswe -children {Entry.textarea -sticky nswe}}}
    # A combobox that is only chosen from is readonly, and shows its focus all the same.
    Element sorma.box [Shapes $radius {{} surface edge 1 disabled ground line 1 focus surface accent 2 active hover edge 1}] \
        -border [expr {$radius + [Px 1]}] -sticky nsew -width 4 -height 4
    set mark [Px 12]
    foreach {name points} {down {15 35 50 70 85 35} up {15 65 50 30 85 65} right {35 15 70 50 35 85}} {
        set picture($name) [Stroke $mark $Colours(quiet) $Colours(surface) [Px 1.6] $points]
    }
    Element sorma.down [list $picture(down) disabled [Stroke $mark $Colours(off) $Colours(surface) [Px 1.6] {15 35 50 70 85 35}]] -width [Px 24] -sticky {}
    foreach name {up down} {
        Element Spinbox.${name}arrow $picture($name) -width [Px 20] -sticky {}
    }
    set wide [Px 20]
    # Newer ones do not tell images whether an item is open, or has none below it: there clam's own triangles tell.
    if {[package vcompare $::tk_patchLevel 8.6.16] <= 0} {
        Element Treeitem.indicator [list $picture(right) user2 [Blank $mark $mark] user1 $picture(down)] -width $wide -sticky {}
    }
    ttk::style layout TEntry {sorma.field -sticky nswe -children {Entry.padding -sticky nswe -children {Entry.textarea -sticky nswe}}}
    ttk::style layout TCombobox {sorma.box -sticky nswe -children {
        sorma.down -side right -sticky ns Combobox.padding -expand 1 -sticky nswe -children {Combobox.textarea -sticky nswe}}}
    ttk::style layout TSpinbox {sorma.field -sticky nswe -children {
        null -side right -sticky {} -children {Spinbox.uparrow -side top -sticky e Spinbox.downarrow -side bottom -sticky e}
        Spinbox.padding -sticky nswe -children {Spinbox.textarea -sticky nswe}}}
    foreach style {TEntry TCombobox TSpinbox} {
        ttk::style configure $style -padding [Padding [Px 8]] -foreground $Colours(text) -fieldbackground $Colours(surface)
        ttk::style map $style -fieldbackground {} -foreground [list disabled $Colours(off)] \
            -selectbackground {} -selectforeground {} -background {}
    }
    foreach style {TEntry TSpinbox Sorma.TEntry} {
        Filled $style {{} surface disabled ground}
    }
    Filled TCombobox {{} surface disabled ground active hover}
}

# Boxes to tick, and round ones.
proc ::sorma::theme::Indicators {} {
    variable Colours
    set size [Px 18]
    set looks {{} surface edge 1 on,disabled line line 1 disabled surface line 1 on,focus accent text 2 focus surface accent 2 on,pressed press press 1
        on,active press press 1 on accent accent 1 pressed tint accent 1 active hover edge 1}
    foreach {class radius} [list Check [Px 4] Radio [expr {$size / 2}]] {
        set images {}
        foreach {state fill edge thick} $looks {
            set image [Box $size $size $radius $Colours($fill) $Colours($edge) [expr {max(1, [Px $thick])}] $Colours(surface)]
            set state [split $state ,]
            if {[lindex $state 0] eq "on"} {
                set ink $Colours([expr {"disabled" in $state ? "off" : "on"}])
                if {$class eq "Check"} {
                    Stroke $size $ink $Colours($fill) [Px 2] {25 52 43 70 76 33} $image
                } else {
                    Stroke $size $ink $Colours($fill) [Px 7] {50 50 50.1 50} $image
                }
                lset state 0 selected
            }
            lappend images {*}[if {$state ne {}} {list $state}] $image
        }
        Element ${class}button.indicator $images -sticky w -width [expr {$size + [Px 8]}]
        ttk::style layout T${class}button [list ${class}button.padding -sticky nswe -children [list \
            ${class}button.indicator -side left -sticky {} ${class}button.label -side left -sticky nswe]]
        ttk::style configure T${class}button -padding [Padding 0 $size]
        ttk::style map T${class}button -background {} -indicatorcolor {}
    }
}

# Scales, progress and scrollbars.
proc ::sorma::theme::Bars {} {
    variable Colours
    set knob [Px 18]
    set half [expr {$knob / 2}]
    set knobs {}
    foreach {state fill edge thick} {{} accent accent 1 disabled line line 1 pressed press press 1 focus accent text 2 active press press 1} {
        lappend knobs {*}$state [Box $knob $knob $half $Colours($fill) $Colours($edge) [expr {max(1, [Px $thick])}] $Colours(surface)]
    }
    set thick [Px 4]
    set from [expr {($knob - $thick) / 2}]
    set to [expr {$from + $thick}]
    set long [Px 160]
    foreach {direction size part} [list Horizontal [list $long $knob] [list 0 $from $long $to] Vertical [list $knob $long] [list $from 0 $to $long]] {
        Element $direction.Scale.trough [Blank {*}$size $Colours(line) {*}$part] -sticky [expr {$direction eq "Horizontal" ? "ew" : "ns"}]
        Element $direction.Scale.slider $knobs -sticky {}
    }
    # Both are 6 thick, a scrollbar in a trough of 10.
    # ttk draws an image whose borders leave no middle for ever: a border stands only where there is one.
    set thick [Px 6]
    set round [expr {$thick / 2}]
    foreach {direction width height sticky ends} [list Horizontal [Px 24] $thick ew [list $round 0] Vertical $thick [Px 24] ns [list 0 $round]] {
        foreach {element colour} {trough line pbar accent} {
            Element $direction.Progressbar.$element [Box $width $height $round $Colours($colour) $Colours($colour) 1 $Colours(surface)] -border $ends -sticky $sticky
        }
        ttk::style layout $direction.TProgressbar [list $direction.Progressbar.trough -sticky nswe -children [list \
            $direction.Progressbar.pbar -side [expr {$direction eq "Horizontal" ? "left" : "bottom"}] -sticky $sticky]]
        Element $direction.Scrollbar.trough [Blank {*}[if {$direction eq "Horizontal"} {list 4 [Px 10]} else {list [Px 10] 4}]] -sticky nsew
        # Where all can be seen there is nothing to scroll, and no thumb.
        Element $direction.Scrollbar.thumb [concat {*}[lmap {state colour} {{} edge disabled {} pressed accent active text} {
            list {*}$state [if {$colour eq {}} {Blank $width $height} else {Box $width $height $round $Colours($colour) $Colours($colour) 1 $Colours(surface)}]
        }]] -border $ends -sticky $sticky
        ttk::style layout $direction.TScrollbar [list $direction.Scrollbar.trough -sticky nswe -children [list $direction.Scrollbar.thumb -expand 1 -sticky nswe]]
    }
}

proc ::sorma::theme::Containers {} {
    variable Colours
    set radius [Px 8]
    set size [expr {2 * $radius + [Px 300]}]         ;# it is tiled: a panel's card is large
    Element sorma.card [Box $size $size $radius $Colours(surface) $Colours(line) 1 $Colours(ground)] -border [expr {$radius + 1}] -sticky nsew
    ttk::style layout Card.TFrame {sorma.card -sticky nswe}
    ttk::style layout TLabelframe {sorma.card -sticky nswe}
    foreach {style back} {TLabelframe surface Page.TLabelframe ground} {
        ttk::style configure $style -background $Colours($back) -padding [Px 8] -labeloutside 1 -labelmargins [list [Px 4] 0 0 [Px 4]]
        ttk::style configure $style.Label -background $Colours($back) -foreground $Colours(text) -font TkHeadingFont
    }
    # Tabs: the chosen one has a line of the accent below.
    set bar [Px 3]
    set wide [Px 32]
    set tabs {}
    foreach {state colour line} {{} ground ground selected,focus tint accent selected ground accent focus ground accent active hover hover} {
        set image [Blank $wide $wide $Colours($colour) 0 0 $wide $wide]
        $image put $Colours($line) -to 0 [expr {$wide - $bar}] $wide $wide
        lappend tabs {*}[if {$state ne {}} {list [split $state ,]}] $image
    }
    Element sorma.tab $tabs -border [list 0 0 0 $bar] -sticky nsew
    set client [Blank $wide $wide $Colours(surface) 0 0 $wide $wide]
    $client put $Colours(line) -to 0 0 $wide 1
    Element sorma.client $client -border [list 0 1 0 0] -sticky nsew
    ttk::style layout TNotebook {sorma.client -sticky nswe}
    ttk::style layout TNotebook.Tab {sorma.tab -sticky nswe -children {Notebook.padding -side top -sticky nswe -children {Notebook.label -side top -sticky {}}}}
    ttk::style configure TNotebook -background $Colours(ground) -borderwidth 0 -padding [list 0 1 0 0] -tabmargins 0
    ttk::style configure TNotebook.Tab -padding [list [Px 12] [Px 8]] -background $Colours(ground) -foreground $Colours(quiet)
    ttk::style map TNotebook.Tab -foreground [list disabled $Colours(off) selected $Colours(text)] -padding {} -lightcolor {} -bordercolor {} -background {}
    Filled TNotebook.Tab {{} ground selected,focus tint selected ground active hover}
    ttk::style configure TPanedwindow -background $Colours(ground)
    ttk::style configure Sash -sashthickness [Px 8] -gripcount 0 -background $Colours(ground) -lightcolor $Colours(ground) -bordercolor $Colours(ground)
    foreach element {hsash vsash} {
        Element Sash.$element [Blank 4 4 $Colours(ground) 0 0 4 4] -sticky nsew
    }
}

proc ::sorma::theme::Tables {} {
    variable Colours
    Element Treeview.field [Shapes [Px 5] {{} surface line 1 focus surface accent 1} [Px 300] [Px 300]] -border [Px 6] -sticky nsew -width 4 -height 4          ;# it is large
    set wide [Px 32]
    set heading [Blank $wide $wide $Colours(surface) 0 0 $wide $wide]
    $heading put $Colours(line) -to 0 [expr {$wide - 1}] $wide $wide
    Element Treeheading.cell $heading -border [list 0 0 0 1] -sticky nsew
    ttk::style layout Treeview {Treeview.field -sticky nswe -children {Treeview.padding -sticky nswe -children {Treeview.treearea -sticky nswe}}}
    ttk::style layout Treeview.Heading {Treeheading.cell -sticky nswe
        Treeheading.padding -sticky nswe -children {Treeheading.image -side right -sticky {} Treeheading.text -sticky we}}
    ttk::style configure Treeview -padding [Px 4] -background $Colours(surface) -foreground $Colours(text) -fieldbackground $Colours(surface) \
        -rowheight [expr {[font metrics TkDefaultFont -linespace] + [Px 8]}] -indent [Px 16]
    foreach style {Treeview Item} {
        ttk::style configure $style -indicatorsize [Px 10] -indicatormargins [list [Px 4] [Px 2] [Px 6] [Px 2]]         ;# of clam's own
    }
    ttk::style map Treeview -background [list selected $Colours(tint)] -foreground [list disabled $Colours(off) selected $Colours(text)]
    ttk::style configure Treeview.Heading -foreground $Colours(quiet) -font TkSmallCaptionFont -padding [list [Px 4] [Px 6]] -background $Colours(surface)
    ttk::style map Treeview.Heading -background {} -foreground [list disabled $Colours(off) active $Colours(text)]
}
