# chart.tcl -- sorma::stripchart: numbers over time, several traces, as they come.
#
# A chart costs little because it draws little: each line is moved, its new points are appended and its old ones cut off. All of it is
# drawn again only when the scale changes.

package require Tk
package require csv
package require snit
package require sorma::options
package require sorma::parts
package require sorma::text
package provide sorma::chart 1.0

# ::sorma::stripchart .w ?options? --
#       Options: -span seconds that are shown (10), -low and -high (empty: as the numbers need), -width, -height, -interval (ms between two
#       drawings, 33), -paused, -plot (list of plots from the beginning, each as the method takes it, behind the name), -state (disabled: grey,
#       and keys, mouse and menu do nothing)
# Methods:
#       trace NAME ?-text t? ?-colour c?        one more line; that is done by sample as well
#       sample NAME VALUE ?TIME?                a point; time: s, default now. NaN makes a gap, an infinity too
#       plot NAME SO -OPTION ?-index n?         the values of an option of a service object, as they change; of a vector one element. A value
#                                               holds until the next one comes; where none is known, there is a gap
#       plot NAME SO {EXEC ...} ?-part P? ?-index n? ?-every ms?    a number of what it answers, as sorma::reading has it
#       forget NAME, clear                      traces; clear: their points
#       data NAME                               list of {time value}, s since the chart was made
#       pause ?BOOL?, csv, export FILE          FILE.csv, FILE.png (with package Img), FILE.pdf (with ghostscript) or FILE.ps
snit::widget ::sorma::stripchart {
    hulltype ttk::frame
    option -span -default 10 -configuremethod SetSpan
    option -low -default {} -configuremethod Redraw
    option -high -default {} -configuremethod Redraw
    option -width -default 400
    option -height -default 160
    option -interval -default 33
    option -paused -default 0 -configuremethod SetPaused
    option -plot -default {} -readonly 1
    ::sorma::stateParts
    component canvas
    variable traces {}          ;# dict: name -> {number text colour times values subject token what part index holds age}; colour: empty: of its number;
                                ;# what: -option or {EXEC ...}; holds: a value stays until the next one; age: how old the last one is
    variable fresh {}           ;# dict: name -> {time value ...} that are to be drawn
    variable origin 0           ;# ms, when the chart was made
    variable shown 0            ;# s, at the right edge
    variable scale {}           ;# {low high} that is drawn
    variable timer {}
    variable made 0             ;# traces, so far

    constructor args {
        set origin [clock milliseconds]
        $self configurelist $args
        install canvas using canvas $win.canvas -width [::sorma::style pixels $options(-width)] -height [::sorma::style pixels $options(-height)] \
            -highlightthickness 0 -takefocus 1
        pack $canvas -fill both -expand 1
        bind $canvas <Configure> [mymethod Rebuild]
        bind $win <<ThemeChanged>> [mymethod Rebuild]
        bind $canvas <space> [mymethod Act pause]
        bind $canvas <ButtonPress-1> [list focus $canvas]
        ::sorma::style menu $canvas $win [mymethod Act Menu]
        bind $canvas <plus> [mymethod Act Zoom 0.5]
        bind $canvas <minus> [mymethod Act Zoom 2]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        foreach plot $options(-plot) {
            $self plot [if {[llength $options(-plot)] > 1} {set plot} else {lindex $plot 1}] {*}$plot
        }
        set timer [after $options(-interval) [mymethod Tick]]
        $self Enable
    }
    method Enable {} {
        if {$canvas ne {}} {
            $canvas configure -takefocus [$self Enabled]
            $self Rebuild
        }
    }
    method Ended window {
        if {$window ne $win} return
        after cancel $timer
        foreach name [dict keys $traces] {
            $self Unplot $name
        }
    }

    # ---- what programs say ----

    method trace {name args} {
        set facts [::sorma::options::parse {-colour any -text any} $args]
        if {[dict exists $traces $name]} return
        dict set traces $name [dict create number $made text [if {[dict get $facts -text] ne {}} {dict get $facts -text} else {set name}] \
            colour [dict get $facts -colour] times {} values {} subject {} token {} what {} part {} index {} holds 0 age {}]
        incr made
        $self Rebuild
    }
    method sample {name value {time {}}} {
        if {![string is double -strict $value]} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "$name: expected a number, got \"$value\""
        }
        if {![dict exists $traces $name]} {
            $self trace $name
        }
        if {$time eq {}} {
            set time [expr {([clock milliseconds] - $origin) / 1000.0}]
        }
        dict lappend fresh $name $time $value
    }
    method plot {name so what args} {
        if {[llength $args] % 2} {
            return -code error -errorcode {TCL WRONGARGS} "wrong # args: should be \"$self plot name SO -option|request ?-part part? ?-index n? ?-every ms?\""
        }
        set facts [::sorma::options::parse {-part {{choice floats ints words text code} {}} -index {{whole 0 {}} {}} -every {{whole 10 {}} 1000}} $args]
        set index [dict get $facts -index]
        $self trace $name -text [string trimright "$so $what $index"]
        $self Unplot $name
        set isOption [string match -* $what]
        set subject [::sorma::subject of $so -live [expr {$isOption ? 100 : 0}]]
        dict set traces $name subject $subject
        dict set traces $name what $what
        dict set traces $name holds 1
        dict set traces $name part [dict get $facts -part]
        dict set traces $name index $index
        set prefix [list ::sorma::parts::answer [mymethod Told $name]]
        dict set traces $name token [if {$isOption} {$subject listen $prefix $what} else {$subject value $what [dict get $facts -every] $prefix}]
    }
    method Unplot name {
        dict with traces $name {
            if {$subject ne {}} {
                if {[string match -* $what]} {
                    $subject unlisten $token
                } else {
                    ::sorma::world unwatch $token
                }
                $subject release
            }
            set subject {}
        }
    }
    # Of an option: what and changed; of a request: value, the object, and what it answers.
    method Told {name about changed {told {}}} {
        if {![dict exists $traces $name] || [dict get $traces $name subject] eq {}} return
        set trace [dict get $traces $name]
        set index [dict get $trace index]
        if {[string match -* [dict get $trace what]]} {
            set told [[dict get $trace subject] get [dict get $trace what]]
            set number [dict get $told live]
            if {$index ne {}} {
                set number [lindex [regexp -all -inline {\S+} $number] $index]
            }
        } else {
            set told [lindex [dict values $told] 0]
            set number [lindex [::sorma::parts::ofReply [dict get $told value] [dict get $trace part] $index] 1]
        }
        if {[string is double -strict $number] && [dict get $told state] ni {stale gone asking refused}} {
            $self sample $name $number
        } elseif {[$self Last $name] ne "NaN"} {
            $self EndAt $name [dict get $told seen]
        }
        if {[dict get $told age] ne [dict get $traces $name age]} {
            dict set traces $name age [dict get $told age]
            $canvas itemconfigure text[dict get $traces $name number] -text [$self Text $name]
        }
    }
    # A value ends where it was last known to be so [ms]; 0: now.
    method EndAt {name seen} {
        set last [if {[dict exists $fresh $name]} {lindex [dict get $fresh $name] end-1} else {lindex [dict get $traces $name times] end}]
        set time [expr {$seen > 0 ? max($last, ($seen - $origin) / 1000.0) : [$self Now]}]
        $self sample $name NaN $time
    }
    method Text name {
        return [string trimright "[dict get $traces $name text], [dict get $traces $name age]" ", "]
    }
    # The last value of a trace, drawn or not; NaN: none.
    method Last name {
        set value [if {[dict exists $fresh $name]} {lindex [dict get $fresh $name] end} else {lindex [dict get $traces $name values] end}]
        if {$value eq {} || $value != $value} {
            return NaN
        }
        return $value
    }
    method forget name {
        if {[dict exists $traces $name]} {
            $self Unplot $name
            dict unset traces $name
            dict unset fresh $name
            $self Rebuild
        }
    }
    method clear {} {
        set fresh {}
        foreach name [dict keys $traces] {
            dict set traces $name times {}
            dict set traces $name values {}
        }
        $self Rebuild
    }
    method data name {
        $self Draw
        $self Take
        return [lmap t [dict get $traces $name times] v [dict get $traces $name values] {list $t $v}]
    }
    method pause {{on {}}} {
        $self configure -paused [expr {$on eq {} ? !$options(-paused) : $on}]
    }
    method csv {} {
        $self Draw
        $self Take
        return [::csv::joinlist [concat {{trace time value}} {*}[lmap {name trace} $traces {
            lmap t [dict get $trace times] v [dict get $trace values] {list $name $t $v}
        }]]]
    }
    method export file {
        switch -- [string tolower [file extension $file]] {
            .csv { ::sorma::text::writeFile $file [$self csv] }
            default { ::sorma::parts::picture $canvas $file }
        }
        return $file
    }

    # ---- drawing ----

    method SetPaused {option value} {
        set options($option) $value
        if {!$value && $canvas ne {}} {
            $self Rebuild
        }
    }
    method SetSpan {option value} {
        if {![string is double -strict $value] || !($value >= 0.1 && $value <= 86400)} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "-span expects seconds from 0.1 to 86400, got \"$value\""
        }
        $self Redraw $option $value
    }
    method Redraw {option value} {
        set options($option) $value
        if {$canvas ne {} && [winfo exists $canvas]} {
            $self Rebuild
        }
    }
    method Zoom factor {
        $self configure -span [expr {max(0.1, min(86400, $options(-span) * $factor))}]
    }
    method Now {} {
        return [expr {([clock milliseconds] - $origin) / 1000.0}]
    }
    # Add new values to the traces; remove those that are too old to be shown.
    method Take {} {
        set old [expr {($options(-paused) ? $shown : [$self Now]) - $options(-span)}]
        dict for {name points} $fresh {
            set times [dict get $traces $name times]
            set values [dict get $traces $name values]
            dict set traces $name times {}
            dict set traces $name values {}
            foreach {t v} $points {
                lappend times $t
                lappend values $v
            }
            set first [lsearch -real -sorted -bisect $times $old]
            if {$first > 0} {
                set times [lrange $times $first end]
                set values [lrange $values $first end]
            }
            dict set traces $name times $times
            dict set traces $name values $values
        }
        set points $fresh
        set fresh {}
        return $points
    }
    method Tick {} {
        set timer [after $options(-interval) [mymethod Tick]]
        $self Draw
    }
    method Draw {} {
        if {$options(-paused) || ![winfo ismapped $canvas]} return
        set points [$self Take]
        set now [$self Now]
        set moved [expr {int(($now - $shown) * [winfo width $canvas] / double($options(-span)))}]
        if {$moved > 0} {
            $canvas move points -$moved 0
            set shown [expr {$shown + $moved * double($options(-span)) / [winfo width $canvas]}]
        }
        if {[dict size $points] > 0 && ![$self Fits $points]} {
            return [$self Rebuild]
        }
        dict for {name new} $points {
            $self Append $name $new
        }
        $self Hold
    }
    # Values that hold reach to the right edge.
    method Hold {} {
        dict for {name trace} $traces {
            set v [lindex [dict get $trace values] end]
            set id tail[dict get $trace number]
            if {![dict get $trace holds] || $v eq {} || $v != $v || abs($v) >= 1e300} {
                $canvas delete $id
                continue
            }
            set place [list [$self X [lindex [dict get $trace times] end]] [$self Y $v] [winfo width $canvas] [$self Y $v]]
            if {[$canvas find withtag $id] eq {}} {
                $canvas create line $place -fill [$self Colour $name] -tags [list tail $id]
            } else {
                $canvas coords $id $place
            }
        }
    }
    # Do new points lie within the scale, without gaps?
    method Fits points {
        lassign $scale low high
        if {$scale eq {}} {
            return 0
        }
        foreach values [dict values $points] {
            foreach {t v} $values {
                if {!($v >= $low && $v <= $high)} {
                    return 0
                }
            }
        }
        return 1
    }
    method X t {
        return [expr {[winfo width $canvas] - ($shown - $t) * [winfo width $canvas] / double($options(-span))}]
    }
    method Y v {
        lassign $scale low high
        return [expr {[winfo height $canvas] - 1 - ($v - $low) * ([winfo height $canvas] - 2) / ($high - $low)}]
    }
    method Append {name points} {
        set ids [$canvas find withtag "line&&\"[string map {\\ \\\\ \" \\\"} $name]\""]
        if {[llength $ids] == 0 || ![dict exists $traces $name]} {
            return [$self Rebuild]
        }
        set id [lindex $ids end]
        set new {}
        set before [lindex [$canvas coords $id] end]
        foreach {t v} $points {
            if {[dict get $traces $name holds]} {
                lappend new [$self X $t] $before
            }
            lappend new [$self X $t] [set before [$self Y $v]]
        }
        $canvas insert $id end $new
        # Remove the points beyond the left edge.
        set gone 0
        set coordinates [$canvas coords $id]
        set n [llength $coordinates]
        while {$gone + 6 <= $n && [lindex $coordinates $gone+2] < 0} {
            incr gone 2
        }
        if {$gone > 0} {
            $canvas dchars $id 0 [expr {$gone - 1}]
        }
    }
    # The scale that shows all numbers, in steps of 1, 2, 5.
    method Range {} {
        set all {}
        dict for {name trace} $traces {
            foreach v [dict get $trace values] {
                if {$v == $v && abs($v) < 1e300} {
                    lappend all $v
                }
            }
        }
        set low $options(-low)
        set high $options(-high)
        if {[llength $all] == 0} {
            lappend all 0 1
        }
        set least [tcl::mathfunc::min {*}$all]
        set most [tcl::mathfunc::max {*}$all]
        if {$most - $least <= 1e-9 * abs($most)} {      ;# a constant lies in the middle
            set beside [expr {$most == 0 ? 1 : 0.1 * abs($most)}]
            set least [expr {$least - $beside}]
            set most [expr {$most + $beside}]
        }
        set step [::sorma::style step [expr {max($most - $least, 1e-12 + 1e-9 * abs($most))}]]
        if {$low eq {}} {
            set low [expr {floor($least / $step) * $step}]
        }
        if {$high eq {}} {
            set high [expr {ceil($most / $step) * $step}]
        }
        return [list $low [expr {$high > $low ? $high : $low + $step}]]
    }
    # Draw all of it again.
    method Rebuild {} {
        if {$canvas eq {} || ![winfo exists $canvas] || [winfo width $canvas] < 10} return
        $self Take
        if {!$options(-paused)} {
            set shown [$self Now]
        }
        set scale [$self Range]
        lassign $scale low high
        $canvas delete all
        $canvas configure -background [ttk::style lookup TEntry -fieldbackground {} white]
        set ink [expr {[$self Enabled] ? [ttk::style lookup . -foreground {} black] : [::sorma::style colour asking]}]
        set step [::sorma::style step [expr {$high - $low}]]
        for {set v [expr {ceil($low / $step) * $step}]} {$v <= $high + 1e-9 * $step} {set v [expr {$v + $step}]} {
            set y [$self Y $v]
            $canvas create line 0 $y [winfo width $canvas] $y -fill [::sorma::style colour asking] -dash {1 3}
            $canvas create text 3 $y -anchor [expr {$y < 14 ? "nw" : "sw"}] -text [format %.6g [expr {abs($v) < 1e-9 * $step ? 0 : $v}]] \
                -font [::sorma::style font small] -fill [::sorma::style colour asking]
        }
        set x [expr {[winfo width $canvas] - 4}]
        set y 3
        dict for {name trace} $traces {
            set part {}
            foreach t [dict get $trace times] v [dict get $trace values] {
                if {[dict get $trace holds] && $part ne {}} {
                    lappend part [$self X $t] [lindex $part end]
                }
                if {$v == $v && abs($v) < 1e300} {
                    lappend part [$self X $t] [$self Y $v]
                } else {
                    $self Line $name $part
                    set part {}
                }
            }
            $self Line $name $part
            $canvas create text $x $y -anchor ne -text [$self Text $name] -fill [$self Colour $name] -font [::sorma::style font small] \
                -tags [list text[dict get $trace number]]
            incr y [font metrics [::sorma::style font small] -linespace]
        }
        $self Hold
        if {$traces eq {}} {
            $canvas create text [expr {[winfo width $canvas] / 2}] [expr {[winfo height $canvas] / 2}] -fill [::sorma::style colour asking] \
                -text [::msgcat::mc "nothing is plotted yet: \"Plot this\" in the menu of a field"] -font [::sorma::style font small]
        }
        if {$options(-paused)} {
            $canvas create text [expr {[winfo width $canvas] / 2}] 3 -anchor n -text [::msgcat::mc "paused"] -fill $ink -font [::sorma::style font small]
        }
    }
    method Colour name {
        set colour [dict get $traces $name colour]
        return [if {![$self Enabled]} {::sorma::style colour asking} elseif {$colour ne {}} {set colour} else {::sorma::style series [dict get $traces $name number]}]
    }
    method Line {name coordinates} {
        if {[llength $coordinates] == 0} return
        if {[llength $coordinates] == 2} {
            lappend coordinates {*}$coordinates
        }
        $canvas create line $coordinates -fill [$self Colour $name] -tags [list points line $name]
    }
    method Menu {menu window} {
        $menu add command -label [::msgcat::mc [expr {$options(-paused) ? "Go on" : "Pause"}]] -accelerator space -command [mymethod pause]
        $menu add command -label [::msgcat::mc "Shorter"] -accelerator + -command [mymethod Zoom 0.5]
        $menu add command -label [::msgcat::mc "Longer"] -accelerator - -command [mymethod Zoom 2]
        $menu add command -label [::msgcat::mc "Clear"] -command [mymethod clear]
        $menu add command -label [::msgcat::mc "Save ..."] -command [mymethod Save]
    }
    method Save {} {
        set file [tk_getSaveFile -parent $win -defaultextension .csv -filetypes {{Table .csv} {Picture .png} {{Vector picture} .pdf} {PostScript .ps}}]
        if {$file ne {} && [catch {$self export $file} message]} {
            $canvas create text 4 [expr {[winfo height $canvas] - 4}] -anchor sw -text $message -fill [::sorma::style colour refused]
        }
    }
}
