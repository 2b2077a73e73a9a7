# timeline.tcl -- sorma::timeline: what is in a recording of the bus, on a line of time: a row for each daemon, and for each of its objects.
#
# An object of class recorder reads the file and makes what is drawn, here or at another daemon. It is asked behind the scenes, so the window never
# waits. One question is under way at a time; what is seen is moved at once, and drawn finely when the answer has come.

package require Tk
package require snit
package require sorma
package require sorma::options
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::timelineDraw
package require sorma::timelineFollow
package require sorma::timelineSearch
package require sorma::timelineText
package provide sorma::timeline 1.0

# ::sorma::timeline .w ?-file FILE? ?-name RECORDER? --
# Options:
#       -file FILE              a recording of the bus; it is read by an object of our own
#       -name RECORDER          or an object of class recorder, here or elsewhere: its file, also while it records
# Methods:
#       view ?FROM UNTIL?       the times that are seen [ns since 1970]; or be it those
#       all                     all of the recording; again: read it again
#       follow ?BOOLEAN?        read what is written meanwhile, each second while it can be seen, and keep the end in sight
#       zoom FACTOR ?X?         about a pixel; go PART: of what is seen, to the right
#       fold SOURCE             its objects away, or again
#       failed next|previous    the next one, from the chosen one on
#       show ROW TIME           what is there; choose ROW: 0 is the first one
#       search TEXT             the next record behind the chosen one with that text
#       facts                   what the recorder says of the file; rows: {SOURCE OBJECT MARKS FAILED SLOWEST ...}; text: what stands below
#       idle                    nothing is under way
# Wheel: zoom; Shift-wheel: rows; drag: earlier, later; a click shows what is there. Keys: arrows, + - Home End, 0 all, Tab and Shift-Tab from one
# that has failed to the next one, Return shows, space folds, F follows, F5 reads again.
snit::widget ::sorma::timeline {
    hulltype ttk::frame
    option -file -default {} -readonly 1
    option -name -default {} -readonly 1
    component canvas
    ::sorma::timelineDraw
    ::sorma::timelineFollow
    ::sorma::timelineSearch
    typevariable Last 0
    typevariable Most 100000    ;# characters of a record that are shown
    variable recorder {}
    variable tracks {}          ;# list of {SOURCE OBJECT MARKS FAILED SLOWEST}: all
    variable rows {}            ;# those that have a row
    variable folded {}          ;# sources without their objects
    variable facts {done 0 error {} first 0 last 0 complete 1}
    variable trouble {}         ;# why there is no answer
    variable top 0              ;# number of the first row that is seen
    variable row 0              ;# of the row that the keys are at
    variable from 0             ;# ns, at the left edge
    variable until 1000000000
    variable whole 1            ;# all of it is seen, also when it grows
    variable selected {}        ;# {SOURCE OBJECT TIME}
    variable said {}            ;# text below
    variable asks 0             ;# questions without an answer
    variable waiting 0          ;# drawings that were asked for, and have not come
    variable again 0            ;# what is drawn is not what is wanted any more
    variable timer {}
    variable grip {}            ;# {x from moved}, where the picture is held
    variable wanted {}          ;# part of the names
    variable seeking 0
    variable state {}           ;# what the line says
    variable none {next {} previous {}}     ;# times behind which there was none that has failed

    constructor args {
        $self configurelist $args
        if {($options(-file) eq {}) == ($options(-name) eq {})} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "a time line needs one of -file and -name"
        }
        package require sorma::service::recorder
        set recorder $options(-name)
        if {$recorder eq {}} {
            set recorder [::sorma::create recorder.timeline[pid]x[incr Last] -file [file normalize $options(-file)]]
        }
        $hull configure -style Page.TFrame
        $self Build
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        bind $win <<ThemeChanged>> [mymethod Looks]
        $self Looks
        $self Ask [mymethod Begun] read
    }
    method Ended window {
        if {$window ne $win} return
        after cancel $timer
        after cancel $followTimer
        if {$options(-file) ne {} && $recorder ne {}} {
            catch {::sorma::remove $recorder}
        }
    }

    method Build {} {
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        ttk::frame $win.bar -style Page.TFrame
        ttk::label $win.bar.nameLabel -text [::msgcat::mc "Name"] -style Page.TLabel
        ttk::entry $win.bar.name -width 14 -textvariable [myvar wanted]
        ttk::label $win.bar.textLabel -text [::msgcat::mc "Text"] -style Page.TLabel
        ttk::entry $win.bar.text -width 14 -textvariable [myvar needle]
        ttk::frame $win.bar.do -style Page.TFrame
        ttk::button $win.bar.do.previous -text "\u25c2 [::msgcat::mc "Failed"]" -command [mymethod failed previous]
        ttk::button $win.bar.do.next -text "[::msgcat::mc "Failed"] \u25b8" -command [mymethod failed next]
        ttk::button $win.bar.do.all -text [::msgcat::mc "All"] -command [mymethod all]
        ttk::checkbutton $win.bar.do.follow -style Page.TCheckbutton -text [::msgcat::mc "Follow"] -variable [myvar following] -command [mymethod Followed]
        ttk::button $win.bar.do.again -text [::msgcat::mc "Read again"] -command [mymethod again]
        pack {*}[winfo children $win.bar.do] -side left -padx [list 0 $pad]
        grid $win.bar.nameLabel $win.bar.name $win.bar.textLabel $win.bar.text -sticky ew -padx [list 0 $pad]
        grid columnconfigure $win.bar {1 3} -weight 1
        bind $win.bar <Configure> [mymethod Bar %w]
        $self Bar 10000
        ttk::panedwindow $win.panes -orient vertical
        ttk::frame $win.panes.line
        install canvas using canvas $win.panes.line.canvas -width [::sorma::style pixels 720] -height [::sorma::style pixels 300] -highlightthickness [::sorma::style pixels 2] -takefocus 1 -borderwidth 0
        ttk::scrollbar $win.panes.line.bar -style [::sorma::style own Vertical.TScrollbar] -command [mymethod Scroll]
        pack $win.panes.line.bar -side right -fill y
        pack $canvas -side left -fill both -expand 1
        ttk::frame $win.panes.below
        ::sorma::style text $win.panes.below.text {head asking error refused} -wrap word -width 60 -height 9 -state disabled \
            -padx [::sorma::style pixels 12] -pady [::sorma::style pixels 8] -yscrollcommand [list $win.panes.below.bar set]
        $win.panes.below.text tag configure head -spacing1 [::sorma::style pixels 6]
        ttk::scrollbar $win.panes.below.bar -style [::sorma::style own Vertical.TScrollbar] -command [list $win.panes.below.text yview]
        pack $win.panes.below.bar -side right -fill y
        pack $win.panes.below.text -side left -fill both -expand 1
        $win.panes add $win.panes.line -weight 3
        $win.panes add $win.panes.below -weight 1
        ttk::label $win.state -style Page.TLabel -anchor w -width 1 -textvariable [myvar state]
        pack $win.bar -side top -fill x -padx $edge -pady [list $edge $pad]
        pack $win.state -side bottom -fill x -padx $edge -pady [list $pad $pad]
        pack $win.panes -fill both -expand 1 -padx $edge
        trace add variable [myvar wanted] write [mymethod Filtered]
        bind $win.bar.text <Return> [mymethod Seek]
        bind $win.bar.name <Return> [list focus $canvas]
        bind $canvas <Configure> [mymethod Resized]
        bind $canvas <ButtonPress-1> [mymethod Grip %x %y]
        bind $canvas <B1-Motion> [mymethod Drag %x]
        bind $canvas <ButtonRelease-1> [mymethod Released %x %y]
        foreach {event script} {
            <Left> {go -0.25} <Right> {go 0.25} <Up> {Step -1} <Down> {Step 1} <Prior> {Step -10} <Next> {Step 10} <plus> {zoom 0.5} <KP_Add> {zoom 0.5}
            <minus> {zoom 2} <KP_Subtract> {zoom 2} <Home> {Edge 0} <End> {Edge 1} <Key-0> all <Return> {Enter} <space> {Fold} <Key-f> {follow toggle} <F5> again
            <Shift-MouseWheel> {Turn %D} <MouseWheel> {Wheel %x %D} <Button-4> {Wheel %x 120} <Button-5> {Wheel %x -120}
            <Shift-Button-4> {Turn 120} <Shift-Button-5> {Turn -120}
        } {
            bind $canvas $event "[mymethod {*}$script]; break"
        }
        # At the last one, Tab goes on to the next window as everywhere.
        bind $canvas <Tab> [mymethod Tabbed next %W]
        bind $canvas <<PrevWindow>> [mymethod Tabbed previous %W]
        bind $canvas <Control-Tab> {tk::TabToWindow [tk_focusNext %W]; break}
        bind $canvas <FocusIn> [mymethod Looks]
        bind $canvas <Map> +[mymethod Followed]
    }
    # In a narrow window the buttons have a row of their own.
    method Bar width {
        set need [expr {[winfo reqwidth $win.bar.nameLabel] + [winfo reqwidth $win.bar.textLabel] + [winfo reqwidth $win.bar.do] + [::sorma::style pixels 240]}]
        if {$width >= $need} {
            grid $win.bar.do -row 0 -column 4 -columnspan 1 -sticky w -pady 0
        } else {
            grid $win.bar.do -row 1 -column 0 -columnspan 4 -sticky w -pady [list [::sorma::style pixels 8] 0]
        }
    }
    method Looks {} {
        $canvas configure -background [$self Ground] -highlightbackground [::sorma::style token line] -highlightcolor [::sorma::style token accent]
        $self Redraw
    }

    # ---- asking ----

    # The answer goes to PREFIX, ok or error and the text; not when this window is gone.
    method Ask {prefix args} {
        incr asks
        if {[catch {::sorma::async -timeout 60000 -command [list ::sorma::parts::answer [mymethod Answered] $prefix] $recorder EXEC timeline {*}$args} message]} {
            after idle [list ::sorma::parts::answer [mymethod Failure] $prefix $message]
        }
    }
    method Failure {prefix message} {
        incr asks -1
        {*}$prefix error $message
    }
    method Answered {prefix future} {
        incr asks -1
        if {[catch {$future take} answer]} {
            {*}$prefix error $answer
        } else {
            {*}$prefix ok [lindex $answer 3]
        }
    }
    method Begun {status answer} {
        if {$status eq "error"} {
            set trouble $answer
            set growing 0
            $self Say
            return [$self Redraw]
        }
        set trouble {}
        if {[$self Unchanged $answer]} return
        set facts $answer
        $self Ask [mymethod Tracks] tracks
    }
    method Tracks {status answer} {
        if {$status eq "error"} {
            return [$self Begun error $answer]
        }
        set sources [lsort -dictionary -unique [lmap track $tracks {lindex $track 0}]]
        set tracks [lsort -dictionary -index 0 [lsort -dictionary -index 1 $answer]]
        # Many objects are behind their daemons at first.
        foreach source [lsort -unique [lmap track $tracks {lindex $track 0}]] {
            if {$source ni $sources && [llength $tracks] > 20} {
                lappend folded $source
            }
        }
        if {$whole} {
            $self Whole
        }
        $self Rows
        $self KeepEnd
        $self Say
        if {[dict get $facts done] < 1} {
            set timer [after 200 [mymethod Ask [mymethod Begun] about]]
        } else {
            set growing 0
        }
    }
    method Whole {} {
        set first [::sorma::timelineText::ns [dict get $facts first]]
        set last [::sorma::timelineText::ns [dict get $facts last]]
        set beside [expr {($last - $first) / 100 + 1000}]
        lassign [list [expr {max(0, $first - $beside)}] [expr {$last + $beside}]] from until
    }
    method Trouble {} {
        return [expr {$trouble ne {} ? $trouble : [dict get $facts error]}]
    }
    method Say {} {
        set parts {}
        if {[$self Trouble] ne {}} {
            lappend parts "[::sorma::style mark refused] [$self Trouble]"
        }
        if {$trouble eq {} && !$growing && [dict get $facts done] < 1} {
            lappend parts "[::msgcat::mc "reading"] [expr {int(100 * [dict get $facts done])}] %"
        }
        if {[dict exists $facts marks]} {
            lappend parts "[dict get $facts marks] [::msgcat::mc "requests, events and records"]"
        }
        if {![dict get $facts complete]} {
            lappend parts "[::sorma::style mark warn] [::msgcat::mc "there are more than can be shown: the rest is left out"]"
        }
        if {$rows ne {}} {
            lappend parts "[::sorma::timelineText::at $from 1000000] \u2013 [::sorma::timelineText::at $until 1000000]  ([::sorma::timelineText::span [expr {$until - $from}]])"
        }
        set state [::sorma::text::clean [join $parts {   }]]
    }
    method idle {} {
        return [expr {!$asks && !$waiting && !$again && !$seeking && !$growing && ($trouble ne {} || [dict get $facts done] >= 1)}]
    }

    # ---- rows ----

    method Wanted {} {
        return $wanted
    }
    method Filtered args {
        $self Rows
    }
    method Rows {} {
        set rows [lmap track $tracks {
            lassign $track source object
            if {$object ne {} && ($wanted eq {} ? $source in $folded : ![string match -nocase *[::sorma::text::escape $wanted]* $object@$source])} continue
            set track
        }]
        set row [expr {max(0, min($row, [llength $rows] - 1))}]
        $self See
        $self Redraw
    }
    method See {} {
        set room [$self Room]
        set top [expr {max(0, min($top, $row, [llength $rows] - 1))}]
        set top [expr {max($top, $row - $room + 1)}]
    }
    method Scroll {what args} {
        set room [$self Room]
        lassign $args count unit
        set top [switch $what {
            moveto { expr {round($count * [llength $rows])} }
            scroll { expr {$top + $count * ($unit eq "pages" ? $room : 1)} }
        }]
        set top [expr {max(0, min($top, [llength $rows] - $room))}]
        $self Redraw
    }
    method Turn delta {
        $self Scroll scroll [expr {$delta > 0 ? -3 : 3}] units
    }
    method Step count {
        $self choose [expr {$row + $count}]
    }
    method choose n {
        set row [expr {max(0, min($n, [llength $rows] - 1))}]
        $self See
        $self Redraw
    }
    method Fold {} {
        if {$rows ne {}} {
            $self fold [lindex $rows $row 0]
        }
    }
    method fold source {
        set folded [expr {$source in $folded ? [lsearch -all -inline -exact -not $folded $source] : [concat $folded [list $source]]}]
        set row [expr {max(0, [lsearch -exact -index 0 $rows $source])}]
        $self Rows
    }

    # ---- views ----

    method view args {
        if {$args ne {}} {
            lassign $args first last
            $self Show $first $last
        }
        return [list $from $until]
    }
    # Between 100 ns and three times what there is.
    method Show {first last} {
        set whole 0
        set was [list $from $until]
        set most [expr {3 * max(1000, [::sorma::timelineText::ns [dict get $facts last]] - [::sorma::timelineText::ns [dict get $facts first]]) + 1000000}]
        set span [expr {min($most, max(100, $last - $first))}]
        set middle [expr {($first + $last) / 2}]
        set low [expr {[::sorma::timelineText::ns [dict get $facts first]] - $span}]
        set most [expr {[::sorma::timelineText::ns [dict get $facts last]] + $span}]
        set from [expr {max(0, $low, min($middle - $span / 2, $most - $span))}]
        set until [expr {$from + $span}]
        $self Left $was
        $self Placed $was
        $self Axis
        $self Select
        $self Say
        $self Redraw
    }
    method all {} {
        set was [list $from $until]
        $self Whole
        $self Show $from $until
        set whole 1
    }
    method zoom {factor {x {}}} {
        set about [expr {$x ne {} ? max($left, $x) : [$self Anchor]}]
        set time [$self TimeAt $about]
        set part [expr {double($about - $left) / [$self Wide]}]
        set span [expr {max(100, round(($until - $from) * double($factor)))}]
        set first [expr {$time - round($span * $part)}]
        $self Show $first [expr {$first + $span}]
    }
    # The chosen mark stays at its place, if it is seen; else the middle does.
    method Anchor {} {
        set x [if {$selected ne {}} {$self X [lindex $selected 2]} else {string cat -1}]
        return [expr {$x >= $left && $x <= [winfo width $canvas] ? $x : $left + [$self Wide] / 2}]
    }
    method go part {
        set by [expr {round($part * ($until - $from))}]
        $self Show [expr {$from + $by}] [expr {$until + $by}]
    }
    method Edge end {
        set span [expr {$until - $from}]
        set beside [expr {$span / 20}]
        set first [expr {$end ? [::sorma::timelineText::ns [dict get $facts last]] + $beside - $span : [::sorma::timelineText::ns [dict get $facts first]] - $beside}]
        $self Show $first [expr {$first + $span}]
    }
    method Wheel {x delta} {
        if {$x < $left} {
            return [$self Turn $delta]
        }
        $self zoom [expr {$delta > 0 ? 0.8 : 1.25}] $x
    }
    method again {} {
        after cancel $timer
        set growing 0
        $self Ask [mymethod Begun] read
    }

    # ---- drawing ----

    method Resized {} {
        $self Measures
        $self Redraw
    }
    # Once in a turn of the event loop, and one question at a time.
    method Redraw {} {
        set again $waiting
        if {$waiting} return
        set waiting 1
        after idle [list ::sorma::parts::answer [mymethod AskRows]]
    }
    method AskRows {} {
        set again 0
        $self Measures
        set count [llength $rows]
        set room [$self Room]
        set top [expr {max(0, min($top, $count - $room))}]
        $win.panes.line.bar set [expr {$count > 0 ? double($top) / $count : 0}] [expr {$count > 0 ? min(1.0, double($top + $room) / $count) : 1}]
        set which [$self Visible]
        set view [list $from $until]
        if {$which eq {}} {
            $self Paint {} $view {}
            set waiting 0
            return
        }
        $self Ask [mymethod Drawn $which $view] draw [::sorma::timelineText::seconds $from] [::sorma::timelineText::seconds $until] [$self Wide] \
            {*}[concat {*}[lmap item $which {lrange $item 0 1}]]
    }
    method Drawn {which view status answer} {
        set waiting 0
        if {$status eq "error"} {
            set trouble $answer
            return [$self Say]
        }
        if {$which eq [$self Visible]} {
            $self Paint $which $view $answer
        }
        $self Say
        if {$again} {
            $self Redraw
        }
    }

    # ---- what is there ----

    method Grip {x y} {
        focus $canvas
        set n [$self RowAt $y]
        set grip {}
        if {$n >= 0} {
            set row $n
            if {$x < $left && [lindex $rows $n 1] eq {}} {
                return [$self Fold]
            }
            $self Names [$self Visible]
        }
        if {$x >= $left} {
            set grip [list $x $from 0]
        }
    }
    method Drag x {
        if {$grip eq {}} return
        lassign $grip begin was moved
        if {!$moved && abs($x - $begin) <= [::sorma::style pixels 3]} return
        set grip [list $begin $was 1]
        set first [expr {$was - round(double($x - $begin) * ($until - $from) / [$self Wide])}]
        $self Show $first [expr {$first + $until - $from}]
    }
    method Released {x y} {
        set held $grip
        set grip {}
        if {$held eq {} || [lindex $held 2] || [$self RowAt $y] < 0} return
        $self show [$self RowAt $y] [$self TimeAt $x]
    }
    # The chosen mark, or the one next to the middle.
    method Enter {} {
        if {$rows ne {}} {
            $self show $row [$self TimeAt [$self Anchor]] [expr {$selected ne {} ? {} : ($until - $from) / 2}]
        }
    }
    method show {n time {within {}}} {
        lassign [lindex $rows $n] source object
        if {$within eq {}} {
            set within [expr {([$self TimeAt [::sorma::style pixels 4]] - [$self TimeAt 0])}]
        }
        incr seeking
        $self Ask [mymethod Shown $source $object] mark [::sorma::timelineText::seconds $time] [::sorma::timelineText::seconds [expr {max(1, $within)}]] $source $object
    }
    method Shown {source object status mark} {
        incr seeking -1
        if {$status eq "error"} {
            return [$self Put [list error $mark]]
        }
        if {$mark eq {}} {
            set selected {}
            $self Select
            return [$self Put [list plain [::msgcat::mc "There is nothing at that place."]]]
        }
        set selected [list $source $object [::sorma::timelineText::ns [dict get $mark time]]]
        $self Select
        $self Put [::sorma::timelineText::mark $mark]
    }
    # Strangers write as much as they like: not all of a megabyte is shown.
    method Put parts {
        set said {}
        $win.panes.below.text configure -state normal
        $win.panes.below.text delete 1.0 end
        foreach {tag text} $parts {
            set text [::sorma::text::clean $text]
            if {[string length $text] > $Most} {
                set text "[string range $text 0 $Most-1]\u2026"
            }
            lappend said $text
            $win.panes.below.text insert end $text\n $tag
        }
        $win.panes.below.text configure -state disabled
    }
    method text {} {
        return [join $said \n]
    }
    method rows {} {
        return $rows
    }
    method facts {} {
        return $facts
    }
    method selected {} {
        return $selected
    }

    # ---- the next one ----

    # Is there one that has failed, as far as is known? After the last one, Tab goes on.
    method Tabbed {direction window} {
        if {[dict get $none $direction] eq [$self Where $direction] || [tcl::mathop::+ {*}[lmap item $rows {lindex $item 3}]] == 0} {
            return -code continue
        }
        $self failed $direction
        return -code break
    }
    method Where direction {
        return [expr {$selected ne {} ? [lindex $selected 2] : $direction eq "next" ? $from - 1 : $until}]
    }
    method failed direction {
        if {$rows eq {}} return
        set time [$self Where $direction]
        incr seeking
        # An object has the same as its daemon.
        set asked {}
        foreach item $rows {
            lassign $item source object
            if {$object ne {} || $source in $folded || [lsearch -exact -index 0 $rows $source] == [lsearch -exact -index 0 -start end $rows $source]} {
                lappend asked $source $object
            }
        }
        $self Ask [mymethod Next $direction $time] $direction [::sorma::timelineText::seconds $time] {*}$asked
    }
    method Next {direction time status mark} {
        incr seeking -1
        if {$status eq "error" || $mark eq {}} {
            dict set none $direction $time
            return [$self Put [if {$status eq "error"} {list error $mark} else {list plain [::msgcat::mc "None has failed there."]}]]
        }
        set none {next {} previous {}}
        set place [list [dict get $mark source] [dict get $mark object]]
        set at [::sorma::timelineText::ns [dict get $mark time]]
        $self GoTo $place $at
        $self show $row $at 1
    }
    # A row and a time come into sight.
    method GoTo {place at} {
        set row [lsearch -exact [lmap item $rows {lrange $item 0 1}] $place]
        if {$row < 0} {
            set row [lsearch -exact [lmap item $rows {lrange $item 0 1}] [list [lindex $place 0] {}]]
        }
        set row [expr {max(0, $row)}]
        $self See
        if {$at < $from || $at > $until} {
            set half [expr {($until - $from) / 2}]
            $self Show [expr {$at - $half}] [expr {$at + $half}]
        } else {
            $self Redraw
        }
    }
}
