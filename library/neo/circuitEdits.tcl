# circuitEdits.tcl -- ::sorma::circuitEdits: what changes a circuit in its editor, by program, mouse and keys.
#
# Each edit makes new texts of the options, and sends those that differ in one CTRL: all or nothing, between two ticks. If the circuit
# refuses it, as an input without a source, it stays in the picture as a draft. The reason stands at the top, and the next edit is sent with it.
# Undo sends the texts from before, unless somebody else has changed them meanwhile: nobody's edit is lost.

package require snit
package require sorma::circuitLayout
package require sorma::circuitText
package require sorma::subject
package require sorma::table
package require sorma::window
package provide sorma::circuitEdits 1.0

snit::macro ::sorma::circuitEdits {} {
    variable edits {}           ;# list of {name before after}; before and after: dicts of the options that differ
    variable done 0             ;# so many of them are done; those behind were undone
    variable wanted {}          ;# dict: option -> text that the circuit has not taken yet
    variable based {}           ;# dict: option -> text of the circuit that this is an edit of
    variable lastSent {}        ;# dict: option -> text that was sent last
    variable unsent 0           ;# is some of that still to be sent
    variable askedPins {}       ;# dict: name of a unit -> 1, while its pins are asked for
    variable chosenKeys {}     ;# of the boxes that are selected
    variable chosenWires {}    ;# of the wires that are selected
    variable pointed {{} 0 0}   ;# {TEXT X Y}: what was said of this pixel, when the pointer was there
    variable drag {}            ;# dict: kind (move, wire, band, pan or class), x, y: where it began; and what that kind needs

    # ---- what changes it ----

    # Take CHANGES, a dict option -> text, as one step of the history, and send them. GONE: keys of boxes that it removes.
    method Edit {name changes {gone {}}} {
        set before {}
        dict for {option text} $changes {
            if {$text ne [dict get $recipe $option]} {
                dict set before $option [dict get $recipe $option]
            }
        }
        if {$before eq {} || ![$self Editable $name]} return
        # Nothing else moves because of an edit: from now on each box has its place.
        set text [if {[dict exists $changes -places]} {dict get $changes -places} else {dict get $recipe -places}]
        set fixed [::sorma::circuitText places $text]
        set rest [dict filter $places script {key -} {expr {![dict exists $fixed $key] && $key ni $gone}}]
        dict set before -places [dict get $recipe -places]
        dict set changes -places [::sorma::circuitText place $text $rest]
        set after [dict filter $changes script {option -} {dict exists $before $option}]
        set edits [concat [lrange $edits 0 $done-1] [list [list $name $before $after]]]
        incr done
        $self Send $after
    }
    # May it be changed, also by objects that an edit makes? The line below says why not.
    method Editable name {
        if {$options(-state) eq "normal" && ![$self known]} {
            set hint "[::sorma::style mark refused] $name: the circuit is not known yet"
        }
        return [expr {$options(-state) eq "normal" && [$self known]}]
    }
    # Is the recipe known? Else an edit would write over what nobody has seen.
    method known {} {
        foreach option $::sorma::circuitText::options {
            set told [$subject get $option]
            set state [dict get $told state]
            set seen [expr {$option in [$subject edited] || [dict get $told live] ne {} || [dict get $told seen] > 0}]
            if {$state in {asking gone} || $state in {stale refused} && !$seen} {
                return 0
            }
        }
        return 1
    }
    method Send changes {
        dict for {option -} $changes {
            if {[dict exists $wanted $option]} continue
            dict set based $option [dict get $recipe $option]
            dict unset lastSent $option
        }
        set wanted [dict merge $wanted $changes]
        set unsent 1
        $self Refresh
    }
    # Is that text of ours still what shall be? If not, the circuit has taken it, or somebody has reverted it.
    method Wants option {
        if {[dict exists $wanted $option] && !$unsent && $option ni [$subject edited] && [dict get [$subject get $option] state] ne "sending"} {
            dict unset wanted $option
        }
        return [dict exists $wanted $option]
    }
    # Send what was not sent yet, all that was edited meanwhile together: one request at a time.
    method Sent {} {
        if {$unsent && "sending" ni [lmap option $::sorma::circuitText::options {dict get [$subject get $option] state}]} {
            set unsent 0
            dict for {option text} $wanted {
                if {[dict exists $lastSent $option] && $option ni [$subject edited]} {
                    dict set based $option [dict get $lastSent $option]
                }
                dict set lastSent $option $text
                $subject edit $option $text
            }
            # Nobody else's edit is lost: it may have come when ours was on its way.
            $subject applyIf $based {*}[if {$wanted ne {}} {dict keys $wanted} else {list -wires}]
        }
        foreach {name can} [list undo [expr {$done > 0}] redo [expr {$done < [llength $edits]}] revert [expr {[$self drafts] ne {}}]] {
            if {[winfo exists $win.head.tools.$name]} {
                $win.head.tools.$name state [expr {$can ? "!disabled" : "disabled"}]
            }
        }
    }
    # Options whose text the circuit has not taken.
    method drafts {} {
        return [lmap option $::sorma::circuitText::options {if {![$self Wants $option] && $option ni [$subject edited]} continue; set option}]
    }
    # Are there no edits that wait to be sent, or for their answer?
    method sent {} {
        return [expr {!$unsent && "sending" ni [lmap option $::sorma::circuitText::options {dict get [$subject get $option] state}]}]
    }
    method undo {} {
        if {$done > 0 && [$self Step undo [lindex $edits $done-1] 2 1]} {
            incr done -1
        }
        $self Sent
    }
    method redo {} {
        if {$done < [llength $edits] && [$self Step redo [lindex $edits $done] 1 2]} {
            incr done
        }
        $self Sent
    }
    # From one side of an edit to the other, if the circuit is still as that edit knew it.
    method Step {what edit from to} {
        set changed [lmap {option text} [lindex $edit $from] {if {[dict get $recipe $option] eq $text} continue; set option}]
        if {$changed ne {}} {
            set hint "[::sorma::style mark theirs] [lindex $edit 0]: no $what, since [join $changed { and }] changed meanwhile"
            return 0
        }
        $self Send [lindex $edit $to]
        set hint "$what: [lindex $edit 0]"
        return 1
    }
    # Forget what the circuit has not taken. Undo brings it back as a draft.
    method revert {} {
        set drafts [$self drafts]
        if {$drafts ne {}} {
            set edits [concat [lrange $edits 0 $done-1] [list [list revert {*}[lmap texts [list $recipe $running] {
                dict filter $texts script {option -} {expr {$option in $drafts}}
            }]]]]
            incr done
            set wanted {}
            set unsent 0
            $subject revert {*}$drafts
        }
        $self Refresh
    }
    method history {} {
        return [lmap edit [lrange $edits 0 $done-1] {lindex $edit 0}]
    }
    # return COUNT -- undo or redo, until so many edits are done; it ends early at one that is refused.
    method return count {
        set count [expr {max(0, min($count, [llength $edits]))}]
        while {$done != $count} {
            set before $done
            $self [expr {$done > $count ? "undo" : "redo"}]
            if {$done == $before} break
        }
    }
    # All edits in a menu, the newest first; those that were undone have no mark.
    method Listed menu {
        $menu delete 0 end
        for {set n [llength $edits]} {$n >= 0} {incr n -1} {
            set name [if {$n == 0} {::msgcat::mc "as it was opened"} else {lindex $edits $n-1 0}]
            $menu add command -label "[expr {$n == $done ? "\u2713" : "\u2007"}] [::sorma::text::clean $name]" -command [mymethod return $n]
        }
    }

    # connect SOURCE SINK ?PLACES? -- a wire between two ends, as text. PLACES: of boxes that come with it.
    method connect {source sink {fresh {}}} {
        set why [$self Misfit {*}[::sorma::circuitText wire "$source -> $sink"]]
        if {$why ne {}} {
            return -code error -errorcode {SORMA CIRCUIT MISFIT} "$source -> $sink: $why"
        }
        $self Edit "wire $source -> $sink" [dict create -wires [::sorma::circuitText add [dict get $recipe -wires] $source $sink] \
            -places [::sorma::circuitText place [dict get $recipe -places] $fresh]]
    }
    # drop CLASS X Y -- a new unit, its corner at this place of the grid; CLASS@PLACE: a service elsewhere. Returns its name.
    method drop {class x y} {
        regexp {^([^@]*)(@.*)?$} $class -> class where
        set name [$self FreeName $class $where]
        if {![$self Editable "add $name"]} return
        $self AskPins $name 1
        $self Edit "add $name" [dict create -places [::sorma::circuitText place [dict get $recipe -places] [list [list unit $name] [list [expr {round($x)}] [expr {round($y)}]]]]]
        return $name
    }
    # delete KEYS NUMBERS -- boxes with their wires, and wires.
    method delete {gone wires} {
        set n -1
        foreach wire [dict get $graph wires] {
            incr n
            lassign [$self Ends $wire] - from to
            if {$from in $gone || $to in $gone} {
                lappend wires $n
            }
        }
        set name [expr {$gone ne {} ? "delete [Named $gone]" : "delete [::sorma::text::counted [llength $wires] wire wires]"}]
        set changes [dict create -wires [::sorma::circuitText remove [dict get $recipe -wires] $wires]]
        foreach option {-inputs -outputs} {
            dict set changes $option [dict get $recipe $option]
            foreach pin [::sorma::circuitText pins [dict get $recipe $option]] {
                if {[list pin [lindex $pin 0]] in $gone} {
                    dict set changes $option [::sorma::circuitText undeclare [dict get $changes $option] [lindex $pin 0]]
                }
            }
        }
        # A pin of the circuit's own is there as long as it has a wire.
        set left [::sorma::circuitText graph {*}[lmap option {-wires -inputs -outputs} {dict get $changes $option}]]
        foreach key [dict keys $places] {
            if {[lindex $key 0] eq "pin" && ![dict exists $left nodes $key] && $key ni $gone} {
                lappend gone $key
            }
        }
        dict set changes -places [::sorma::circuitText drop [dict get $recipe -places] $gone]
        $self Edit $name $changes $gone
    }
    # move KEYS DX DY -- in steps of the grid.
    method move {moved dx dy} {
        set fresh {}
        foreach key [$self WithInner $moved] {
            lassign [$self box $key] x y
            dict set fresh $key [list [expr {$x + $dx}] [expr {$y + $dy}]]
        }
        $self Edit "move [Named $moved]" [dict create -places [::sorma::circuitText place [dict get $recipe -places] $fresh]]
    }
    # A frame follows the boxes that stand inside of it.
    method tidy {} {
        set fresh [::sorma::circuitLayout place $graph]
        set before $boxes
        set held [dict map {key note} $notes {
            lmap other [$self WithInner [list $key]] {if {![dict exists $boxes $other]} continue; set other}
        }]
        set boxes [dict map {key box} $boxes {concat [dict get $fresh $key] [lrange $box 2 3]}]
        dict for {key inner} $held {
            if {$inner ne {}} {
                dict set fresh $key [concat [$self Around $inner] [list [::sorma::circuitText quote [dict get $notes $key text]]]]
            }
        }
        set boxes $before
        $self Edit "lay out" [dict create -places [::sorma::circuitText place [dict get $recipe -places] $fresh]]
    }

    # replace NUMBER WIRE -- another text for a wire.
    method replace {number wire} {
        set text [::sorma::circuitText replace [dict get $recipe -wires] $number $wire]
        ::sorma::circuitText read $text
        $self Edit "wire $wire" [dict create -wires $text]
    }

    # ---- pins ----

    # Ask for the pins of a unit that the circuit does not know yet. Looking makes no unit; MAKE: it is to be made.
    method AskPins {name {make 0}} {
        if {!$make && ([dict exists $askedPins $name] || [dict exists $pins $name])} return
        dict set askedPins $name 1
        # A daemon answers for its own objects alone.
        set elsewhere [regexp {^([^@]+)@(.+)$} $name -> object place]
        $self AskAt [if {$elsewhere} {$palette key $place} else {lindex [::sorma::table locate [$subject name]] 1}] \
            [if {$make} {list [expr {$elsewhere ? $object : $name}] DBX -pins} else {list sorm DBX -look [expr {$elsewhere ? $object : $name}] -pins}] \
            [mymethod PinsCame $name $make]
    }
    # Ask the process that has the circuit. PREFIX is called with {ok REPLY} or {error {TEXT CODE TRAIL}}, while there is this window.
    method AskThere {request prefix} {
        $self AskAt [lindex [::sorma::table locate [$subject name]] 1] $request $prefix
    }
    method AskAt {where request prefix} {
        set key [::sorma::world use $where]
        if {$key ne {}} {
            ::sorma::world ask $key $request -timeout 30000 -command [list ::sorma::parts::answer $prefix]
        }
    }
    # The circuit's own name there.
    method NameThere {} {
        return [lindex [::sorma::table locate [$subject name]] 0]
    }
    method PinsCame {name made status value} {
        dict unset askedPins $name
        if {$status ne "ok"} {
            if {!$made} return
            set hint "[::sorma::style mark refused] [::sorma::text::clean [lindex $value 0]]"
            return
        }
        set found {ins {} outs {}}
        foreach line [split [if {[dict exists $value text]} {dict get $value text}] \n] {
            if {![catch {lassign $line pin way at length unit}] && $way in {in out}} {
                dict set found [dict get {in ins out outs} $way] $pin [list $length $unit]
            }
        }
        dict set pins $name $found
        $self Redraw
    }
    # {length unit} of the pin at an end; the length is empty while wires may still say it.
    method PinFacts {end side} {
        lassign $end object pin first last numbers
        set object [::sorma::circuitText object $object]
        set facts [if {[dict exists $pins $object $side $pin]} {dict get $pins $object $side $pin}]
        lassign $facts length unit
        if {$pin eq {}} {
            set length [llength $numbers]
        } elseif {$first ne {}} {
            set length [expr {$last - $first + 1}]
        } elseif {![string is integer -strict $length]} {
            set length {}
        }
        return [list $length $unit]
    }
    # Why a wire cannot lead from one end to the other; empty: it can, as far as is known here. The circuit has the last word.
    method Misfit {source sink} {
        foreach {end side word} [list $source outs output $sink ins input] {
            lassign $end object pin
            set known [::sorma::circuitText object $object]
            if {$object ne {} && [dict exists $pins $known] && ![dict exists $pins $known $side $pin]} {
                return "$object has no $word $pin"
            }
            set key [list pin $pin]
            if {$object eq {} && $pin ne {} && [dict exists $graph nodes $key] && [dict get $graph nodes $key kind] ne [dict get {outs in ins out} $side]} {
                return "$pin is an [dict get {in input out output} [dict get $graph nodes $key kind]] of the circuit itself"
            }
        }
        lassign $sink object pin first last
        foreach wire [dict get $graph wires] {
            lassign [lindex $wire 2] other name from to
            if {$other eq $object && $name eq $pin && ($first eq {} || $from eq {} || $first <= $to && $last >= $from)} {
                return "[::sorma::circuitText write $sink] has a source already, [::sorma::circuitText write [lindex $wire 1]]"
            }
        }
        lassign [$self PinFacts $source outs] length unit
        lassign [$self PinFacts $sink ins] room measure
        if {$length ne {} && $room ne {} && $length != $room} {
            return "[::sorma::text::counted $length element elements], but [::sorma::circuitText write $sink] has $room"
        } elseif {$unit ne {} && $measure ne {} && $unit ne $measure} {
            return "in $unit, but [::sorma::circuitText write $sink] in $measure"
        }
    }

    # ---- mouse ----

    method Bind {} {
        foreach {event method} {
            <ButtonPress-1> {Press %x %y 0} <Shift-ButtonPress-1> {Press %x %y 1} <B1-Motion> {Drag %x %y} <ButtonRelease-1> {Drop %x %y}
            <Double-ButtonPress-1> {Open %x %y} <ButtonPress-2> {Hold %x %y} <B2-Motion> {Drag %x %y} <ButtonRelease-2> {Drop %x %y} <Motion> {Over %x %y}
            <MouseWheel> {Wheel 0 %D} <Shift-MouseWheel> {Wheel 1 %D} <Control-MouseWheel> {WheelZoom %D %x %y}
            <Button-4> {Wheel 0 120} <Button-5> {Wheel 0 -120} <Shift-Button-4> {Wheel 1 120} <Shift-Button-5> {Wheel 1 -120}
            <Control-Button-4> {WheelZoom 120 %x %y} <Control-Button-5> {WheelZoom -120 %x %y}
        } {
            bind $scene $event [mymethod {*}$method]
        }
        $self BindKeys
        if {$options(-state) eq "readonly"} return
        ::sorma::style menu $scene $win [mymethod Offer]
        bind $scene <<ContextMenu>> "[mymethod PressBelow %x %y]; [bind $scene <<ContextMenu>>]"
        set tree [$palette tree]
        bind $tree <B1-Motion> [mymethod Carry %X %Y]
        bind $tree <ButtonRelease-1> +[mymethod Put %X %Y]
        bind $tree <Return> [mymethod PutHere]
        bind $tree <Double-ButtonPress-1> [mymethod PutHere]
    }
    method Selected {} {
        set chosenKeys [lmap key $chosenKeys {if {![dict exists $graph nodes $key] && ![dict exists $notes $key]} continue; set key}]
        set chosenWires [lmap n $chosenWires {if {$n >= [llength [dict get $graph wires]]} continue; set n}]
        set kept [lmap key $kept {if {$key ni $chosenKeys} continue; set key}]
        $scene select $chosenKeys $chosenWires
    }
    method selection {} {
        return [list $chosenKeys $chosenWires]
    }
    method Press {x y more} {
        focus $scene
        lassign [$scene hit $x $y] kind what side name
        set drag [dict create kind band x $x y $y]
        if {!$more && !($kind eq "node" && $what in $chosenKeys)} {
            set chosenKeys [set chosenWires {}]
        }
        switch -- $kind {
            node {
                set chosenKeys [if {$what ni $chosenKeys} {concat $chosenKeys [list $what]} elseif {$more} {lsearch -all -inline -exact -not $chosenKeys $what} else {set chosenKeys}]
                set drag [dict create kind move x $x y $y]
            }
            wire { lappend chosenWires $what }
            corner {
                set chosenKeys [list $what]
                set drag [dict create kind size x $x y $y key $what]
            }
            pin { set drag [dict create kind wire x $x y $y key $what side $side name $name] }
        }
        $self Selected
    }
    # The menu of the right button is for what lies below the pointer, with all that is selected beside it.
    method PressBelow {x y} {
        if {[lindex [$scene hit $x $y] 1] ni $chosenKeys} {
            $self Press $x $y 0
            $self Drop $x $y
        }
    }
    method Hold {x y} {
        set drag [dict create kind pan x $x y $y]
    }
    method Drag {x y} {
        if {$drag eq {}} return
        set dx [expr {$x - [dict get $drag x]}]
        set dy [expr {$y - [dict get $drag y]}]
        switch -- [dict get $drag kind] {
            pan {
                $scene follow $dx $dy
                dict set drag x $x
                dict set drag y $y
            }
            band { $scene band [dict get $drag x] [dict get $drag y] $x $y }
            move {
                if {$options(-state) eq "normal"} {
                    $scene shift [$self WithInner $chosenKeys] {*}[$self Steps $dx $dy]
                }
            }
            size {
                if {$options(-state) eq "normal"} {
                    $scene size [dict get $drag key] {*}[$self Sizes $dx $dy]
                }
            }
            wire {
                if {$options(-state) eq "normal"} {
                    lassign [$self Target $x $y] source sink why
                    set hint [expr {$why ne {} ? "[::sorma::style mark refused] $why" : "$source -> $sink"}]
                    $scene rubber [dict get $drag x] [dict get $drag y] $x $y [if {$why ne {}} {set hint}]
                }
            }
        }
    }
    method Steps {dx dy} {
        set step [expr {[::sorma::style pixels 800] / 100.0 * [$scene zoom]}]
        return [list [expr {round($dx / $step)}] [expr {round($dy / $step)}]]
    }
    # {width height} of the frame that is dragged at its corner.
    method Sizes {dx dy} {
        lassign [$self Steps $dx $dy] right down
        lassign [dict get $notes [dict get $drag key] size] width height
        return [list [expr {max(4, $width + $right)}] [expr {max(4, $height + $down)}]]
    }
    # {SOURCE SINK WHY}: the wire that would be made if the button was released here. On empty ground it ends at a new pin of the circuit's own.
    method Target {x y} {
        lassign [lmap word {key side name} {dict get $drag $word}] key side name
        lassign [$scene hit $x $y] kind what far pin
        set mine [if {[lindex $key 0] eq "unit"} {string cat [lindex $key 1].$name} else {set name}]
        if {$kind eq "pin"} {
            if {$far eq $side} {
                return [list {} {} "both are [dict get {ins inputs outs outputs} $side]"]
            }
            set other [if {[lindex $what 0] eq "unit"} {string cat [lindex $what 1].$pin} else {set pin}]
        } elseif {$kind eq "node"} {
            return [list {} {} "a wire ends at a pin"]
        } elseif {[lindex $key 0] eq "pin"} {
            return [list {} {} "a wire of the circuit's own pin ends at a unit"]
        } else {
            for {set n {}} {[dict exists $graph nodes [list pin $name$n]]} {set n [expr {$n eq {} ? 2 : $n + 1}]} {}
            set other $name$n
        }
        lassign [if {$side eq "outs"} {list $mine $other} else {list $other $mine}] source sink
        return [list $source $sink [$self Misfit {*}[::sorma::circuitText wire "$source -> $sink"]]]
    }
    # {KEY PLACE} of the pin of the circuit's own that Target has for empty ground: its dot is there. Empty elsewhere.
    method NewPin {x y} {
        if {[lindex [$scene hit $x $y] 0] in {pin node}} return
        lassign [$self Target $x $y] source sink
        set out [expr {[dict get $drag side] eq "outs"}]
        set key [list pin [expr {$out ? $sink : $source}]]
        lassign [$scene at $x $y] left top
        set width [lindex [::sorma::circuitLayout size $key {kind pin}] 0]
        return [list $key [list [expr {round($left) - ($out ? 0 : $width)}] [expr {round($top) - 2}]]]
    }
    method Drop {x y} {
        if {$drag eq {}} return
        set was $drag
        set dx [expr {$x - [dict get $drag x]}]
        set dy [expr {$y - [dict get $drag y]}]
        $scene rubber
        $scene band
        switch -- [dict get $was kind] {
            band { $self Band [dict get $was x] [dict get $was y] $x $y }
            move {
                lassign [$self Steps $dx $dy] right down
                if {($right || $down) && $options(-state) eq "normal"} {
                    $self move $chosenKeys $right $down
                }
            }
            size {
                if {$options(-state) eq "normal"} {
                    $self resize [dict get $was key] {*}[$self Sizes $dx $dy]
                }
            }
            wire {
                if {hypot($dx, $dy) > [::sorma::style pixels 8] && $options(-state) eq "normal"} {
                    lassign [$self Target $x $y] source sink why
                    if {$why eq {}} {
                        $self connect $source $sink [$self NewPin $x $y]
                    } else {
                        set hint "[::sorma::style mark refused] $why"
                    }
                }
            }
        }
        set drag {}
    }
    method Band {x1 y1 x2 y2} {
        if {hypot($x2 - $x1, $y2 - $y1) < 3} return
        lassign [$scene at [expr {min($x1, $x2)}] [expr {min($y1, $y2)}]] left top
        lassign [$scene at [expr {max($x1, $x2)}] [expr {max($y1, $y2)}]] right bottom
        foreach key [concat [dict keys $boxes] [dict keys $notes]] {
            lassign [$self box $key] x y width height
            if {$x >= $left && $y >= $top && $x + $width <= $right && $y + $height <= $bottom && $key ni $chosenKeys} {
                lappend chosenKeys $key
            }
        }
        $self Selected
    }
    method Open {x y} {
        lassign [$scene hit $x $y] kind what
        if {$kind eq "node" && [lindex $what 0] eq "unit"} {
            $self OpenUnit [lindex $what 1]
        } elseif {$kind eq "wire"} {
            $self Line
        } elseif {$kind eq "node" && [dict exists $notes $what]} {
            $self Line $what
        } else {
            $self Press $x $y 0
        }
    }
    # The panel of a unit, or the picture of a circuit inside.
    method OpenUnit unit {
        set name [$subject place $unit]
        if {[regexp {^circuit(?:[.@]|$)} $name]} {
            focus [::sorma::window open [list circuit -name $name] $name ::sorma::circuitEditor $name -state $options(-state)].w
        } else {
            ::sorma::window panel $name
        }
    }
    # Say in words what lies below the pointer. On empty ground nothing of that is left.
    method Over {x y} {
        set before [lindex $pointed 0]
        set text {}
        lassign [$scene hit $x $y] kind what side name
        switch -- $kind {
            wire { set text [$self WireText $what] }
            node {
                lassign [if {[lindex $what 0] eq "unit"} {$self illness [lindex $what 1]}] state why
                set text [if {[dict exists $notes $what]} {string map {\n { }} [dict get $notes $what text]} else {lindex $what 1}][if {$state ne {}} {string cat ": " $why}]
            }
            pin {
                lassign [$self PinFacts [list [if {[lindex $what 0] eq "unit"} {lindex $what 1}] $name {} {} {}] $side] length unit
                set text "[if {[lindex $what 0] eq "unit"} {string cat [lindex $what 1] .}]$name[if {$length ne {}} {string cat ", [::sorma::text::counted $length element elements]"}][if {$unit ne {}} {string cat ", $unit"}]"
            }
        }
        if {$text ne {} || $hint eq $before} {
            set hint $text
        }
        set pointed [list $text $x $y]
    }
    method WireText number {
        set wire [lindex [dict get $graph wires] $number]
        set rate [$self RateText $number]
        if {[dict exists $blamed [expr {$number + 1}]]} {
            return "[::sorma::style mark refused] [::sorma::text::clean [dict get $blamed [expr {$number + 1}]]]"
        }
        return "[lindex [dict get $graph pieces] [lindex $wire 0]]   [$self Text $wire][if {$rate ne {}} {string cat "   " $rate}]"
    }
    method Wheel {aside delta} {
        set pixels [::sorma::style pixels [expr {$delta / 2}]]
        $scene follow {*}[if {$aside} {list $pixels 0} else {list 0 $pixels}]
    }
    method WheelZoom {delta x y} {
        $scene zoom [expr {$delta > 0 ? 1.15 : 1 / 1.15}] $x $y
    }

    # ---- from the palette ----

    method Carry {X Y} {
        $scene configure -cursor [expr {[winfo containing $X $Y] eq $scene ? "plus" : {}}]
    }
    method Put {X Y} {
        $scene configure -cursor {}
        if {[winfo containing $X $Y] eq $scene && [$palette chosen] ne {}} {
            focus $scene            ;# Return opens the line there; in the list it would add another one
            $self drop [$palette chosen] {*}[$scene at [expr {$X - [winfo rootx $scene]}] [expr {$Y - [winfo rooty $scene]}]]
        }
    }
    method PutHere {} {
        if {[$palette chosen] ne {}} {
            $self drop [$palette chosen] {*}[$self Middle]
        }
    }
    # A free place in the middle of what is seen.
    method Middle {} {
        return [::sorma::circuitLayout free [$self Centre] 12 9 [dict values $boxes]]
    }
    # {X Y} of the middle of what is seen.
    method Centre {} {
        return [lmap c [$scene at [expr {[winfo width $scene] / 2}] [expr {[winfo height $scene] / 2}]] {expr {round($c)}}]
    }
}
