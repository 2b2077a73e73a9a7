# dashboard.tcl -- sorma::dashboard: values, charts, lamps, buttons and pictures of any objects in one window, on a grid, as a file. It grows with
# its window: full-screen on a wall it can be read from far away.
#
# A file has a line for each part; boardFile.tcl reads it. Columns are 24, rows at least 12.

package require Tk
package require snit
package require sorma::arrangement
package require sorma::boardFile
package require sorma::boardGrid
package require sorma::parts
package require sorma::text
package provide sorma::dashboard 1.0

# ::sorma::dashboard .w ?-file FILE? ?-wall BOOL? --
#       Options: -file: what it shows, and where it is saved; -wall 1: full-screen and read-only: buttons do nothing. F11 changes that, Escape ends it
# Methods:
#       parts                           list of {KIND SETTINGS}, with -at
#       add KIND SETTINGS ?PLACE?       one more part, at {COLUMN ROW WIDTH HEIGHT}, or where there is room; returns its number
#       offer NAME -OPTION ?X Y?        an option, as what fits it; at pixels of the screen: there, or as one more line of the chart that is there
#       place N PLACE, remove N         others give way
#       edit ?BOOL?                     are parts moved by mouse and keys
#       text, read TEXT, save ?FILE?    as text; undo: the last change
#       window N                        its widget
snit::widget ::sorma::dashboard {
    hulltype ttk::frame
    option -file -default {} -configuremethod SetFile
    option -wall -default 0 -type snit::boolean -configuremethod SetWall
    variable parts {}           ;# dict: number -> {KIND SETTINGS}; without -at
    variable places {}          ;# dict: number -> place, as boardGrid.tcl has it
    variable last 0             ;# number that was given last
    variable past {}            ;# list of {parts places}, before each change
    variable saved {}           ;# what the file has, as text
    variable editing 0
    variable before {}          ;# geometry of the window before it was on a wall
    variable chosen {}          ;# part that keys are about
    variable grip {}            ;# while the mouse holds a part: {number move|size x y place}
    variable ghost {}           ;# place where it would be

    constructor args {
        ttk::frame $win.bar -style Card.TFrame
        ttk::label $win.bar.say -style Quiet.TLabel
        ttk::button $win.bar.save -text [::msgcat::mc "Save"] -style Accent.TButton -underline 0 -command [mymethod Done]
        ttk::button $win.bar.undo -text [::msgcat::mc "Undo"] -underline 0 -command [mymethod undo]
        set gap [::sorma::style pixels 8]
        pack $win.bar.save $win.bar.undo -side right -padx [list 0 $gap] -pady $gap
        pack $win.bar.say -side left -padx $gap
        ttk::frame $win.area -style Page.TFrame -takefocus 1 -width [::sorma::style pixels 960] -height [::sorma::style pixels 600]
        ttk::label $win.area.none -style Page.TLabel -justify center -text [::msgcat::mc "Nothing is here yet: drag the name of an option from a panel to this window,\nor choose \"On a dashboard\" in the menu of a field."]
        frame $win.area.ghost -borderwidth 0 -highlightthickness [::sorma::style pixels 2]
        pack $win.area -fill both -expand 1
        foreach kind {title plain small strong} {
            ::font create $win.$kind
        }
        ::font configure $win.strong -weight bold
        ttk::style configure $win.TButton -font $win.plain
        bind $win.area <Configure> [mymethod Lay]
        $self Bind
        $self configurelist $args
        $self Lay
    }
    destructor {
        catch {::font delete $win.title $win.plain $win.small $win.strong}
        ::sorma::style untag SormaBoard$win SormaBoardKeys$win
    }

    # ---- what programs say ----

    method parts {} {
        return [lmap {n part} $parts {list [lindex $part 0] [dict replace [lindex $part 1] -at [dict get $places $n]]}]
    }
    method text {} {
        return [::sorma::arrangement text [$self parts]]
    }
    method read {text {where dashboard}} {
        lassign [::sorma::arrangement parse $text $where parts] read wrong
        if {$wrong ne {}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} [join $wrong \n]
        }
        $self Forget
        foreach part $read {
            lassign $part kind settings
            $self Add $kind [dict remove $settings -at] [if {[dict exists $settings -at]} {dict get $settings -at}]
        }
        set saved [$self text]
        set past {}
        $self Lay
    }
    method save {{file {}}} {
        if {$file ne {}} {
            set options(-file) [file normalize $file]
        }
        ::sorma::text::writeFile $options(-file) [set text [$self text]]
        set saved $text
        return $options(-file)
    }
    method add {kind settings {place {}}} {
        $self Remember
        set n [$self Add $kind $settings $place]
        $self Lay
        return $n
    }
    method offer {name what {x {}} {y {}}} {
        $self edit 1
        set facts [dict create type double]
        set subject [::sorma::subject of $name]
        catch {set facts [$subject option $what]}
        $subject release
        set at [if {$x ne {}} {$self Under $x $y}]
        if {$at ne {} && [lindex [dict get $parts $at] 0] eq "stripchart"} {
            $self Remember
            lassign [dict get $parts $at] kind settings
            dict lappend settings -plot [list $name $what {*}[if {[dict get $facts type] eq "vector"} {list -index 0}]]
            dict set parts $at [list $kind $settings]
            $self Make $at
            return $at
        }
        lassign [::sorma::boardGrid::part $name $what $facts] kind settings width height
        set n [$self add $kind $settings [if {$x ne {}} {concat [$self Cell $x $y] $width $height} else {::sorma::boardGrid::free $places $width $height}]]
        $self Choose $n
        return $n
    }
    method place {n place} {
        $self Remember
        dict set places $n $place
        set places [::sorma::boardGrid::settle $places $n]
        $self Lay
    }
    method remove n {
        $self Remember
        destroy $win.area.p$n
        dict unset parts $n
        dict unset places $n
        if {$chosen eq $n} {
            set chosen {}
        }
        $self Lay
    }
    method undo {} {
        if {$past eq {}} return
        lassign [lindex $past end] parts places
        set past [lrange $past 0 end-1]
        destroy {*}[lmap child [winfo children $win.area] {if {![string match *.p* $child]} continue; set child}]
        foreach n [dict keys $parts] {
            $self Make $n
        }
        $self Choose {}
        $self Lay
    }
    method edit {{on {}}} {
        if {$on ne {} && $on != $editing && !($on && $options(-wall))} {
            set editing [expr {bool($on)}]
            if {$editing} {
                pack $win.bar -before $win.area -fill x
            } else {
                pack forget $win.bar
                $self Choose {}
            }
            $self Say [::msgcat::mc "Drag a part to move it, its lower right corner to size it. Delete removes it."]
            foreach n [dict keys $parts] {
                $self Held $n
            }
        }
        return $editing
    }
    method window n {
        return $win.area.p$n.w
    }

    # ---- the file, the screen ----

    method SetFile {option value} {
        set options($option) [if {$value ne {}} {file normalize $value}]
        if {$value ne {} && [file exists $value]} {
            $self read [::sorma::text::readFile $value] $value
        }
    }
    method SetWall {option value} {
        set options($option) $value
        if {$value} {
            $self edit 0
        }
        after idle [list ::sorma::parts::answer [mymethod Screen]]           ;# whoever opens the window places it first
        dict for {n part} $parts {
            if {[lindex $part 0] eq "button"} {
                [$self window $n] configure -state [expr {$value ? "disabled" : "normal"}]
            }
        }
    }
    # All of the screen, also where no window manager makes it so; and back.
    method Screen {} {
        set top [winfo toplevel $win]
        if {$options(-wall) == ($before ne {})} return
        wm attributes $top -fullscreen $options(-wall)
        set now [wm geometry $top]
        wm geometry $top [expr {$options(-wall) ? "[winfo screenwidth $top]x[winfo screenheight $top]+0+0" : $before}]
        set before [if {$options(-wall)} {set now}]
    }
    method Done {} {
        if {$options(-file) eq {}} {
            set file [tk_getSaveFile -parent $win -defaultextension .dash -filetypes {{Dashboard .dash} {All *}}]
            if {$file eq {}} return
            set options(-file) $file
        }
        if {[catch {$self save} message]} {
            return [$self Say $message refused]
        }
        $self edit 0
    }
    method Say {text {state asking}} {
        $win.bar.say configure -text $text -foreground [::sorma::style colour $state]
    }

    # ---- parts ----

    method Remember {} {
        set past [lrange [linsert $past end [list $parts $places]] end-49 end]
    }
    method Forget {} {
        foreach n [dict keys $parts] {
            destroy $win.area.p$n
        }
        set parts [set places {}]
        set chosen {}
    }
    method Add {kind settings place} {
        set n [incr last]
        if {$place eq {}} {
            set place [::sorma::boardGrid::free $places {*}[::sorma::boardFile::size $kind]]
        }
        dict set parts $n [list $kind $settings]
        dict set places $n $place
        set places [::sorma::boardGrid::settle $places $n]
        $self Make $n
        return $n
    }
    # The card of a part: its title, and what it shows; or why it cannot.
    method Make n {
        lassign [dict get $parts $n] kind settings
        set card $win.area.p$n
        destroy $card
        ttk::frame $card -style Card.TFrame
        ttk::label $card.title -text [::sorma::boardFile::title $kind $settings] -font $win.title -anchor w {*}[if {$kind ne "text"} {list -style Quiet.TLabel}]
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        if {$kind eq "text"} {
            $card.title configure -font $win.strong
            pack $card.title -fill both -expand 1 -padx $edge -pady [::sorma::style pixels 2]           ;# within the edge of the card
            return [$self Held $n]
        }
        if {$kind ne "button"} {
            pack $card.title -fill x -padx $edge -pady [list $pad 0]
        }
        if {[catch {$self Content $kind $settings $card.w} message]} {
            destroy $card.w
            ttk::label $card.w -text "[::sorma::style mark refused] $message" -foreground [::sorma::style colour refused] -wraplength [::sorma::style pixels 200]
        }
        # The lamp of a button stands at its right, in the margin.
        pack $card.w -fill both -expand 1 -padx [dict get [dict merge [list $kind $edge] [list image $pad stripchart $pad button [list $edge 2]]] $kind] -pady [expr {$kind eq "button" ? $pad : [list 0 $pad]}]
        $self Held $n
    }
    method Content {kind settings window} {
        lassign [::sorma::arrangement part $kind] package command
        package require $package
        set more [dict get [dict merge [dict create $kind {}] {image {-width 1 -height 1 -zoom fit -every 1000 -brief 1}} \
            [list stripchart [list -width 1 -height 1 -font $win.small]]] $kind]
        if {$kind eq "button"} {
            lappend more -state [expr {$options(-wall) ? "disabled" : "normal"}] -text [::sorma::boardFile::title $kind $settings]
        }
        $command $window {*}$more {*}[dict remove $settings -text]
        foreach child [winfo children $window] {
            if {[winfo class $child] eq "TLabel" && $kind in {led meter reading status}} {
                $child configure -font $win.plain
            }
        }
        switch -- $kind {
            button {
                pack configure $window.button -fill both
                catch {$window.button configure -style $win.TButton}
            }
            meter {
                $window.digits configure -width 7
                $window.age configure -width 0
            }
        }
    }

    # ---- where they stand ----

    method Gap {} {
        return [::sorma::style pixels 8]
    }
    # Each part at its place, and titles as high as the rows allow.
    method Lay {} {
        set width [winfo width $win.area]
        set height [winfo height $win.area]
        if {$width < 10} return
        set rows [::sorma::boardGrid::rows $places]
        set high [expr {min($height / $rows * 2 / 5, $width / 60)}]
        foreach {kind part least} {title 0.9 small plain 0.9 plain small 0.7 small strong 1.1 plain} {
            set least [::font actual [::sorma::style font $least] -size]
            set least [expr {$least < 0 ? -$least : $least * [tk scaling]}]
            ::font configure $win.$kind -family [::font actual TkDefaultFont -family] -size [expr {-int(max($least, $part * $high))}]
        }
        dict for {n place} $places {
            if {[lindex [dict get $parts $n] 0] eq "led" && [winfo class [$self window $n]] eq "Led"} {
                [$self window $n] configure -size [expr {int(1.2 * $high * 96 / 72.0 / [tk scaling])}]
            }
            lassign [::sorma::boardGrid::pixels $place $rows $width $height [$self Gap]] x y w h
            place $win.area.p$n -x $x -y $y -width $w -height $h
        }
        if {$parts eq {}} {
            place $win.area.none -relx 0.5 -rely 0.5 -anchor center
        } else {
            place forget $win.area.none
        }
        $win.bar.undo state [expr {$past eq {} ? "disabled" : "!disabled"}]
    }
    # Pixels as columns and rows; column and row of a pixel of the screen.
    method Steps {x y} {
        return [::sorma::boardGrid::steps $x $y [::sorma::boardGrid::rows $places] [winfo width $win.area] [winfo height $win.area] [$self Gap]]
    }
    method Cell {x y} {
        return [lmap n [$self Steps [expr {$x - [winfo rootx $win.area]}] [expr {$y - [winfo rooty $win.area]}]] {expr {int(floor($n))}}]
    }
    # The part at a pixel of the screen.
    method Under {x y} {
        set cell [$self Cell $x $y]
        dict for {n place} $places {
            if {[::sorma::boardGrid::overlap $place [concat $cell 1 1]]} {
                return $n
            }
        }
    }

    # ---- mouse and keys ----

    method Bind {} {
        set tag SormaBoard$win
        foreach {event method} {
            <ButtonPress-1> Grip <B1-Motion> Drag <ButtonRelease-1> Drop <Motion> Over <Double-ButtonPress-1> Grip
        } {
            bind $tag $event "[mymethod $method] %X %Y; break"
        }
        set all SormaBoardKeys$win
        foreach {key step} {Left {-1 0 0 0} Right {1 0 0 0} Up {0 -1 0 0} Down {0 1 0 0}
                Shift-Left {0 0 -1 0} Shift-Right {0 0 1 0} Shift-Up {0 0 0 -1} Shift-Down {0 0 0 1}} {
            bind $win.area <$key> [mymethod Step {*}$step]
        }
        bind $win.area <Delete> [mymethod RemoveChosen]
        bind $win.area <Tab> "if {\[[mymethod Next]\]} break"
        foreach {key words} {Control-z undo Control-s Done Control-e {edit 1} F11 Wall Escape {Escape}} {
            bind $all <$key> "[mymethod {*}$words]; break"
        }
        ::sorma::style tag $win $all
        ::sorma::style menu $all $win [mymethod Menu]
        bind $win.area <ButtonPress-1> [list focus $win.area]
    }
    # In edit mode, what is in a part hears nothing of the mouse.
    method Held n {
        ::sorma::style tag $win.area.p$n SormaBoardKeys$win
        $self Tags $win.area.p$n
    }
    method Tags window {
        set tags [lsearch -all -inline -exact -not [bindtags $window] SormaBoard$win]
        bindtags $window [if {$editing} {linsert $tags 0 SormaBoard$win} else {set tags}]
        catch {$window configure -cursor [if {$editing} {string cat fleur}]}        ;# widgets of ours have none themselves
        foreach child [winfo children $window] {
            $self Tags $child
        }
    }
    # Which part, and is it at the corner that sizes it.
    method At {x y} {
        set n [$self Under $x $y]
        if {$n eq {}} return
        set card $win.area.p$n
        set room [::sorma::style pixels 20]
        set corner [expr {[winfo rootx $card] + [winfo width $card] - $x < $room && [winfo rooty $card] + [winfo height $card] - $y < $room}]
        return [list $n [expr {$corner ? "size" : "move"}]]
    }
    method Over {x y} {
        lassign [$self At $x $y] n how
        set window [winfo containing $x $y]
        if {$window ne {} && $n ne {}} {
            catch {$window configure -cursor [dict get {size bottom_right_corner move fleur} $how]}
        }
    }
    method Grip {x y} {
        set grip {}
        lassign [$self At $x $y] n how
        if {$n eq {}} return
        focus $win.area
        $self Choose $n
        set grip [list $n $how $x $y [dict get $places $n]]
    }
    method Drag {x y} {
        if {$grip eq {}} return
        lassign $grip n how fromX fromY place
        lassign [lmap step [$self Steps [expr {$x - $fromX}] [expr {$y - $fromY}]] {expr {round($step)}}] dx dy
        set ghost [::sorma::boardGrid::changed $place {*}[if {$how eq "move"} {list $dx $dy 0 0} else {list 0 0 $dx $dy}]]
        $self Ghost $ghost
    }
    method Drop {x y} {
        place forget $win.area.ghost
        if {$grip ne {} && $ghost ne {} && $ghost ne [lindex $grip 4]} {
            $self place [lindex $grip 0] $ghost
        }
        set grip [set ghost {}]
        $self Choose $chosen
    }
    # The outline of where a part is, or would be.
    method Ghost place {
        lassign [::sorma::boardGrid::pixels $place [::sorma::boardGrid::rows $places] [winfo width $win.area] [winfo height $win.area] [$self Gap]] x y w h
        set edge [::sorma::style pixels 2]
        $win.area.ghost configure -background [::sorma::style token tint] -highlightbackground [::sorma::style token accent]
        place $win.area.ghost -x [expr {$x - $edge}] -y [expr {$y - $edge}] -width [expr {$w + 2 * $edge}] -height [expr {$h + 2 * $edge}]
        raise $win.area.ghost
        if {$grip ne {}} {
            raise $win.area.p[lindex $grip 0]
        }
    }
    method Choose n {
        set chosen $n
        place forget $win.area.ghost
        if {$n ne {} && [dict exists $places $n]} {
            $self Ghost [dict get $places $n]
            lower $win.area.ghost
        }
    }
    method Step {dx dy dw dh} {
        if {!$editing || $chosen eq {}} return
        $self place $chosen [::sorma::boardGrid::changed [dict get $places $chosen] $dx $dy $dw $dh]
        $self Choose $chosen
    }
    # Tab goes from part to part, and at the end of them on.
    method Next {} {
        set all [dict keys $parts]
        if {!$editing || $all eq {}} {
            return 0
        }
        $self Choose [lindex $all [expr {[lsearch -exact $all $chosen] + 1}]]
        return [expr {$chosen ne {}}]
    }
    method RemoveChosen {} {
        if {$editing && $chosen ne {}} {
            $self remove $chosen
            $self Choose {}
        }
    }
    method Wall {} {
        $self configure -wall [expr {!$options(-wall)}]
    }
    method Escape {} {
        if {$options(-wall)} {
            $self configure -wall 0
        } elseif {$editing} {
            $self Choose {}
        }
    }

    # ---- menus ----

    method Menu {menu window} {
        if {!$options(-wall)} {
            set n [$self Under [winfo pointerx $win] [winfo pointery $win]]
            if {$editing && $n ne {}} {
                $self PartMenu $menu $n
                $menu add separator
            }
            $menu add command -label [::msgcat::mc [expr {$editing ? "Save" : "Edit"}]] -accelerator [expr {$editing ? "Ctrl+S" : "Ctrl+E"}] \
                -command [if {$editing} {mymethod Done} else {mymethod edit 1}]
        }
        $menu add command -label [::msgcat::mc [expr {$options(-wall) ? "In a window" : "On a wall: full-screen, read-only"}]] -accelerator F11 -command [mymethod Wall]
    }
    method PartMenu {menu n} {
        lassign [dict get $parts $n] kind settings
        if {[dict exists $settings -option]} {
            foreach {other text} {display "As a value" meter "As a bar" led "As a lamp" stripchart "As a chart"} {
                $menu add command -label [::msgcat::mc $text] -state [expr {$other eq $kind ? "disabled" : "normal"}] -command [mymethod As $n $other]
            }
        }
        $menu add command -label [::msgcat::mc "Remove"] -accelerator Delete -command [mymethod remove $n]
    }
    # The same option, shown in another way.
    method As {n kind} {
        set settings [lindex [dict get $parts $n] 1]
        set text [dict filter $settings key -text]
        set name [dict get $settings -name]
        set option [dict get $settings -option]
        $self Remember
        dict set parts $n [list $kind [dict merge [if {$kind eq "stripchart"} {list -plot [list [list $name $option]]} else {list -name $name -option $option}] $text]]
        $self Make $n
        $self Lay
    }
}
