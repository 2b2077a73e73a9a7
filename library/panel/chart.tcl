# chart.tcl -- sorma::stripchart: numbers over time, several traces, as they come.
#
# A chart costs little because it draws little: each line is moved, its new points are appended and its old ones cut off. All of it is
# drawn again only when the scale changes, and then of many points what a column of pixels can show.

package require Tk
package require csv
package require snit
package require sorma::chartAxis
package require sorma::options
package require sorma::parts
package require sorma::series
package require sorma::text
package provide sorma::chart 1.0

# ::sorma::stripchart .w ?options? --
# Options:
#       -span SECONDS           that are shown (10)
#       -low, -high             limits of the numbers; empty: as the numbers need
#       -width, -height         pixels
#       -interval MS            between two drawings (33)
#       -paused BOOL            the lines stand still
#       -keep SECONDS           for which points are kept, and can be gone back to (3600)
#       -plot LIST              plots from the beginning, each as the method takes it, behind the name
#       -font FONT              of names and numbers (small)
#       -state STATE            disabled: grey, and keys, mouse and menu do nothing
# Methods:
#       trace NAME ?-text t? ?-colour c? ?-unit u?      one more line; that is done by sample as well
#       sample NAME VALUE ?TIME?                a point; time: s, default now. NaN makes a gap, an infinity too
#       plot NAME SO -OPTION ?-index n?         the values of an option of a service object, as they change; of a vector one element. A value
#                                               holds until the next one comes; where none is known, there is a gap
#       plot NAME SO {EXEC ...} ?-part P? ?-index n? ?-every ms?    a number of what it answers, as sorma::reading has it
#       forget NAME, clear                      traces; clear: their points
#       hide NAME ?BOOL?                        its line; its points are kept
#       data NAME                               list of {time value}, s since the chart was made, from the left edge on
#       pause ?BOOL?, csv, export FILE          FILE.csv, FILE.png (with package Img), FILE.pdf (with ghostscript) or FILE.ps
#       go SECONDS                              earlier (below 0) or later, and pause; zoom FACTOR ?X?: of the span, about a pixel
# Wheel: zoom; drag: earlier or later; a click on a name hides its line; the pointer shows values.
snit::widget ::sorma::stripchart {
    hulltype ttk::frame
    option -span -default 10 -configuremethod SetSpan
    option -low -default {} -configuremethod Redraw
    option -high -default {} -configuremethod Redraw
    option -width -default 400
    option -height -default 160
    option -interval -default 33
    option -paused -default 0 -configuremethod SetPaused
    option -keep -default 3600
    option -font -default {} -configuremethod Redraw
    option -plot -default {} -readonly 1
    ::sorma::stateParts
    ::sorma::chartAxis
    component canvas
    variable traces {}          ;# dict: name -> {number text colour unit series hidden subject token what part index holds age}; colour: empty: of its
                                ;# number; what: -option or {EXEC ...}; holds: a value stays until the next one; age: how old the last one is
    variable fresh {}           ;# dict: name -> {time value ...} that are to be drawn
    variable origin 0           ;# ms, when the chart was made
    variable shown 0            ;# s, at the right edge
    variable scale {}           ;# {low high} that is drawn
    variable timer {}
    variable made 0             ;# traces, so far
    variable added 0            ;# numbers that were appended since all was drawn
    variable grip {}            ;# {x shown}, where the picture is held

    constructor args {
        set origin [clock milliseconds]
        $self configurelist $args
        install canvas using canvas $win.canvas -width [::sorma::style pixels $options(-width)] -height [::sorma::style pixels $options(-height)] \
            -highlightthickness 0 -takefocus 1
        pack $canvas -fill both -expand 1
        foreach event {<Configure> <Map>} {
            bind $canvas $event [mymethod Rebuild]
        }
        bind $win <<ThemeChanged>> [mymethod Rebuild]
        ::sorma::style menu $canvas $win [mymethod Act Menu]
        foreach {event words} {
            <ButtonPress-1> {Grip %x %y} <B1-Motion> {Drag %x} <Double-ButtonPress-1> {Twice %x %y} <Motion> {Point %x %y} <Leave> {Point {} {}}
            <space> pause <plus> {zoom 0.5} <minus> {zoom 2} <Left> {Leaf -0.25} <Right> {Leaf 0.25} <End> {pause 0}
            <MouseWheel> {Wheel %x %D} <Button-4> {Wheel %x 120} <Button-5> {Wheel %x -120}
        } {
            bind $canvas $event [mymethod Act {*}$words]
        }
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
            [dict get $traces $name series] destroy
        }
    }

    # ---- what programs say ----

    method trace {name args} {
        set facts [::sorma::options::parse {-colour any -text any -unit any} $args]
        if {[dict exists $traces $name]} return
        dict set traces $name [dict create number $made text [if {[dict get $facts -text] ne {}} {dict get $facts -text} else {set name}] \
            colour [dict get $facts -colour] unit [dict get $facts -unit] series [::sorma::series::new] hidden 0 subject {} token {} what {} part {} \
            index {} holds 0 age {}]
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
    # From the subject of an option it gets what and changed; from a request it gets value, the object, and its answer.
    method Told {name about changed {told {}}} {
        if {![dict exists $traces $name] || [dict get $traces $name subject] eq {}} return
        set trace [dict get $traces $name]
        set index [dict get $trace index]
        if {[string match -* [dict get $trace what]]} {
            set told [[dict get $trace subject] get [dict get $trace what]]
            if {[dict get $trace unit] eq {}} {
                $self Measured $name
            }
            set number [dict get $told live]
            if {$index ne {}} {
                set number [lindex [regexp -all -inline {\S+} $number] $index]
            }
        } else {
            set told [lindex [dict values $told] 0]
            set number [lindex [::sorma::message::part [dict get $told value] [dict get $trace part] $index] 1]
        }
        if {[string is double -strict $number] && [dict get $told state] ni {stale gone asking refused}} {
            $self sample $name $number
        } elseif {[$self Last $name] ne "NaN"} {
            $self EndAt $name [dict get $told seen]
        }
        set age [dict get $trace age]
        if {[dict get $told age] ne $age} {
            dict set traces $name age [dict get $told age]
            if {[string length $age] != [string length [dict get $told age]]} {
                $self Rebuild
            }
            $canvas itemconfigure text[dict get $trace number] -text [$self Text $name]
        }
    }
    # The unit of an option is known when its table is.
    method Measured name {
        set trace [dict get $traces $name]
        set subject [dict get $trace subject]
        if {[$subject table] eq {} || [catch {$subject option [dict get $trace what]} facts] || [dict get $facts unit] eq {}} return
        dict set traces $name unit [dict get $facts unit]
        $self Rebuild
    }
    # A value ends where it was last known to be so [ms]; 0: now.
    method EndAt {name seen} {
        set last [lindex [$self Newest $name] 0]
        set time [expr {$seen > 0 ? max($last, ($seen - $origin) / 1000.0) : [$self Now]}]
        $self sample $name NaN $time
    }
    method Text name {
        return [string trimright "[dict get $traces $name text], [dict get $traces $name age]" ", "]
    }
    # The last point of a trace, drawn or not; its value; NaN: none.
    method Newest name {
        return [if {[dict exists $fresh $name]} {lrange [dict get $fresh $name] end-1 end} else {[dict get $traces $name series] last}]
    }
    method Last name {
        set value [lindex [$self Newest $name] 1]
        return [if {$value eq {} || $value != $value} {string cat NaN} else {set value}]
    }
    method forget name {
        if {[dict exists $traces $name]} {
            $self Unplot $name
            [dict get $traces $name series] destroy
            dict unset traces $name
            dict unset fresh $name
            $self Rebuild
        }
    }
    method clear {} {
        set fresh {}
        dict for {name trace} $traces {
            [dict get $trace series] clear
        }
        $self Rebuild
    }
    method hide {name {on 1}} {
        dict set traces $name hidden [expr {bool($on)}]
        $self Rebuild
    }
    # From the left edge on; whole numbers as such.
    method Points name {
        return [lmap number [[dict get $traces $name series] points [expr {$shown - $options(-span)}] Inf] {regsub {\.0$} $number {}}]
    }
    method data name {
        $self Draw
        $self Take
        return [lmap {t v} [$self Points $name] {list $t $v}]
    }
    method pause {{on {}}} {
        $self configure -paused [expr {$on eq {} ? !$options(-paused) : $on}]
    }
    method csv {} {
        $self Draw
        $self Take
        return [::csv::joinlist [concat {{trace time value}} {*}[lmap name [dict keys $traces] {
            lmap {t v} [$self Points $name] {list $name $t $v}
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
    # About a pixel: what is there stays there, unless the newest stays at the right edge.
    method zoom {factor {x {}}} {
        set span [expr {max(0.1, min(86400, $options(-span) * double($factor)))}]
        if {$options(-paused) && $x ne {}} {
            set shown [expr {$shown + ($span - $options(-span)) * (1 - [$self Part $x])}]
        }
        $self configure -span $span
    }
    method Wheel {x delta} {
        $self zoom [expr {$delta > 0 ? 0.8 : 1.25}] $x
    }
    method go seconds {
        set now [$self Now]
        set options(-paused) 1
        set first [tcl::mathfunc::min $now {*}[lmap trace [dict values $traces] {
            if {[[dict get $trace series] size] == 0} continue
            lindex [[dict get $trace series] first] 0
        }]]
        set shown [expr {max(min($now, $first + 0.1 * $options(-span)), min($now, $shown + $seconds))}]
        $self Rebuild
    }
    method Leaf part {
        $self go [expr {$part * $options(-span)}]
    }
    # A click on a name hides its line, or shows it again; else the picture is held and can be moved.
    method Grip {x y} {
        focus $canvas
        set grip {}
        foreach id [$canvas find overlapping $x $y $x $y] {
            if {[regexp {(?:^|\s)(?:key|text)(\d+)(?:\s|$)} [$canvas gettags $id] -> number]} {
                dict for {name trace} $traces {
                    if {[dict get $trace number] == $number} {
                        return [$self hide $name [expr {![dict get $trace hidden]}]]
                    }
                }
            }
        }
        set grip [list $x $shown]
    }
    method Twice {x y} {
        $self Grip $x $y
        if {$grip ne {}} {
            $self pause 0
        }
    }
    method Drag x {
        if {$grip eq {}} return
        lassign $grip from was
        if {$options(-paused) || abs($x - $from) > 3} {
            $self go [expr {$was + ([$self Part $from] - [$self Part $x]) * $options(-span) - $shown}]
            $self Point $x 1
        }
    }
    method Now {} {
        return [expr {([clock milliseconds] - $origin) / 1000.0}]
    }
    # Add new values to the traces; remove those that are too old.
    method Take {} {
        set old [expr {[$self Now] - max($options(-span), $options(-keep))}]
        dict for {name points} $fresh {
            set series [dict get $traces $name series]
            foreach {t v} $points {
                $series add $t $v
            }
            $series forget $old
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
        if {$options(-paused) || ![winfo ismapped $canvas]} {
            return [$self Take]         ;# drawn when it goes on, or is seen again
        }
        set points [$self Take]
        set now [$self Now]
        set perSecond [expr {[$self Wide] / double($options(-span))}]
        set moved [expr {int(($now - $shown) * $perSecond)}]
        if {$moved > 0} {
            $canvas move points -$moved 0
            set shown [expr {$shown + $moved / $perSecond}]
        }
        dict for {name new} $points {
            incr added [llength $new]
        }
        if {[dict size $points] > 0 && (![$self Fits $points] || $added > 8 * [winfo width $canvas])} {
            return [$self Rebuild]
        }
        dict for {name new} $points {
            if {![dict get $traces $name hidden]} {
                $self Append $name $new
            }
        }
        $self Hold
        if {$cursor ne {}} {
            $self Point {*}$cursor
        }
    }
    # Values that hold reach to the right edge.
    method Hold {} {
        dict for {name trace} $traces {
            lassign [[dict get $trace series] last] t v
            set id tail[dict get $trace number]
            if {![dict get $trace holds] || [dict get $trace hidden] || $v eq {} || ![::sorma::chartAxis::isNumber $v] || $t > $shown} {
                $canvas delete $id
                continue
            }
            set place [list [$self X $t] [$self Y $v] [lindex $area 2] [$self Y $v]]
            if {[$canvas find withtag $id] eq {}} {
                $canvas create line $place -fill [$self Colour $name] -width [::sorma::style pixels 1.5] -tags [list tail $id]
                $canvas lower $id mask
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
        dict for {name values} $points {
            if {[dict get $traces $name hidden]} continue
            foreach {t v} $values {
                if {!($v >= $low && $v <= $high)} {
                    return 0
                }
            }
        }
        return 1
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
        while {$gone + 6 <= $n && [lindex $coordinates $gone+2] < [lindex $area 0]} {
            incr gone 2
        }
        if {$gone > 0} {
            $canvas dchars $id 0 [expr {$gone - 1}]
        }
    }
    # The scale that shows all numbers, in steps of 1, 2, 5.
    method Range {} {
        set all {}
        set from [expr {$shown - $options(-span)}]
        dict for {name trace} $traces {
            if {[dict get $trace hidden]} continue
            set series [dict get $trace series]
            lappend all {*}[$series range $from $shown]
            set before [lindex [$series at $from] 1]
            if {$before ne {} && [::sorma::chartAxis::isNumber $before]} {
                lappend all $before
            }
        }
        return [::sorma::chartAxis::range $all $options(-low) $options(-high)]
    }
    # Draw all of it again.
    method Rebuild {} {
        if {$canvas eq {} || ![winfo exists $canvas] || [winfo width $canvas] < 10} return
        $self Take
        if {!$options(-paused)} {
            set shown [$self Now]
        }
        set added 0
        set scale [$self Range]
        $canvas delete all
        $canvas configure -background [ttk::style lookup TEntry -fieldbackground {} white]
        $self Areas
        $self Grid
        dict for {name trace} $traces {
            if {[dict get $trace hidden]} continue
            $self Lines $name
        }
        $self Masks
        $self Texts
        $self Legend
        $self Hold
        if {$cursor ne {}} {
            $self Point {*}$cursor
        }
    }
    # All of a trace, from gap to gap. X and Y stand here once more: called for each point, they would take most of the time.
    method Lines name {
        set trace [dict get $traces $name]
        set holds [dict get $trace holds]
        set series [dict get $trace series]
        lassign $area left top right bottom
        lassign $scale low high
        set perSecond [expr {($right - $left) / double($options(-span))}]
        set perUnit [expr {($bottom - $top) / double($high - $low)}]
        set to [tcl::mathfunc::max $shown {*}[if {!$options(-paused)} {lindex [$series last] 0}]]
        set part {}
        foreach {t v} [$series drawn [expr {$shown - $options(-span)}] $to [expr {max(10, int($right - $left))}]] {
            if {!($v > -1e300 && $v < 1e300)} {
                $self Line $name $part
                set part {}
                continue
            }
            set x [expr {$right - ($shown - $t) * $perSecond}]
            if {$holds && $part ne {}} {
                lappend part $x $y
            }
            lappend part $x [set y [expr {$bottom - ($v - $low) * $perUnit}]]
        }
        $self Line $name $part
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
        # Dashes of a dense line would be a line, and a thin one draws in half of the time.
        set sparse [expr {[llength $coordinates] < 4 * [winfo width $canvas]}]
        set dash [if {$sparse} {::sorma::chartAxis::dash [dict get $traces $name number]}]
        $canvas create line $coordinates -fill [$self Colour $name] -width [::sorma::style pixels [expr {$sparse ? 1.5 : 1}]] -dash $dash -tags [list points line $name]
    }
    method Menu {menu window} {
        $menu add command -label [::msgcat::mc [expr {$options(-paused) ? "Go on" : "Pause"}]] -accelerator space -command [mymethod pause]
        $menu add command -label [::msgcat::mc "Shorter"] -accelerator + -command [mymethod zoom 0.5]
        $menu add command -label [::msgcat::mc "Longer"] -accelerator - -command [mymethod zoom 2]
        $menu add command -label [::msgcat::mc "Earlier"] -accelerator Left -command [mymethod Leaf -0.25]
        $menu add command -label [::msgcat::mc "Later"] -accelerator Right -command [mymethod Leaf 0.25]
        $menu add command -label [::msgcat::mc "Clear"] -command [mymethod clear]
        $menu add command -label [::msgcat::mc "Save ..."] -command [mymethod Save]
    }
    method Save {} {
        set file [tk_getSaveFile -parent $win -filetypes {{Table .csv} {Picture .png} {{Vector picture} .pdf} {PostScript .ps}}]
        if {$file ne {} && [catch {$self export $file} message]} {
            $canvas create text 4 [expr {[winfo height $canvas] - 4}] -anchor sw -text $message -fill [::sorma::style colour refused]
        }
    }
}
