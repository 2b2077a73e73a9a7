# lamp.tcl -- what is only looked at: sorma::led, a lamp; sorma::meter, a number within its limits; sorma::status, how an object's daemon is.

package require Tk
package require snit
package require sorma::style
package require sorma::subject
package provide sorma::lamp 1.0

# What they have in common: -name of the object, -option, -live ms for what changes by itself.
snit::macro ::sorma::lampParts {{option 1}} {
    hulltype ttk::frame
    option -name -default {} -readonly 1
    option -option -default {} -readonly 1
    option -live -default 500 -readonly 1
    variable subject {}
    variable token {}
    variable needsOption $option

    method Begin {} {
        if {$options(-name) eq {} || ($needsOption && $options(-option) eq {})} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "[$self info type]: -name[expr {$needsOption ? " and -option" : {}}] must say what it shows"
        }
        set subject [::sorma::subject of $options(-name) -live $options(-live)]
        set token [$subject listen [mymethod Told]]
        bind $win <Destroy> +[mymethod Ended %W]
        $self Show
    }
    method Ended window {
        if {$window eq $win && $subject ne {}} {
            $subject unlisten $token
            $subject release
            set subject {}
        }
    }
    method Told args {
        if {$subject ne {} && [winfo exists $win]} {
            $self Show
        }
    }
    method subject {} {
        return $subject
    }
}

# ::sorma::led .w -name SO -option -OPTION ?-good PATTERN? ?-bad PATTERN? ?-text text? -- a lamp that shows the value of an option: green when it
# fits one pattern, red when it fits the other, grey while it is not known or old.
snit::widget ::sorma::led {
    option -good -default {[1-9]*}
    option -bad -default {}
    option -text -default {}
    ::sorma::lampParts
    constructor args {
        $self configurelist $args
        set size [::sorma::style pixels 14]
        canvas $win.lamp -width $size -height $size -highlightthickness 0 -background [ttk::style lookup . -background]
        $win.lamp create oval 2 2 [expr {$size - 2}] [expr {$size - 2}] -tags lamp -outline [::sorma::style colour asking]
        ttk::label $win.text -text $options(-text)
        pack $win.lamp $win.text -side left -padx [list 0 [::sorma::style pixels 4]]
        $self Begin
    }
    # good, bad, off or stale
    method shows {} {
        set told [$subject get $options(-option)]
        if {[dict get $told state] in {asking stale gone refused}} {
            return stale
        }
        set value [dict get $told live]
        return [expr {$options(-bad) ne {} && [string match $options(-bad) $value] ? "bad" : [string match $options(-good) $value] ? "good" : "off"}]
    }
    method Show {} {
        $win.lamp itemconfigure lamp -fill [switch -- [$self shows] {
            good { ::sorma::style colour good }
            bad { ::sorma::style colour refused }
            off { string cat {} }
            stale { ::sorma::style colour asking }
        }]
    }
}

# ::sorma::meter .w -name SO -option -OPTION ?-low n? ?-high n? ?-warn {LOW HIGH}? ?-alarm {LOW HIGH}? ?-format f? --
#       A number as a bar between low and high (default: the range of the option, else 0 and 1), and in digits with its unit. Outside of
#       -warn it is yellow, outside of -alarm red, with a mark; empty limits are none.
snit::widget ::sorma::meter {
    ::sorma::lampParts
    option -low -default {}
    option -high -default {}
    option -warn -default {}
    option -alarm -default {}
    option -format -default %.6g
    option -length -default 160 -readonly 1
    constructor args {
        $self configurelist $args
        set height [::sorma::style pixels 14]
        canvas $win.bar -width [::sorma::style pixels $options(-length)] -height $height -highlightthickness 1 \
            -highlightbackground [::sorma::style colour asking] -background [ttk::style lookup TEntry -fieldbackground {} white]
        $win.bar create rectangle 0 0 0 $height -width 0 -tags level
        ttk::label $win.mark -width 2 -anchor center
        ttk::label $win.digits -width 12 -anchor e
        pack $win.bar -side left -fill x -expand 1
        pack $win.mark $win.digits -side left
        bind $win.bar <Configure> [mymethod Told]
        $self Begin
    }
    # Of a number: alarm, warn or live.
    method Zone value {
        foreach {limits zone} [list $options(-alarm) alarm $options(-warn) warn] {
            lassign $limits low high
            if {($low ne {} && $value < $low) || ($high ne {} && $value > $high)} {
                return $zone
            }
        }
        return live
    }
    # shows -- {STATE VALUE}: alarm, warn, live, or what the option's state is when it is not that of now.
    method shows {} {
        set told [$subject get $options(-option)]
        set value [dict get $told live]
        if {[dict get $told state] in {asking stale gone refused} || ![string is double -strict $value]} {
            return [list [expr {[dict get $told state] eq "live" ? "asking" : [dict get $told state]}] $value]
        }
        return [list [$self Zone $value] $value]
    }
    method Show {} {
        if {![winfo exists $win.digits]} return
        lassign [$self shows] state value
        set low $options(-low)
        set high $options(-high)
        set unit {}
        if {[$subject table] ne {} && ![catch {$subject option $options(-option)} facts]} {
            set unit [dict get $facts unit]
            if {[regexp {^(\S+) \.\. (\S+)$} [dict get $facts range] -> least most]} {
                set low [expr {$low eq {} ? $least : $low}]
                set high [expr {$high eq {} ? $most : $high}]
            }
        }
        set low [expr {$low eq {} ? 0.0 : $low}]
        set high [expr {$high eq {} ? $low + 1.0 : $high}]
        set part [expr {[string is double -strict $value] && $value == $value && $high > $low ? max(0.0, min(1.0, ($value - $low) / double($high - $low))) : 0}]
        $win.bar coords level 0 0 [expr {$part * [winfo width $win.bar]}] [winfo height $win.bar]
        $win.bar itemconfigure level -fill [::sorma::style colour [expr {$state eq "live" ? "good" : $state}]]
        $win.mark configure -text [::sorma::style mark $state] -foreground [::sorma::style colour $state]
        $win.digits configure -text [string trimright "[expr {[string is double -strict $value] ? [format $options(-format) $value] : $value}] $unit"]
    }
}

# ::sorma::status .w -name SO -- a line that says how the daemon of an object is, and why when it does not answer.
snit::widget ::sorma::status {
    ::sorma::lampParts 0
    constructor args {
        $self configurelist $args
        ttk::label $win.text -width 20 -anchor w
        pack $win.text -side left -fill x -expand 1
        bind $win.text <Configure> {%W configure -wraplength %w}        ;# however long the reason is, the window stays
        $self Begin
    }
    # shows -- its state, as sorma::world gives it.
    method shows {} {
        return [dict get [$subject state] state]
    }
    method Show {} {
        set state [$subject state]
        set how [dict get $state state]
        set known [expr {$how in {alive busy} ? "good" : $how eq "asking" ? "asking" : "stale"}]
        $win.text configure -foreground [::sorma::style colour $known] \
            -text "[::sorma::style mark $known] $how[if {[dict get $state why] ne {}} {string cat {: } [dict get $state why]}]"
    }
}
