# lamp.tcl -- widgets that are only looked at. Each has -state: while it is disabled, it is grey.
#
#     sorma::led          a lamp
#     sorma::meter        a number within its limits
#     sorma::reading      what an object answers
#     sorma::status       how an object's daemon is

package require sorma::disc
package require sorma::parts
package provide sorma::lamp 1.0

# ::sorma::led .w -name SO -option -OPTION ?-good PATTERN? ?-bad PATTERN? ?-text text? ?-size pixels? --
#
# A lamp shows the value of an option:
#       green               it fits the pattern -good
#       red                 it fits the pattern -bad
#       yellow or red       it is outside of the limits of the class
#       grey                it is not known, or old
# If an option has limits, a value within them is good, unless a pattern says else.
snit::widget ::sorma::led {
    option -good -default {} -configuremethod SetLook
    option -bad -default {} -configuremethod SetLook
    option -text -default {} -configuremethod SetLook
    option -size -default 14 -configuremethod SetSize
    ::sorma::lampParts {-name -option} 500
    constructor args {
        $self configurelist $args
        set size [::sorma::style pixels $options(-size)]
        ttk::label $win.lamp -image [::sorma::disc of $size {} [::sorma::style colour asking]] -padding 0
        ttk::label $win.text
        ttk::label $win.age -width 8 -font [::sorma::style font small]
        pack $win.lamp $win.text $win.age -side left -padx [list 0 [::sorma::style pixels 4]]
        $self Begin
        $self Enable
    }
    method Build {} {}
    method SetSize {option value} {
        set options($option) $value
        if {[winfo exists $win.lamp] && $subject ne {}} {
            $self Show
        }
    }
    # good, warn, bad, off or stale
    method shows {} {
        set state [dict get [::sorma::shown::led [array get options] [$self Known]] state]
        return [expr {$facts ne {} && $state in {good warn bad off} ? $state : "stale"}]
    }
    method Show {} {
        set shown [$self shows]
        set edge [$self Shade [dict get {good good warn warn bad refused stale asking off asking} $shown]]
        $win.lamp configure -image [::sorma::disc of [::sorma::style pixels $options(-size)] [if {$shown ne "off"} {set edge}] $edge]
        $win.text configure -text $options(-text)
        $self ShowAge $win.age [$subject get $options(-option)]
    }
}

# ::sorma::meter .w -name SO -option -OPTION ?-low n? ?-high n? ?-warn {LOW HIGH}? ?-alarm {LOW HIGH}? ?-format f? --
#
# A number as a bar, and in digits with its unit.
#       -low, -high     ends of the bar; default: the range of the option, else 0 and 1
#       -warn           outside of it the number is yellow, with a mark; default: what the class says
#       -alarm          outside of it the number is red, with a mark; default: what the class says
# An empty limit is none.
snit::widget ::sorma::meter {
    ::sorma::lampParts {-name -option} 500
    option -low -default {} -configuremethod SetLook
    option -high -default {} -configuremethod SetLook
    option -warn -default {} -configuremethod SetLook
    option -alarm -default {} -configuremethod SetLook
    option -format -default %.6g -configuremethod SetLook
    option -length -default 160 -readonly 1
    constructor args {
        $self configurelist $args
        set height [::sorma::style pixels 14]
        canvas $win.bar -width [::sorma::style pixels $options(-length)] -height $height -highlightthickness 0 \
            -background [::sorma::style token line]
        $win.bar create rectangle 0 0 0 $height -width 0 -tags level
        ttk::label $win.mark -width 2 -anchor center
        ttk::label $win.age -width 8 -font [::sorma::style font small]
        ttk::label $win.digits -width 9 -anchor w
        pack $win.bar -side left -fill x -expand 1
        pack $win.mark -side left -padx [::sorma::style pixels 4]
        pack $win.digits $win.age -side left
        bind $win.bar <Configure> [mymethod Told state {}]
        $self Begin
        $self Enable
    }
    method Build {} {}
    # shows -- {STATE VALUE}: alarm, warn, live, or what the option's state is when it is not that of now.
    method shows {} {
        set told [$self Known]
        return [list [dict get [::sorma::shown::meter [array get options] $told] state] [dict get $told value]]
    }
    method Show {} {
        set shown [::sorma::shown::meter [array get options] [$self Known]]
        dict with shown {}
        $self ShowAge $win.age [$subject get $options(-option)]
        $win.bar configure -background [::sorma::style token line]
        $win.bar coords level 0 0 [expr {$part * [winfo width $win.bar]}] [winfo height $win.bar]
        $win.bar itemconfigure level -fill [$self Shade [expr {$state eq "live" ? "good" : $state}]]
        $win.mark configure -text [::sorma::style mark $state] -foreground [$self Shade $state]
        $win.digits configure -text [string trimright "$text $unit"]
    }
}

# ::sorma::reading .w -name SO ?-request {EXEC ...}? ?-part P? ?-index N? ?-unit U? ?-every MS? --
#
# It asks an object again and again, and shows a part of the reply, or the first part that is not empty. If that has numbers, it shows all of them
# or one, counted from 0.
snit::widget ::sorma::reading {
    ::sorma::lampParts -name 0
    option -request -default EXEC -readonly 1
    option -part -default {} -configuremethod SetLook -type {snit::enum -values {{} floats ints words text code}}
    option -index -default {} -configuremethod SetLook
    option -unit -default {} -configuremethod SetLook
    option -every -default 1000 -readonly 1
    variable told {value {} state asking why {} age {}}
    variable token {}
    constructor args {
        $self configurelist $args
        ttk::label $win.text -anchor w
        ttk::label $win.mark -width 2
        ttk::label $win.age -width 8 -font [::sorma::style font small]
        pack $win.text $win.mark $win.age -side left
        $self Begin
        $self Enable
        set token [$subject value $options(-request) $options(-every) [list ::sorma::parts::answer [mymethod Valued]]]
    }
    destructor {
        ::sorma::world unwatch $token
    }
    method Build {} {}
    method Valued {what object values} {
        set told [lindex [dict values $values] 0]
        $self Show
    }
    # shows -- {STATE TEXT}
    method shows {} {
        set shown [::sorma::shown::reading [array get options] $told]
        return [lmap key {state text} {dict get $shown $key}]
    }
    method Show {} {
        lassign [$self shows] state text
        $self ShowAge $win.age $told
        $win.mark configure -text [::sorma::style mark $state] -foreground [$self Shade $state]
        $win.text configure -text [if {$text eq {}} {dict get $told why} else {set text}]
    }
}

# ::sorma::status .w -name SO ?-brief 0|1? -- the state of an object's daemon, with what it is busy in, or why it does not answer. -brief: its
# state alone.
snit::widget ::sorma::status {
    ::sorma::lampParts -name 0
    option -brief -default 0 -readonly 1 -type snit::boolean
    constructor args {
        $self configurelist $args
        ttk::label $win.text -width [expr {$options(-brief) ? 12 : 20}] -anchor w
        pack $win.text -side left -fill x -expand 1
        if {!$options(-brief)} {
            bind $win.text <Configure> {%W configure -wraplength %w}    ;# however long the reason is, the window stays
        }
        $self Begin
        $self Enable
    }
    method Build {} {}
    # shows -- its state, as sorma::world gives it.
    method shows {} {
        return [dict get [$subject state] state]
    }
    method Show {} {
        set shown [::sorma::shown::status {} [$subject state]]
        dict with shown {
            $win.text configure -foreground [$self Shade $state] -text "[::sorma::style mark $state] $text[if {!$options(-brief) && $why ne {}} {string cat {: } $why}]"
        }
    }
}
