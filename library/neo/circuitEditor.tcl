# circuitEditor.tcl -- sorma::circuitEditor: a circuit as a picture, with the present values on its wires, here or elsewhere.
#
# The recipe (options -wires, -inputs, -outputs) is the only source of the picture; option -places has where its boxes stand. It is a view
# of the model: it never waits, and makes no object until somebody edits. Edits are in circuitEdits.tcl.

package require sorma::circuitClip
package require sorma::circuitEdits
package require sorma::circuitFlavor
package require sorma::circuitKeys
package require sorma::circuitLayout
package require sorma::circuitLine
package require sorma::circuitNotes
package require sorma::circuitNests
package require sorma::circuitPalette
package require sorma::circuitPast
package require sorma::circuitProbes
package require sorma::circuitRates
package require sorma::circuitRun
package require sorma::circuitScene
package require sorma::circuitStored
package require sorma::circuitText
package require sorma::circuitWays
package require sorma::lamp
package require sorma::notice
package require sorma::parts
package require sorma::subject
package require sorma::text
package require sorma::window
package provide sorma::circuitEditor 1.0

# ::sorma::circuitEditor .w NAME ?-every ms? ?-values 0|1? ?-rates 0|1? ?-state normal|readonly? --
#       A frame with the picture. The circuit need not be there.
# Arguments:
#       ms       how often values are asked for, default 200
#       values   are they shown
#       rates    does each value have the rate of its wire; the line below the picture always has it
#       readonly nothing is changed
# Methods:
#       subject, scene, palette     its parts
#       graph, places               as circuitText has them, with all pins and all boxes
#       box KEY                     {x y width height}
#       ways                        of the wires, in their order: x1 y1 x2 y2 ...
#       said                        the line below the picture
#       value NUMBER                the text on that wire
#       connect SOURCE SINK, drop CLASS X Y, delete KEYS NUMBERS, move KEYS DX DY, replace NUMBER WIRE, tidy. These edit.
#       copy, cut, paste, align SIDE   as circuitClip has them
#       record, endRecord, look, moment, present    as circuitPast has them
#       saveAs, compare, differences    as circuitFlavor has them
#       nest, unnest        as circuitNests has them
#       notes, note X Y TEXT, frame KEYS TEXT, retext KEY TEXT, resize KEY WIDTH HEIGHT    as circuitNotes has them
#       rate NUMBER                 of that wire, in Hz
#       illness UNIT                {refused WHY} of a unit that fails, {stale WHY} of one behind it
#       probe NUMBER ?KIND?         as circuitProbes has it
#       cycle                       the cycle that executes the circuit, or nothing
#       run, pause, step            what its buttons do
#       save FILE                   the picture: .svg, .pdf or .ps, all of it; .png, as it is in the window
#       undo, redo, revert, return COUNT
#       history                     names of the edits that can be undone
snit::widget ::sorma::circuitEditor {
    hulltype ttk::frame
    delegate option -takefocus to hull      ;# Tk asks for it
    option -every -default 200 -readonly 1 -type {snit::integer -min 20}
    option -values -default 1 -configuremethod SetValues -type snit::boolean
    option -state -default normal -readonly 1 -type {snit::enum -values {normal readonly}}
    component scene -public scene
    component palette -public palette
    variable subject {}
    variable listener {}
    variable token {}           ;# of the model, for values; empty while nobody sees them
    variable timer {}
    variable recipe {}          ;# dict: -wires -inputs -outputs -places, as shown
    variable running {}         ;# the same, as the circuit has it
    variable graph {nodes {} wires {} pieces {}}
    variable read {}            ;# {TEXTS GRAPH}: the last recipe that was read, before Complete
    variable there {{} {}}      ;# {TEXT WIRES}: those of the circuit as it runs; a dict {SOURCE SINK} -> 1
    variable places {}          ;# dict: KEY -> {x y}
    variable boxes {}           ;# dict: KEY -> {x y width height}
    variable pins {}            ;# dict: name of a unit -> {ins dict outs dict}, each name -> {length unit}; own pins: under the name {}
    variable live {}            ;# dict: {NAME in|out} -> {length unit number ...}
    variable reply {}           ;# the text that live was read from
    variable told {state asking why {} age {}}
    variable shown 1            ;# values
    variable stands {}          ;# begin, end or nothing, for each wire: where its value stands
    variable redraw 0           ;# have pins changed, so that it is to be drawn again
    variable lost {}            ;# dict: number of a wire, from 1 -> the pin that it has lost
    variable blamed {}          ;# dict: number of a wire, from 1 -> why the circuit refuses it
    variable hint {}            ;# below the picture
    variable tools {}           ;# the buttons in the head, in their order
    variable toolRows {}        ;# where they stand: {BESIDE ROWS}

    ::sorma::circuitEdits
    ::sorma::circuitClip
    ::sorma::circuitFlavorParts
    ::sorma::circuitKeys
    ::sorma::circuitLine
    ::sorma::circuitNotes
    ::sorma::circuitNests
    ::sorma::circuitPast
    ::sorma::circuitProbes
    ::sorma::circuitRates
    ::sorma::circuitRun
    ::sorma::circuitStored
    ::sorma::circuitWays

    constructor {name args} {
        $self configurelist $args
        set subject [::sorma::subject of $name]
        set pad [::sorma::style pixels 8]
        $hull configure -style Page.TFrame -takefocus 0
        $self Head
        ::ttk::panedwindow $win.panes -orient horizontal
        install palette using ::sorma::circuitPalette $win.panes.palette -where [lindex [::sorma::table locate $name] 1]
        ::ttk::frame $win.panes.picture
        install scene using ::sorma::circuitScene $win.panes.picture.scene
        ::sorma::style text $win.panes.picture.text {wrong refused} -wrap word -width 20 -height 10 -highlightthickness 1 -padx $pad -pady $pad
        $win.panes.picture.text tag configure wrong -underline 1
        ::ttk::label $win.hint -style Page.TLabel -textvariable [myvar hint] -anchor w -padding [list $pad [::sorma::style pixels 4]]
        bind $win.hint <Configure> "%W configure -wraplength \[expr {%w - 2 * $pad}\]"
        pack $scene -fill both -expand 1
        if {$options(-state) eq "normal"} {
            $win.panes add $palette -weight 0
            bind $win.panes <Configure> [list ::sorma::circuitEditor::Narrow $win.panes]
        }
        $win.panes add $win.panes.picture -weight 1
        pack $win.head -fill x -padx $pad -pady $pad
        pack $win.hint -side bottom -fill x
        pack $win.panes -fill both -expand 1 -padx $pad
        bind $scene <<ViewChanged>> [mymethod Viewed]
        bind $win <Map> [mymethod Begin]
        bind $win <Unmap> [mymethod Rest]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        $self Bind
        set listener [$subject listen [mymethod Told]]
        $self Refresh
    }
    # The picture gets the room, as soon as there is some.
    proc Narrow panes {
        if {[winfo width $panes] > [::sorma::style pixels 340]} {
            $panes sashpos 0 [::sorma::style pixels 170]
            bind $panes <Configure> {}
        }
    }
    # Title, state, buttons; then what is wrong.
    method Head {} {
        set pad [::sorma::style pixels 8]
        set head [::ttk::frame $win.head -style Card.TFrame -padding [list [::sorma::style pixels 12] $pad]]
        ::ttk::label $head.name -text [$subject name] -font [::sorma::style font title]
        ::sorma::status $head.status -name [$subject name] -brief 1
        ::ttk::frame $head.tools
        foreach {name text method changes} {undo Undo undo 1 redo Redo redo 1 revert Revert revert 1 tidy Tidy tidy 1 probe Probe Probe 0 out \u2212 {Zoom 0.8} 0 in + {Zoom 1.25} 0 fit Fit {Zoom fit} 0} {
            if {$changes && $options(-state) eq "readonly"} continue
            ::ttk::button $head.tools.$name -style Toolbutton -text [::msgcat::mc $text] -command [mymethod {*}$method]
            lappend tools $head.tools.$name
        }
        foreach {name text} {undo "Take the last change back (Ctrl-Z)" redo "Do it again (Ctrl-Y)" revert "Show the circuit as it runs, and forget what it has refused"
                tidy "Lay all boxes out anew (Ctrl-L)" probe "A chart on the wire that is selected, then a lamp, then neither (w)" out "Smaller (minus)" in "Larger (plus)" fit "All of it (0)"} {
            if {[winfo exists $head.tools.$name]} {
                ::sorma::style tip $head.tools.$name $text
            }
        }
        if {$options(-state) eq "normal"} {
            ::ttk::menubutton $head.tools.history -style Toolbutton -text [::msgcat::mc History] -menu $head.tools.history.menu
            menu $head.tools.history.menu -tearoff 0 -postcommand [mymethod Listed $head.tools.history.menu]
            ::sorma::style tip $head.tools.history "All edits; choose one to go back to it"
            lappend tools $head.tools.history
        }
        ::ttk::checkbutton $head.tools.values -style [::sorma::style own TCheckbutton] -text [::msgcat::mc values] -variable [myvar shown] -underline 0 \
            -command [mymethod Values]
        lappend tools $head.tools.values
        ::sorma::notice $head.say -lines 1
        grid $head.name $head.status -sticky ew -padx [list 0 $pad]
        grid $head.say -row 2 -column 0 -columnspan 3 -sticky ew
        grid columnconfigure $head 1 -weight 1
        foreach window [list $head $head.status $head.tools] {
            bind $window <Configure> +[mymethod PlaceTools]
        }
        $self PlaceTools
    }
    # Beside name and state if all fit; else below them, in as many rows as they need.
    method PlaceTools {} {
        set head $win.head
        set space [expr {[winfo width $head] - 2 * [::sorma::style pixels 12]}]
        if {[winfo width $head] <= 1} {
            set space 1000000
        }
        set all [tcl::mathop::+ {*}[lmap tool $tools {winfo reqwidth $tool}]]
        set beside [expr {[winfo reqwidth $head.name] + [winfo reqwidth $head.status] + 2 * [::sorma::style pixels 8] + $all <= $space}]
        set used 0
        set rows [list {}]
        foreach tool $tools {
            set width [winfo reqwidth $tool]
            if {!$beside && $used > 0 && $used + $width > $space} {
                lappend rows {}
                set used 0
            }
            incr used $width
            lset rows end [concat [lindex $rows end] $tool]
        }
        if {[list $beside $rows] eq $toolRows} return
        set toolRows [list $beside $rows]
        destroy {*}[lsearch -all -inline [winfo children $head.tools] *.row*]
        set n -1
        foreach row $rows {
            set frame [::ttk::frame $head.tools.row[incr n]]
            pack $frame -anchor w
            pack {*}$row -in $frame -side left -fill y
            foreach tool $row {
                raise $tool         ;# above the frame, which is younger
            }
        }
        grid $head.tools {*}[if {$beside} {list -row 0 -column 2 -columnspan 1 -sticky e} else {list -row 1 -column 0 -columnspan 3 -sticky w}]
    }
    method Ended window {
        if {$window eq $win && $subject ne {}} {
            after cancel $timer
            after cancel $finer
            after cancel $viewed
            $self Rest
            $subject unlisten $listener
            $subject release
            set subject {}
        }
    }

    # ---- what programs say ----

    method subject {} { return $subject }
    method graph {} { return $graph }
    method places {} { return $places }
    method ways {} { return $ways }
    method said {} { return $hint }
    method value number {
        return [$self Text [lindex [dict get $graph wires] $number]]
    }

    # ---- the model ----

    # Values are asked for while the picture can be seen.
    method Begin {} {
        if {$token eq {} && $subject ne {}} {
            set token [$subject value {DBX -live} $options(-every) [list ::sorma::parts::answer [mymethod Valued]]]
            $self StartProbes
            $self StartRates
            $self StartCycles
            $self Told
        }
    }
    method Rest {} {
        $self StopStored
        $self StopProbes
        $self StopRates
        $self StopCycles
        if {$token ne {}} {
            ::sorma::world unwatch $token
            set token {}
        }
    }
    method Told args {
        if {$timer eq {}} {
            set timer [after idle [mymethod Refresh]]
        }
    }
    method Valued {what name values} {
        set value [lindex $values 1]
        set told [dict filter $value key state why age]
        if {$moment ne {}} {
            dict set told age {}            ;# that of the recording stands beside its scale
        }
        set text [if {[dict exists $value value text]} {dict get $value value text}]
        $self NewValues $text
        $self Values
        if {$hint ne {} && $hint eq [lindex $pointed 0]} {
            $self Over {*}[lrange $pointed 1 2]         ;# the value there
        }
        $self Say
    }
    method NewValues text {
        if {$text ne {} && $text ne $reply} {
            set reply $text
            if {$moment eq {}} {
                $self ReadLive $text
            }
        }
    }
    method Redraw {} {
        set redraw 1
        $self Told
    }
    # Pins that have come or gone change the boxes.
    method ReadLive text {
        set live [set found {}]
        foreach line [split $text \n] {
            if {[catch {lassign $line pin way length unit}]} continue
            dict set live [list $pin $way] [lrange $line 2 end]
            set dot [string last . $pin]
            dict set found [string range $pin 0 $dot-1] [dict get {in ins out outs} $way] [string range $pin $dot+1 end] [list $length $unit]
        }
        if {$found ne $pins} {
            set pins [dict merge $pins $found]
            $self Redraw
        }
    }

    # ---- the picture ----

    method Refresh {} {
        after cancel $timer
        set timer {}
        if {$subject eq {}} return
        set now [set running {}]
        foreach option $::sorma::circuitText::options {
            set known [$subject get $option]
            set gone [expr {[dict get $known state] eq "gone"}]
            dict set now $option [if {[$self Wants $option]} {dict get $wanted $option} elseif {$gone && [dict exists $stored $option]} {dict get $stored $option} else {
                dict get $known value
            }]
            dict set running $option [dict get $known live]
        }
        $self LookStored $gone
        if {$now ne $recipe || $redraw} {
            set recipe $now
            set fresh $redraw
            set redraw 0
            $self Picture $fresh
        }
        $self Sent
        if {[$self Blamed] ne $blamed} {
            set blamed [$self Blamed]
            $self Show
        }
        $self Say
    }
    # FRESH: pins of units have come or gone.
    method Picture fresh {
        set texts [lmap option {-wires -inputs -outputs} {dict get $recipe $option}]
        set same [expr {!$fresh && [lindex $read 0] eq $texts}]
        if {[lindex $read 0] ne $texts} {
            try {
                set read [list $texts [::sorma::circuitText graph {*}$texts]]
            } on error {message how} {
                return [$self AsText $message [dict get $how -errorcode]]
            }
        }
        lassign [list [dict keys [dict get $graph nodes]] $places] before stood
        set held [lmap n $chosenWires {lrange [lindex [dict get $graph wires] $n] 1 2}]
        set graph [lindex $read 1]
        # A wire that is selected stays so, when it has another number.
        if {$held ne {}} {
            set chosenWires [lmap wire [set n -1; dict get $graph wires] {incr n; if {[lrange $wire 1 2] ni $held} continue; set n}]
        }
        if {[winfo manager $scene] eq {}} {
            pack forget $win.panes.picture.text
            pack $scene -fill both -expand 1
        }
        set fixed [::sorma::circuitText places [dict get $recipe -places]]
        $self ReadNotes
        $self Complete $fixed
        set lost [$self Lost]
        set places [::sorma::circuitLayout place $graph $fixed]
        # In a large circuit only the wires of boxes that have moved get new ways.
        if {$same && [::sorma::ways::simple [llength $ends]] && [dict keys [dict get $graph nodes]] eq $before} {
            $self Arrange 1 [dict keys [dict filter $places script {key place} {expr {$place ne [dict get $stood $key]}}]]
        } else {
            $self Arrange
        }
    }
    # All pins of the units that are known, in the order of their class; and units that have a place and no wire yet.
    method Complete fixed {
        set nodes [dict get $graph nodes]
        dict for {key place} $fixed {
            if {[lindex $key 0] eq "unit" && ![dict exists $nodes $key]} {
                dict set nodes $key {kind unit ins {} outs {}}
                $self AskPins [lindex $key 1]
            }
        }
        dict set graph nodes [dict map {key node} $nodes {
            foreach side {ins outs} {
                set name [::sorma::circuitText object [lindex $key 1]]
                if {[lindex $key 0] eq "unit" && [dict exists $pins $name $side]} {
                    set all [dict keys [dict get $pins $name $side]]
                    dict set node $side [concat $all [lmap pin [dict get $node $side] {if {$pin in $all} continue; set pin}]]
                }
            }
            set node
        }]
    }
    method Show {} {
        set text [dict get $running -wires]
        if {[lindex $there 0] ne $text} {
            set known {}
            foreach wire [if {[catch {::sorma::circuitText read $text} found]} {} else {dict get $found wires}] {
                dict set known [lrange $wire 1 2] 1
            }
            set there [list $text $known]
        }
        set known [lindex $there 1]
        set n 0
        set named [set wired [set stands {}]]
        set wires [lmap wire [dict get $graph wires] way $ways end $ends {
            if {$wire eq {}} break
            lassign $end net from to
            dict set wired $from 1
            dict set wired $to 1
            lassign $wire - source sink
            # A value stands once for its net, at its beginning; that of a part, and a constant, at the end.
            set part [expr {[lindex $source 1] eq {} || [lindex $source 2] ne {}}]
            lappend stands [expr {$part ? "end" : [dict exists $named $net] ? {} : "begin"}]
            dict set named $net 1
            dict create way $way ends [list $from $to] end $part count [$self Count $wire] \
                state [expr {[dict exists $blamed [incr n]] ? "refused" : [dict exists $known [lrange $wire 1 2]] ? "live" : "mine"}]
        }]
        $scene show [dict map {key node} [dict get $graph nodes] {
            dict replace $node box [dict get $boxes $key] state [$self NodeState $key $wired]
        }] $wires $notes
        $self Values
        $self ShowProbes
        $self Selected
    }
    # Wires whose pin is not there any more: a dict NUMBER, from 1 -> which one.
    method Lost {} {
        set n 0
        set found {}
        foreach wire [dict get $graph wires] {
            incr n
            foreach end [lrange $wire 1 2] side {outs ins} what {output input} {
                set name [if {[lindex $end 0] ne {}} {::sorma::circuitText object [lindex $end 0]}]
                if {$name ne {} && [dict exists $pins $name] && ![dict exists $pins $name $side [lindex $end 1]]} {
                    dict set found $n "$name has no $what [lindex $end 1]"
                }
            }
        }
        return $found
    }
    # These, and those that the circuit's refusal names, as "wire 2".
    method Blamed {} {
        set why [if {[$self sent] && [dict get [$subject get -wires] state] eq "refused"} {dict get [$subject get -wires] why}]
        regexp {wire \d+ ".*?": (.*)} $why -> short
        set numbers [lmap {- number} [regexp -all -inline {wire (\d+) } $why] {set number}]
        return [dict merge $lost [concat {*}[lmap number $numbers {list $number [expr {[info exists short] ? $short : $why}]}]]]
    }
    method NodeState {key wired} {
        if {[lindex $key 0] eq "unit" && [$self illness [lindex $key 1]] ne {}} {
            return [lindex [$self illness [lindex $key 1]] 0]
        }
        return [expr {[dict exists $wired $key] || [lindex $key 0] eq "pin" ? "live" : "asking"}]
    }
    # How many elements a wire has; empty: not known.
    method Count wire {
        lassign $wire - source sink
        foreach {end side} [list $source outs $sink ins] {
            lassign $end object pin first last numbers
            if {$pin eq {}} {
                return [llength $numbers]
            } elseif {$first ne {}} {
                return [expr {$last - $first + 1}]
            }
        }
        set known [$self Live $source out]
        return [lindex $known 0]
    }
    # {length unit number ...} of the pin at an end.
    method Live {end way} {
        lassign $end object pin
        if {$object eq {}} {
            set way [dict get {in out out in} $way]         ;# inside, an input of the circuit is a source
        }
        set key [list [if {$object ne {}} {string cat [::sorma::circuitText object $object] .}]$pin $way]
        return [if {[dict exists $live $key]} {dict get $live $key}]
    }

    # ---- values ----

    # {UNIT NUMBERS} of a wire.
    method Numbers wire {
        lassign $wire - source sink
        lassign $source object pin first last numbers
        set unit {}
        if {$pin ne {}} {
            set numbers [lassign [$self Live $source out] length unit]
            if {$first ne {}} {
                set numbers [lrange $numbers $first $last]
            }
        }
        return [list $unit $numbers]
    }
    # The value of a wire as it stands there: three elements at most, the unit, and its age when it is old, behind BETWEEN.
    method Text {wire {between {, }}} {
        lassign [$self Numbers $wire] unit numbers
        set pin [lindex $wire 1 1]
        if {$numbers eq {}} {
            return
        }
        set text [join [lmap number [lrange $numbers 0 2] {if {[string is double -strict $number]} {format %.4g $number} else {set number}}]]
        append text [if {[llength $numbers] > 3} {string cat \u2026}] [if {$unit ne {}} {string cat " " $unit}]
        return [if {$pin ne {} && [dict get $told age] ne {}} {string cat $text $between [dict get $told age]} else {set text}]
    }
    method Values {} {
        set n -1
        set wires [dict get $graph wires]
        # If there are many wires, only those that somebody sees have values.
        set seen [if {[set many [::sorma::ways::simple [llength $wires]]] && [$scene writes]} {$self SeenKeys 0}]
        $scene values [lmap wire $wires where $stands end $ends {
            incr n
            if {[dict exists $blamed [expr {$n + 1}]]} {
                ::sorma::style mark refused
            } elseif {$shown && $where ne {} && (!$many || [dict exists $seen [lindex $end 1]] || [dict exists $seen [lindex $end 2]])} {
                set text [$self Text $wire \n]
                set rate [if {$options(-rates) && $text ne {} && $moment eq {}} {$self RateText $n}]
                string cat [if {$rate ne {}} {string cat $rate \n}] $text
            }
        }]
        $scene grey [expr {$moment eq {} && [dict get $told state] in {stale gone refused}}]
    }
    method SetValues {option value} {
        set options($option) $value
        set shown $value
        if {$scene ne {}} {
            $self Values
        }
    }
    # The top says what holds for the whole circuit.
    method Say {} {
        lassign [$subject trouble] state text
        set make {}
        set refused [lmap option $::sorma::circuitText::options {
            set known [$subject get $option]
            if {[dict get $known state] ni {refused theirs locked}} continue
            list [dict get $known state] [expr {[dict get $known why] ne {} ? [dict get $known why] : [lindex [$subject mark $option] 1]}]
        }]
        if {$state eq "live" && $refused ne {}} {
            lassign [lindex $refused 0] state text
        } elseif {$state eq "live" && [dict get $told state] ni {live asking} || [list $state [dict get $told state]] eq {stale stale}} {
            # The age is that of the values: options may be as they are for hours.
            set state [dict get $told state]
            set text [dict get $told why]
        } elseif {$state eq "gone" && $options(-state) eq "normal" && [$subject makes]} {
            set make [list $subject make]
        }
        if {$state eq "live"} {
            set text "[::sorma::text::counted [dict size [dict get $graph nodes]] box boxes], [::sorma::text::counted [llength [dict get $graph wires]] wire wires]"
        } else {
            set text "[::sorma::style mark $state] $text"
        }
        $win.head.say say [expr {$state eq "live" ? "asking" : $state}] [::sorma::text::clean [regsub -all {\s+} $text { }]] $make
    }
    # A recipe that cannot be read: its text, with the error marked.
    method AsText {message code} {
        set view $win.panes.picture.text
        pack forget $scene
        pack $view -fill both -expand 1
        $view configure -state normal
        $view delete 1.0 end
        $view insert end [dict get $recipe -wires]
        lassign [lrange $code 4 5] first last
        if {[string is integer -strict $last]} {
            $view tag add wrong "1.0 + $first chars" "1.0 + [expr {$last + 1}] chars"
            $view see "1.0 + $first chars"
        }
        $view configure -state disabled
        set hint "[::sorma::style mark refused] $message"
    }
    method save file {
        $scene save $file
    }
    # A name without an ending gets that of the type that is chosen there.
    method Print {} {
        set file [tk_getSaveFile -parent $win -filetypes {{Drawing .svg} {PDF .pdf} {Picture .png} {PostScript .ps}}]
        if {$file ne {}} {
            set hint [if {[catch {$self save $file} message]} {string cat "[::sorma::style mark refused] " $message} else {string cat "saved: " $file}]
        }
    }
    method Zoom factor {
        if {$factor eq "fit"} {
            $scene fit
        } else {
            $scene zoom $factor
        }
    }
}
