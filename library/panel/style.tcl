# style.tcl -- how panels look: colours, fonts and sizes, from the ttk theme that is there and the display's dots per inch.
# The colours stand in colours.tcl.

package require Tk
package require msgcat
package require sorma::colours
package provide sorma::style 1.0

namespace eval ::sorma::style {
    namespace export pixels mark colour token shade series font step tag untag tip menu bindWheel own text
    namespace ensemble create
    variable Bound 0            ;# is there a binding that follows the theme
    variable Made {}            ;# dict: name of a font of ours -> what it was made of
    variable Rest {}            ;# {canvas delta}: of the wheel that was turned last, what has not scrolled yet
}

# ::sorma::style::pixels N -- so many pixels at 96 dots per inch, as many as look alike here.
proc ::sorma::style::pixels n {
    if {[info exists ::tk::scalingPct]} {
        return [expr {round($n * $::tk::scalingPct / 100.0)}]           ;# Tk 9
    }
    return [expr {round($n * [tk scaling] * 72 / 96.0)}]
}

# ::sorma::style::mark STATE, colour STATE -- colour: empty for that of the theme.
proc ::sorma::style::mark state {
    return [lindex [dict get [::sorma::colours::states] $state] 0]
}
proc ::sorma::style::colour state {
    set token [lindex [dict get [::sorma::colours::states] $state] 1]
    return [if {$token ne {}} {token $token}]
}

# ::sorma::style::token TOKEN -- a colour of colours.tcl, as the theme's background needs it.
proc ::sorma::style::token token {
    return [::sorma::colours::one $token [shade]]
}

# ::sorma::style::series N -- the colour of the N-th of several lines, from 0.
proc ::sorma::style::series n {
    set series [::sorma::colours::series [shade]]
    return [lindex $series [expr {$n % [llength $series]}]]
}

# ::sorma::style::shade -- light or dark, as the theme's background is.
proc ::sorma::style::shade {} {
    set background [ttk::style lookup . -background]
    lassign [winfo rgb . [expr {$background ne {} ? $background : "#d9d9d9"}]] r g b
    return [expr {0.3 * $r + 0.6 * $g + 0.1 * $b < 0x7000 ? "dark" : "light"}]
}

# ::sorma::style::font KIND -- plain, strong, title, small, fixed or fixedStrong: names of Tk's own fonts. The strong ones are made of these at first
# use, and follow when these change.
proc ::sorma::style::font kind {
    set own [dict get {
        plain TkDefaultFont strong TkDefaultFont title TkDefaultFont small TkSmallCaptionFont fixed TkFixedFont fixedStrong TkFixedFont
    } $kind]
    if {$kind ni {strong title fixedStrong}} {
        return $own
    }
    set name sorma-$kind
    if {$name ni [::font names]} {
        ::font create $name
        bind all <<TkWorldChanged>> +[list ::sorma::style::Strong $name $own]       ;# which comes to those that show a font that has changed
        Strong $name $own
    }
    return $name
}
proc ::sorma::style::Strong {name own} {
    variable Made
    set is [dict replace [::font actual $own] -weight bold]
    if {$name eq "sorma-title"} {
        dict set is -size [expr {round(1.4 * [dict get $is -size])}]
    }
    if {![dict exists $Made $name] || [dict get $Made $name] ne $is} {              ;# this is a change, too
        dict set Made $name $is
        ::font configure $name {*}$is
    }
}

# ::sorma::style::text WINDOW TAGS ?option value ...? -- a text widget of fixed font, without a frame. It has the colours of entries in the theme, and
# follows when there is another theme. TAGS: a list of tag and state; a tag has the colour of its state. Returns the window.
proc ::sorma::style::text {window tags args} {
    ::text $window -font [font fixed] -relief flat -borderwidth 0 -highlightthickness 0 {*}$args
    Paint $window $tags
    foreach event {<<ThemeChanged>> <Map>} {            ;# events do not come to a window before it is seen
        bind $window $event [list ::sorma::style::Paint $window $tags]
    }
    return $window
}
proc ::sorma::style::Paint {window tags} {
    foreach {name option default} {
        ground -fieldbackground white  ink -foreground black  selected -selectbackground #c3c3c3  over -selectforeground black
    } {
        set $name [ttk::style lookup TEntry $option {} $default]
    }
    $window configure -background $ground -foreground $ink -insertbackground $ink -selectbackground $selected -selectforeground $over \
        -inactiveselectbackground $selected -highlightcolor [token accent] -highlightbackground [token edge]
    foreach {tag state} $tags {
        $window tag configure $tag -foreground [colour $state]
    }
}

# ::sorma::style::step RANGE -- between two lines of a scale: 1, 2 or 5 times a power of ten, so that there are two to five of them.
proc ::sorma::style::step range {
    set power [expr {10.0 ** floor(log10($range))}]
    foreach factor {0.2 0.5 1 2} {
        if {$range / ($factor * $power) <= 5} {
            return [expr {$factor * $power}]
        }
    }
}

# ::sorma::style::tip WINDOW TEXT -- shown when the pointer rests there, if tklib is installed. A tip is handed to tklib when the pointer comes
# for the first time. Otherwise it would take a fifth of the time in which a panel opens.
proc ::sorma::style::tip {window text} {
    if {$text ne {}} {
        bind $window <Enter> [list ::sorma::style::Tip $window [string map {% %%} $text]]
    }
}
proc ::sorma::style::Tip {window text} {
    variable Tips
    bind $window <Enter> {}
    if {![info exists Tips]} {
        set Tips [expr {![catch {package require tooltip}]}]
    }
    if {!$Tips} return
    if {[string length $text] > 600} {
        set text [string range $text 0 600]\u2026
    }
    set text [string trim [regsub -all -line {(.{1,70})(?:\s+|$)} $text "\\1\n"]]
    ::tooltip::tooltip $window [expr {[string index $text 0] eq "-" ? " $text" : $text}]        ;# an option it would be, else
    after idle [list ::sorma::style::Entered $window]
}
proc ::sorma::style::Entered window {
    if {[winfo exists $window]} {
        event generate $window <Enter>
    }
}

# ::sorma::style::menu TAG TOP FILL -- the context menu for windows with a tag of bindings. FILL is called with the menu, TOP.menu, and the window
# below the pointer, or with the focus; what it leaves empty is not shown.
proc ::sorma::style::menu {tag top fill} {
    # The pointer may be anywhere when a key is pressed.
    foreach {event place} {<<ContextMenu>> {%X %Y} <Key-Menu> {0 0} <Shift-F10> {0 0}} {
        bind $tag $event "[list ::sorma::style::Popup $top $fill] %W $place; break"
    }
}
proc ::sorma::style::Popup {top fill window x y} {
    destroy $top.menu
    ::menu $top.menu -tearoff 0
    {*}$fill $top.menu $window
    if {[$top.menu index end] in {none {}}} return
    if {$x eq "??" || $x <= 0} {                ;# a key has opened it
        set x [expr {[winfo rootx $window] + 5}]
        set y [expr {[winfo rooty $window] + min([winfo height $window], [pixels 40])}]
    }
    tk_popup $top.menu $x $y
}

# ::sorma::style::bindWheel WINDOW CANVAS -- the wheel scrolls the canvas, wherever the pointer is within the window; it never changes a
# value.
proc ::sorma::style::bindWheel {window canvas} {
    set tag SormaWheel$canvas
    bind $tag <MouseWheel> "[list ::sorma::style::Wheel $canvas] %D; break"
    if {![package vsatisfies [package provide Tk] 8.7-]} {
        bind $tag <Button-4> "[list ::sorma::style::Wheel $canvas] 120; break"
        bind $tag <Button-5> "[list ::sorma::style::Wheel $canvas] -120; break"
    }
    tag $window $tag
}
# A notch of a wheel is 120, three units. Wheels without notches send small parts of it: what makes no unit yet is kept for the next one.
proc ::sorma::style::Wheel {canvas delta} {
    variable Rest
    if {[lindex $Rest 0] ne $canvas} {
        set Rest [list $canvas 0]
    }
    set sum [expr {[lindex $Rest 1] + $delta}]
    set units [expr {int($sum / 40.0)}]
    set Rest [list $canvas [expr {$sum - 40 * $units}]]
    $canvas yview scroll [expr {-$units}] units
}

# ::sorma::style::tag WINDOW TAG -- a tag of bindings for a window and all in it.
proc ::sorma::style::tag {window tag} {
    set tags [bindtags $window]
    if {$tag ni $tags} {
        bindtags $window [linsert $tags 0 $tag]
    }
    foreach child [winfo children $window] {
        tag $child $tag
    }
}

# ::sorma::style::untag TAG ... -- these are bound to nothing any more: tags outlive their windows.
proc ::sorma::style::untag args {
    foreach tag $args {
        foreach event [bind $tag] {
            bind $tag $event {}
        }
    }
}

# ::sorma::style::own CLASS -- a style of ours that widgets of a class take, so that those of the program around us stay as they are.
# CLASS is Treeview, TCheckbutton, TRadiobutton, TCombobox, Vertical.TScrollbar or Horizontal.TScrollbar.
proc ::sorma::style::own class {
    variable Bound
    if {!$Bound} {
        set Bound 1
        bind . <<ThemeChanged>> {+::sorma::style::Fit}
        bind all <<TkWorldChanged>> {+::sorma::style::Fit}
    }
    Fit
    return Sorma.$class
}
# A theme says how high a row is in pixels, whatever the font. Themes that draw marks and arrows themselves make them as large as on a display
# of 96 dots per inch; Tk 9 knows better, and so does awthemes where tksvg is installed.
proc ::sorma::style::Fit {} {
    set theme [ttk::style theme use]
    Set Treeview -rowheight [expr {[::font metrics TkDefaultFont -linespace] + [pixels [expr {[string match sorma-* $theme] ? 8 : 3}]]}]
    if {[info exists ::tk::scalingPct] || [pixels 100] < 125} return
    if {$theme ni {alt clam classic default} && !([string match aw* $theme] && [package provide tksvg] eq {})} return
    foreach {class option size} {
        TCheckbutton -indicatorsize 10 TRadiobutton -indicatorsize 10 TCombobox -arrowsize 12 Vertical.TScrollbar -arrowsize 12
        Horizontal.TScrollbar -arrowsize 12
    } {
        Set $class $option [pixels $size]
    }
}
# A value is not set twice: each setting sends <<ThemeChanged>> to all windows, and so leads here.
proc ::sorma::style::Set {class option value} {
    if {[ttk::style lookup Sorma.$class $option] ne $value} {
        ttk::style configure Sorma.$class $option $value
    }
}
