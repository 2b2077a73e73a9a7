# display.tcl -- sorma::display: one value, as large as its window has room for, to be read from far away.

package require sorma::parts
package provide sorma::display 1.0

# ::sorma::display .w -name SO -option -OPTION ?-index n? ?-format f? -- the value of an option with its unit; of a vector one element. Outside of
# the limits of the class it has their colour and mark; one that is old is grey, and its age stands below.
snit::widget ::sorma::display {
    ::sorma::lampParts {-name -option} 500
    option -index -default {} -configuremethod SetLook
    option -format -default %.6g -configuremethod SetLook
    component canvas
    constructor args {
        $self configurelist $args
        install canvas using canvas $win.canvas -width 1 -height 1 -highlightthickness 0 -background [ttk::style lookup . -background]
        pack $canvas -fill both -expand 1
        bind $canvas <Configure> [mymethod Told state {}]
        ::font create $win.digits
        ::font create $win.unit
        $self Begin
        $self Enable
    }
    destructor {
        catch {::font delete $win.digits $win.unit}
    }
    method Build {} {}
    # shows -- {STATE TEXT UNIT}
    method shows {} {
        set shown [::sorma::shown::display [array get options] [$self Known]]
        return [lmap key {state text unit} {dict get $shown $key}]
    }
    method Show {} {
        if {$canvas eq {}} return
        lassign [$self shows] state text unit
        set mark [::sorma::style mark $state]
        set below [$self Below $text]
        set width [winfo width $canvas]
        set height [winfo height $canvas]
        $canvas delete all
        $canvas configure -background [ttk::style lookup . -background]
        if {$width < 10 || $height < 10} return
        # The size is for a few digits at least, so that it rests while they change.
        set space [$self Fit $text $unit $mark 0.9 $width $height $below]
        set colour [expr {$state eq "live" ? [ttk::style lookup . -foreground] : [$self Shade $state]}]
        set x [expr {($width - $space) / 2}]
        set middle [expr {$height * ($below eq {} ? 0.5 : 0.42)}]
        set base [expr {$middle + ([::font metrics $win.digits -ascent] - [::font metrics $win.digits -descent]) / 2.0}]
        foreach {word font shade} [list $mark unit $colour $text digits $colour $unit unit [::sorma::style token quiet]] {
            if {$word eq {}} continue
            $canvas create text $x [expr {$base + [::font metrics $win.$font -descent]}] -anchor sw -text $word -font $win.$font -fill $shade -tags $font
            set x [expr {$x + [::font measure $win.$font "$word "]}]
        }
        if {$below ne {}} {
            $canvas create text [expr {$width / 2}] $height -anchor s -text $below -font [::sorma::style font small] -fill [$self Shade stale] \
                -width $width -justify center -tags below
        }
    }
    # How old it is, or why there is none.
    method Below text {
        set told [$subject get $options(-option)]
        return [if {$text eq {} && [dict get $told why] ne {}} {dict get $told why} else {dict get $told age}]
    }
    # Make the fonts as large as there is room for; returns how wide all is.
    method Fit {text unit mark part width height below} {
        set family [::font actual TkDefaultFont -family]
        set high [expr {$height - ($below ne {} ? [::font metrics [::sorma::style font small] -linespace] : 0)}]
        $self Size $family 100
        set least [::font measure $win.digits [string repeat 0 [expr {max(4, [string length $text])}]]]
        set wide [expr {max($least, [::font measure $win.digits $text]) + [$self Aside $unit $mark]}]
        set size [expr {min($part * 100.0 * $width / $wide, 100.0 * $high / [::font metrics $win.digits -linespace])}]
        $self Size $family [expr {max(8, int($size))}]
        return [expr {[::font measure $win.digits $text] + [$self Aside $unit $mark]}]
    }
    method Aside {unit mark} {
        return [tcl::mathop::+ {*}[lmap word [list $unit $mark] {expr {$word eq {} ? 0 : [::font measure $win.unit "$word "]}}]]
    }
    method Size {family size} {
        ::font configure $win.digits -family $family -size -$size -weight bold
        ::font configure $win.unit -family $family -size [expr {-max(8, $size * 45 / 100)}] -weight normal
    }
}
