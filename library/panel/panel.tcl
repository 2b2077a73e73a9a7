# panel.tcl -- sorma::panel, a panel for any service object, from its option table and its signature alone.
#
# Its parts are the widgets of field.tcl and execform.tcl and one subject. It asks nobody itself, so a silent daemon never makes
# it stand still: its fields turn stale, and say why.

package require sorma::actions
package require sorma::classPart
package require sorma::field
package require sorma::fold
package require sorma::layout
package require sorma::panelColumns
package require sorma::panelEnter
package require sorma::panelFrames
package require sorma::text
package require sorma::window
package provide sorma::panel 1.0

# ::sorma::panel .w NAME ?-options list? ?-groups dict? ?-layout file? ?-live ms? ?-apply now|later? ?-state normal|readonly? ?-make 0|1? --
#
#       A frame with everything that can be set, tried and asked of an object, here or elsewhere. The object need not be there.
#
# Arguments:
#       list    of options that are shown, in this order; default all
#       dict    title -> list of options that stand together; default: the groups of the class
#       file    as the panel has saved it (layout.tcl): groups, order, and what is hidden
#       ms      how often what changes by itself is asked for, default 1000
#       -make   1: the panel makes the object when it is not there, now and after each restart of its daemon
#       later   changes are kept until Apply is pressed; a switch in the panel changes that
# Methods:
#       subject                     the subject of the object
#       apply, revert               all changes that are kept
#       field OPTION                the widget of an option
#       search TEXT                 show the options that fit
#       execute                     EXEC, with what its form has
#       enter                       the keyboard goes to the first field
#       layout                      as text
#       load FILE, save FILE        a layout
#       move OPTION STEP            an option up or down
#       hide OPTION                 do not show an option
#       unhide                      show all options
#       fold TITLE                  fold that group, or open it
snit::widget ::sorma::panel {
    hulltype ttk::frame
    option -options -default {} -readonly 1
    option -groups -default {} -readonly 1
    option -layout -default {} -readonly 1
    option -live -default 1000 -readonly 1
    ::sorma::checkedOption -apply later SetApply
    ::sorma::checkedOption -state normal SetState
    option -make -default 0 -readonly 1 -type snit::boolean
    variable subject {}
    variable listener {}
    variable rows {}            ;# dict: -option -> number of its widgets
    variable marks {}           ;# dict: -option -> {mark why} that are shown
    variable layout {}          ;# as layout.tcl has it
    variable given {}           ;# layout that was given; empty: the class's own
    variable seenTimer {}       ;# until it is looked which fields can be seen
    variable room 380           ;# pixels, for messages below fields
    variable wanted {}          ;# what is searched for
    variable searchable 12      ;# options: with more there is a field to search in
    variable atOnce 0
    variable readOnly 0
    variable asked {}           ;# in the line that asks for a word
    variable canvas {}
    variable inner {}           ;# frame of the fields, in the canvas
    ::sorma::panelColumns
    ::sorma::panelEnter
    ::sorma::panelFrames

    constructor {name args} {
        $self configurelist $args
        set given [if {$options(-layout) ne {}} {::sorma::layout read $options(-layout)} else {::sorma::layout of $options(-groups)}]
        set subject [::sorma::subject of $name -live $options(-live)]
        set listener [$subject listen [mymethod Told]]
        $hull configure -style Page.TFrame
        $self BuildFrames
        $self Head
        $self Place
        $self BeginColumns
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        $self Bind
        bind $win <<ThemeChanged>> [mymethod Looks]
        $self Switched
        $self Table
        $subject keep [expr {!!$options(-make)}]
    }
    # Parts that ttk does not colour by itself.
    method Looks {} {
        set marks [dict map {option mark} $marks {string cat {}}]
        $self Shown [dict keys $rows]
    }

    method Ended window {
        if {$window eq $win && $subject ne {}} {
            after cancel $seenTimer
            ::sorma::style untag [$self Tag]
            $subject unlisten $listener
            $subject keep [expr {-!!$options(-make)}]
            $subject release
            set subject {}
        }
    }
    # The tag of all windows in the panel.
    method Tag {} {
        return SormaPanel$win
    }

    # ---- what programs say ----

    method subject {} {
        return $subject
    }
    method apply {} {
        if {!$readOnly} {
            $subject apply
        }
    }
    method revert {} {
        $subject revert
        focus $win
    }
    method field option {
        return $inner.field[$self Row $option]
    }
    method Row option {
        if {![dict exists $rows $option]} {
            return -code error -errorcode [list SORMA OPTION UNKNOWN $option] "[$subject name]: the panel shows no option $option"
        }
        return [dict get $rows $option]
    }
    method search text {
        set wanted $text
        $self Arrange
    }
    method execute {} {
        $win.exec execute
    }
    method layout {} {
        return [::sorma::layout text $layout]
    }
    method save file {
        ::sorma::layout write $file $layout
    }
    method load file {
        $self Relay [::sorma::layout read $file]
    }
    method move {option step} {
        $self Row $option
        $self Relay [::sorma::layout move $layout $option $step]
    }
    method hide option {
        $self Row $option
        $self Relay [::sorma::layout hide $layout $option]
    }
    method unhide {} {
        $self Relay [dict replace $layout hidden {}]
    }
    method fold title {
        if {![dict exists [dict get $layout groups] $title]} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "[$subject name]: the panel has no group \"$title\""
        }
        set given [set layout [::sorma::layout fold $layout $title]]
        $self Arrange
        if {$options(-layout) ne {}} return
        ::sorma::fold remember [list panel -name [$subject name]] [dict get $layout folded]
    }
    method Relay new {
        set given $new
        $self Laid
    }

    # ---- building ----

    method SetApply {option value} {
        set options($option) $value
        set atOnce [expr {$value eq "now"}]
        $self Switched
    }
    method SetState {option value} {
        set options($option) $value
        set readOnly [expr {$value ne "normal"}]
        $self Switched
    }
    # One of the switches was moved. A button that stops a motion is never switched off.
    method Switched {} {
        set options(-apply) [expr {$atOnce ? "now" : "later"}]
        set options(-state) [expr {$readOnly ? "readonly" : "normal"}]
        foreach {option row} $rows {
            $inner.field$row configure -apply $options(-apply) -state $options(-state)
        }
        if {[winfo exists $win.exec]} {
            $self EnableActions
            $self Head
            $self Shown [dict keys $rows]
        }
    }
    method EnableActions {} {
        set state [expr {$readOnly ? "disabled" : "normal"}]
        foreach part [list $win.exec {*}[winfo children $win.actions]] {
            $part configure -state $state
        }
    }

    method Told {what changed} {
        if {$subject eq {}} return
        if {$what eq "table"} {
            return [$self Table]
        } elseif {[$subject table] eq {}} {
            $self Empty
        }
        $self Head
        $self Shown [if {$what eq "values"} {set changed} else {dict keys $rows}]
    }

    # The table has come, or it is another one.
    method Table {} {
        set table [$subject table]
        if {$table eq {}} {
            return [$self Empty]
        }
        set all [lmap item [dict get $table options] {lindex $item 0}]
        set chosen [expr {$options(-options) eq {} ? $all : [lmap option $options(-options) {if {$option ni $all} continue; set option}]}]
        destroy {*}[winfo children $inner]
        set rows {}
        set widest [tcl::mathfunc::max 0 {*}[lmap option $chosen {font measure TkDefaultFont [dict get [$subject option $option] unit]}]]
        set wide [expr {int(ceil(double($widest) / [font measure TkDefaultFont 0]))}]
        set n 0
        foreach option $chosen {
            dict set rows $option [incr n]
            dict set marks $option {}
            set facts [$subject option $option]
            ttk::label $inner.mark$n -width 2 -anchor center
            ttk::label $inner.label$n -text [string range $option 1 end][::sorma::actions mark [if {[dict exists $facts hints danger]} {dict get $facts hints danger}]]
            ::sorma::parts::named $inner.label$n $subject $option
            ::sorma::field $inner.field$n $facts -name [$subject name] -option $option -apply $options(-apply) -state $options(-state) -seen 0
            bind $inner.field$n <<SormaBuilt>> [mymethod Tagged $inner.field$n]
            if {$wide > 0} {
                ttk::label $inner.unit$n -style Unit.TLabel -text [dict get $facts unit] -width $wide
                $inner.field$n beside $inner.unit$n
            }
            foreach part {label field} {
                ::sorma::style tip $inner.$part$n [string trim "[dict get $facts help]\n[dict get $facts range]"]
            }
        }
        grid columnconfigure $inner 2 -weight 1
        grid $win.what
        if {$rows ne {}} {
            grid $win.apply
        } else {
            $self None [::msgcat::mc "the class has no options: nothing can be set"]
        }
        $self Actions $table
        $self Laid
        $self Tagged $win
        $self Head
        $self Shown [dict keys $rows]
    }
    # Where options stand when there are some. Why they are not there the status says, unless it is the daemon that says it.
    method None text {
        destroy $inner.none
        grid [ttk::label $inner.none -style Page.TLabel -text $text -wraplength [expr {max($room, [::sorma::style pixels 420])}] -justify left] -row 0 -column 0 -columnspan 3 -sticky w -padx [::sorma::style pixels 16] -pady [::sorma::style pixels 12]
    }
    method Empty {} {
        $self None [if {[dict get [$subject get {}] state] eq "asking"} {::msgcat::mc "asking \u2026"} else {
            ::msgcat::mc "Nothing is known of %s yet. The panel fills itself as soon as the object answers." [$subject name]
        }]
    }
    # The top says what holds for all fields; otherwise it says what the object is for.
    method Head {} {
        lassign [$subject trouble] state text
        set table [$subject table]
        set can [expr {$state eq "gone" && !$readOnly && [$subject makes]}]
        if {$state ne "live"} {
            set text "[::sorma::style mark $state] $text"
        } elseif {$table ne {}} {
            set text [string trimright "[dict get $table class]: [dict get $table purpose]" ": "]
        }
        $win.head.say say [dict get {stale stale gone stale locked refused live asking} $state] $text [if {$can} {list $subject make}]
    }
    # All windows of it know the panel's keys, its menu and its wheel.
    method Tagged window {
        ::sorma::style tag $window [$self Tag]
        ::sorma::style bindWheel [expr {$window eq $win ? $canvas : $window}] $canvas
    }

    method Actions table {
        ::sorma::actions fill $win.actions $win.head.stop [$subject name] $table [mymethod AskAct]
        set make [::sorma::classPart of [dict get $table class]]
        if {$make ne {}} {
            grid [{*}$make $win.actions.class [$subject name]] -row [lindex [grid size $win.actions] 1] -column 0 -columnspan 4 -sticky w -pady [list [::sorma::style pixels 4] 0]
        }
        if {[winfo children $win.actions] ne {}} {
            grid $win.actions
        } else {
            grid remove $win.actions
        }
        $self EnableActions
    }
    method AskAct {word usage} {
        $self Ask "$word $usage" {} [mymethod Act $word]
    }
    method Act {word text} {
        if {[catch {llength $text}]} {
            return [$self Say "$word: expected words, a list; got \"$text\"" refused]
        }
        $self Do [list CTRL $word {*}$text]
    }

    # ---- the order of the fields ----

    method Laid {} {
        if {$rows eq {}} return
        set known [if {$given ne {}} {set given} else {::sorma::layout byGroup [dict keys $rows] [dict get [$subject table] hints]}]
        if {$given eq {}} {
            if {$options(-options) ne {}} {
                dict set known hidden {}      ;# asked for by name: shown, for experts or not
            }
            dict set known folded [::sorma::fold recall [list panel -name [$subject name]] [dict get $known folded]]
        }
        set layout [::sorma::layout complete $known [dict keys $rows]]
        foreach child [winfo children $inner] {
            if {[regexp {\.(group|card)\d+$} $child]} {
                destroy $child
            }
        }
        set n 0
        foreach {title members} [dict get $layout groups] {
            ttk::frame $inner.card[incr n] -style Card.TFrame
            ::sorma::fold title $inner.group$n $title [if {[$self Folds]} {mymethod fold $title}]
            $self Tagged $inner.group$n
        }
        $self Arrange
        $self Enter
    }
    method Folds {} {
        return [expr {[dict size $rows] > $searchable}]
    }
    method Folded title {
        return [expr {$wanted eq {} && $title ne {} && [$self Folds] && $title in [dict get $layout folded]}]
    }
    method Heading {group title members} {
        if {[$self Folds] && $title ne {}} {
            set states [lmap option $members {lindex [dict get $marks $option] 0}]
            ::sorma::fold show $inner.group$group $title [$self Folded $title] $states
        }
    }
    method Headings {} {
        set group 0
        foreach {title members} [if {$layout ne {}} {dict get $layout groups}] {
            $self Heading [incr group] $title $members
        }
    }
    # Only what is searched for is shown.
    method Arrange {} {
        if {$layout eq {}} return
        grid remove {*}[winfo children $inner]
        set pattern *[string map {* \\* ? \\? \[ \\\[ \\ \\\\} $wanted]*
        set gap [::sorma::style pixels 4]
        set row 0
        set group 0
        set first {}
        for {set i [lindex [grid size $inner] 1]} {$i > 0} {} {
            grid rowconfigure $inner [incr i -1] -minsize 0
        }
        foreach {title members} [dict get $layout groups] {
            incr group
            set from [incr row]
            $self Heading $group $title $members
            if {[$self Folded $title]} {
                ::sorma::fold place $inner.group$group [incr row]
                set first 1
                set members {}
            }
            foreach option $members {
                if {$wanted ne {} && ![string match -nocase $pattern "$option [dict get [$subject option $option] help] $title"]} continue
                if {$row == $from && $title ne {}} {
                    ::sorma::fold place $inner.group$group [incr row]
                }
                set n [dict get $rows $option]
                set first 1
                ::sorma::parts::row $inner $n [incr row]
                incr row
                if {[winfo exists $inner.why$n] && [$inner.why$n cget -text] ne {}} {
                    grid $inner.why$n -row $row -column 2 -sticky w -padx [list $gap [expr {4 * $gap}]] -pady [list 0 $gap]
                }
            }
            if {$row > $from} {
                ::sorma::parts::card $inner.card$group $from [incr row]
                incr row
            }
        }
        if {[dict size $rows] > $searchable} {
            grid $win.find
        } else {
            grid remove $win.find
        }
        after cancel $seenTimer
        set seenTimer [after idle [mymethod Look]]
        destroy $inner.none
        if {$first eq {}} {
            $self None [if {$wanted ne {}} {::msgcat::mc "no option has \"%s\" in its name or its help" $wanted} else {::msgcat::mc "all options are hidden: the menu of the right button shows them"}]
        }
    }
    method Scrolled {first last} {
        after cancel $seenTimer
        set seenTimer [after idle [mymethod Look]]
    }
    # Fields that are out of sight cost nothing. As long as nothing has its place, none is in sight.
    method Look {} {
        if {[winfo height $canvas] <= 1 || [winfo height $inner] <= 1} return
        set top [$canvas canvasy 0]
        set bottom [$canvas canvasy [winfo height $canvas]]
        foreach n [dict values $rows] {
            set field $inner.field$n
            set y [winfo y $field]
            set seen [expr {[winfo manager $field] ne {} && $y < $bottom && $y + [winfo height $field] > $top}]
            if {[$field cget -seen] != $seen} {
                $field configure -seen $seen
            }
        }
    }
    # As high as what is in it, as long as that leaves room for the rest.
    method Sized {} {
        $canvas configure -scrollregion [$canvas bbox all] -height [expr {max(20, min([winfo reqheight $inner], max([winfo vrootheight $win] * 2 / 5, [$self Free])))}]
        set beside [lindex [grid bbox $inner 2 0] 0]
        set new [expr {[winfo width $inner] - $beside - [::sorma::style pixels 4]}]
        if {$new != $room && $new > 50} {
            set room $new
            foreach n [dict values $rows] {
                if {[winfo exists $inner.why$n]} {
                    $inner.why$n configure -wraplength $room
                }
            }
        }
    }

    # ---- marks and messages ----

    method Shown changed {
        set denied [$subject denied]
        foreach option $changed {
            if {![dict exists $rows $option]} continue
            set n [dict get $rows $option]
            set mark [$subject mark $option]
            if {[lindex $mark 0] in {asking stale gone} || [lindex $mark 1] eq $denied} {
                lset mark 1 {}          ;# it stands at the top
            }
            if {[dict get $marks $option] ne $mark} {
                dict set marks $option $mark
                ::sorma::parts::mark $inner $n {*}$mark
            }
        }
        if {[$self Folds]} {
            $self Headings
        }
        set edited [expr {[llength [$subject edited]] > 0 ? "!disabled" : "disabled"}]
        $win.apply.apply state [expr {$readOnly ? "disabled" : $edited}]
        $win.apply.revert state $edited
    }
    method Say {text {state live}} {
        $win.said configure -text $text -foreground [::sorma::style colour $state]
        if {$text ne {}} {
            grid $win.said
        } else {
            grid remove $win.said
        }
    }
    # A request of a menu: its answer stands in the panel.
    method Do words {
        $self Say "\u2026"
        $subject ask $words [list ::sorma::parts::answer [mymethod Done $words]]
    }
    method Done {words status value} {
        if {$status ne "ok"} {
            return [$self Say [lindex $value 0] refused]
        }
        $self Say [if {[dict exists $value text] && [dict get $value text] ne {}} {dict get $value text} else {string cat "[join $words]: done"}] good
    }
    # Ask for a word; PREFIX is called with it.
    method Ask {what default prefix} {
        $win.ask.label configure -text $what
        set asked $default
        $win.ask.ok configure -command [mymethod Asked $prefix]
        grid $win.ask
        focus $win.ask.entry
    }
    method Asked prefix {
        grid remove $win.ask
        uplevel #0 [list {*}$prefix $asked]
    }
    # ---- menus ----

    # The menu of the field at a window, or of the panel.
    method Menu {menu window} {
        if {[string match $win.messages* $window] || [string match $win.exec* $window]} return
        set option {}
        if {[regexp {^\.(?:field|label|mark|unit|why)(\d+)} [string range $window [string length $inner] end] -> n]} {
            set option [lindex [dict keys [dict filter $rows value $n]] 0]
        }
        if {$option ne {}} {
            $self FieldMenu $menu $option
        } else {
            $self PanelMenu $menu
        }
    }
    method FieldMenu {menu option} {
        ::sorma::parts::fieldMenu $menu $subject $option [expr {!$readOnly}]
        $menu add command -label [::msgcat::mc "Undo what was set last"] -underline 0 -state [expr {$readOnly ? "disabled" : "normal"}] -command [mymethod Do {CTRL -undo}]
        $menu add command -label [::msgcat::mc "Why this value"] -underline 0 -command [mymethod Do [list DBX -why $option]]
        $menu add separator
        $menu add command -label [::msgcat::mc "Move up"] -underline 5 -command [mymethod move $option -1]
        $menu add command -label [::msgcat::mc "Move down"] -underline 5 -command [mymethod move $option 1]
        $menu add command -label [::msgcat::mc "Hide"] -underline 0 -command [mymethod hide $option]
        $menu add separator
        $self PanelMenu $menu
    }
    method PanelMenu menu {
        set can [expr {$readOnly ? "disabled" : "normal"}]
        $menu add command -label [::msgcat::mc "Differences from the recipe"] -underline 0 -command [mymethod Do {DBX -diff}]
        $menu add command -label [::msgcat::mc "Save as flavor \u2026"] -underline 0 -state $can -command [mymethod Ask "Save as flavor" {} [mymethod SaveFlavor]]
        if {$layout ne {} && [dict get $layout hidden] ne {}} {
            $menu add command -label [::msgcat::mc "Show what is hidden"] -underline 1 -command [mymethod unhide]
        }
        $menu add command -label [::msgcat::mc "Save layout \u2026"] -underline 5 -command [mymethod AskFile save tk_getSaveFile]
        $menu add command -label [::msgcat::mc "Load layout \u2026"] -underline 6 -command [mymethod AskFile load tk_getOpenFile]
    }
    method SaveFlavor flavor {
        $self Do [list CTRL -save {*}[if {$flavor ne {}} {list $flavor}]]
    }
    method AskFile {method command} {
        set file [$command -parent $win -defaultextension .layout -filetypes {{Layout .layout} {All *}}]
        if {$file ne {} && [catch {$self $method $file} message]} {
            $self Say $message refused
        }
    }
}
