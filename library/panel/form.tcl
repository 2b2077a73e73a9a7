# form.tcl -- sorma::form, chosen options and reply parts of several objects in one grid. As text, one entry a line, that people write too:
#
#     # a cell
#     group Kitchen
#     foo.cell@robot -where -text "Where to serve"
#     foo.cell@robot -tempo
#
#     group Belt
#     cycle.belt@robot -period -show meter
#     host@robot {EXEC load} -part floats -index 0 -text Load
#
# Lines are as entries.tcl reads them: the title of a group; or an object, an option of it or a request {EXEC ...}, and how that is shown.

package require sorma::actions
package require sorma::entries
package require sorma::field
package require sorma::fold
package require sorma::lamp
package require sorma::notice
package require sorma::options
package require sorma::text
package require sorma::window
package provide sorma::form 1.0

# ::sorma::form .w ?-entries TEXT? ?-file FILE? ?-live ms? ?-apply now|later? ?-state normal|readonly? ?-make 0|1? --
#       A grid of the widgets that fit. The objects need not be there; -make 1: those that are not are made, now and each time their daemon has
#       come back.
# Methods:
#       apply, revert               all changes that are kept
#       fold TITLE                  fold the groups of that title, or open them
#       entries                     as text
#       add LINE                    one more entry
#       remove N, move N STEP       an entry
#       load FILE, save FILE        all entries
#       item N                      the widget of an entry
#
# Entries are counted from 0, as they stand.
snit::widget ::sorma::form {
    hulltype ttk::frame
    option -entries -default {} -configuremethod SetEntries -cgetmethod GetEntries
    option -file -default {} -readonly 1
    option -live -default 1000 -readonly 1
    option -make -default 0 -readonly 1 -type snit::boolean -configuremethod SetMake
    ::sorma::checkedOption -apply later SetShared
    ::sorma::checkedOption -state normal SetShared
    variable entries {}         ;# list of dicts: name, what, settings; of a group its title is the name, and what is empty
    variable subjects {}        ;# dict: NAME -> {subject listener}
    variable folded {}          ;# titles of groups
    variable marks {}           ;# dict: n -> {mark why} that are shown
    variable asked {}           ;# in the line that asks for an entry
    variable timer {}
    variable sizing {}
    variable inner {}           ;# frame of the entries; it scrolls
    typevariable Option {-text any -show {{choice field led meter} field}}
    typevariable Reply {-text any -part {{choice text floats ints words code} {}} -index {{whole 0 {}} {}} -unit any -every {{whole 10 {}} 1000}}

    constructor args {
        $hull configure -style Page.TFrame
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        set inside [list $edge [::sorma::style pixels 12]]
        ttk::frame $win.body
        set inner [::sorma::parts::scroller $win.body]
        ttk::frame $win.ask -style Card.TFrame -padding $inside
        ttk::label $win.ask.label -text [::msgcat::mc "Add: OBJECT -option"]
        ttk::entry $win.ask.entry -textvariable [myvar asked]
        pack $win.ask.label -side left -padx [list 0 $pad]
        pack $win.ask.entry -side left -fill x -expand 1
        bind $win.ask.entry <Return> [mymethod Asked]
        bind $win.ask.entry <Escape> [list grid remove $win.ask]
        ttk::label $win.said -wraplength [::sorma::style pixels 400] -justify left -foreground [::sorma::style colour refused] -style Page.TLabel
        ttk::frame $win.apply -style Card.TFrame -padding $inside
        ttk::button $win.apply.apply -style Accent.TButton -text [::msgcat::mc Apply] -command [mymethod apply] -underline 0
        ttk::button $win.apply.revert -text [::msgcat::mc Revert] -command [mymethod revert] -underline 0
        # News of daemons stand beside the buttons. Their room is always there, so nothing moves.
        ::sorma::notice $win.say -lines 1
        pack $win.apply.apply $win.apply.revert -side left -padx [list 0 $pad]
        pack $win.say -in $win.apply -side left -fill x -expand 1 -padx [list $pad 0]
        raise $win.say $win.apply
        foreach {part sticky} {body nsew ask ew said ew apply ew} {
            grid $win.$part -sticky $sticky -padx $edge -pady [list 0 $pad]
        }
        grid configure $win.body -padx [::sorma::parts::margin $win.body $edge] -pady [list $edge 0]
        grid configure $win.apply -pady [list 0 $edge]
        grid remove $win.ask $win.said
        grid columnconfigure $win 0 -weight 1
        grid rowconfigure $win 0 -weight 1
        grid rowconfigure $win 20 -weight 1000         ;# room that is left over is below all
        foreach {key script} [list <Alt-a> [mymethod apply] <Alt-r> [mymethod revert]] {
            bind [$self Tag] $key "$script; break"
        }
        ::sorma::style menu [$self Tag] $win [mymethod Menu]
        bind [$self Tag] <Configure> [mymethod SizeSoon]         ;# in a canvas what grows does not tell it to the windows around
        bind [$self Tag] <FocusIn> [list ::sorma::parts::see $win.body.canvas %W]
        bind $win <<ThemeChanged>> [mymethod Soon]
        $self configurelist $args
        if {$options(-file) ne {}} {
            $self load $options(-file)
            set folded [::sorma::fold recall [$self Key]]
        }
        $self Soon
    }
    destructor {
        after cancel $timer
        after cancel $sizing
        ::sorma::style untag [$self Tag]
        $self Release
    }
    method Tag {} {
        return SormaForm$win
    }
    method Release {} {
        $self LetGo $subjects
        set subjects {}
    }
    method LetGo taken {
        foreach {subject listener} [concat {*}[dict values $taken]] {
            $subject unlisten $listener
            $subject keep [expr {-!!$options(-make)}]
            $subject release
        }
    }

    # ---- what programs say ----

    method entries {} {
        return [join [lmap entry $entries {Line $entry}] \n]\n
    }
    method GetEntries option {
        return [$self entries]
    }
    method SetEntries {option text} {
        $self Take [Parse $text -entries]
    }
    method load file {
        $self Take [Parse [::sorma::text::readFile $file] $file]
    }
    method save file {
        ::sorma::text::writeFile $file [$self entries]
    }
    method add line {
        $self Take [concat $entries [Parse $line entry]]
    }
    method remove n {
        $self Number $n
        $self Take [lreplace $entries $n $n]
    }
    method move {n step} {
        set to [expr {[$self Number $n] + $step}]
        if {$to >= 0 && $to < [llength $entries]} {
            $self Take [linsert [lreplace $entries $n $n] $to [lindex $entries $n]]
        }
    }
    method fold title {
        set others [lsearch -all -inline -exact -not $folded $title]
        set folded [expr {[llength $others] < [llength $folded] ? $others : [concat $folded [list $title]]}]
        if {$options(-file) ne {}} {
            ::sorma::fold remember [$self Key] $folded
        }
        $self Soon
    }
    method Key {} {
        return [list form -file [file normalize $options(-file)]]
    }
    method item n {
        return $inner.field[$self Number $n]
    }
    method Number n {
        if {![string is integer -strict $n] || $n < 0 || $n >= [llength $entries]} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "expected the number of an entry, below [llength $entries], got \"$n\""
        }
        return $n
    }
    # Each object gets what was typed in one request; other options of it, typed elsewhere, are left alone.
    method apply {} {
        if {$options(-state) eq "normal"} {
            $self Each apply
        }
    }
    method revert {} {
        $self Each revert
        focus $win
    }
    method Each method {
        dict for {name pair} $subjects {
            set mine [$self Edited $name]
            if {$mine ne {}} {
                [lindex $pair 0] $method {*}$mine
            }
        }
    }
    # Options of an object that stand here, and were typed and not applied.
    method Edited name {
        set here [lmap entry $entries {if {[dict get $entry name] ne $name} continue; dict get $entry what}]
        return [lmap option [[lindex [dict get $subjects $name] 0] edited] {if {$option ni $here} continue; set option}]
    }

    # ---- as text ----

    proc Parse {text where} {
        set found {}
        ::sorma::entries::each {place words} $text $where [myproc Words] {
            lappend found [Entry $words]
        }
        return $found
    }
    # A form that was saved before 2026-12 has Tcl's lists: it matters where backslashes quote.
    proc Words line {
        if {[string first \\ $line] >= 0 && [string is list $line] && [list {*}$line] eq $line} {
            return $line
        }
        return [::sorma::SplitWords $line]
    }
    proc Entry words {
        lassign $words name what
        if {$name eq "group" && [llength $words] > 1} {
            return [dict create name [join [lrange $words 1 end]] what {} settings {}]
        }
        set table [if {[regexp {^-\S+$} $what]} {set Option} elseif {[catch {lindex $what 0} head] || $head ne "EXEC"} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "expected \"group TITLE\", \"OBJECT -OPTION ...\" or \"OBJECT {EXEC ...} ...\", got\
                \"[::sorma::entries::line $words]\""
        } else {
            set Reply
        }]
        ::sorma::resolve $name
        return [dict create name $name what $what settings [::sorma::options::parse $table [lrange $words 2 end]]]
    }
    # Settings that have their defaults are left out.
    proc Line entry {
        dict with entry {
            if {$what eq {}} {
                return [::sorma::entries::line [list group $name]]
            }
            set otherwise [::sorma::options::defaults [if {[string match -* $what]} {set Option} else {set Reply}]]
            return [::sorma::entries::line [list $name $what {*}[dict filter $settings script {option value} {expr {$value ne [dict get $otherwise $option]}}]]]
        }
    }

    # ---- building ----

    method Take given {
        set before $subjects
        set subjects {}
        set entries $given
        foreach entry $entries {
            dict with entry {
                if {$what ne {} && ![dict exists $subjects $name]} {
                    set subject [::sorma::subject of $name -live $options(-live)]
                    dict set subjects $name [list $subject [$subject listen [mymethod Told $name]]]
                    $subject keep [expr {!!$options(-make)}]
                }
            }
        }
        $self LetGo $before
        $self Soon
    }
    # Entries may have been given before it.
    method SetMake {option value} {
        set options($option) $value
        foreach {subject listener} [concat {*}[dict values $subjects]] {
            $subject keep [expr {!!$value}]
        }
    }
    method SetShared {option value} {
        set options($option) $value
        $self Soon
    }
    method Soon {} {
        after cancel $timer
        set timer [after idle [mymethod Build]]
    }
    method Told {name what changed} {
        if {![dict exists $subjects $name]} return
        if {$what eq "table"} {
            $self Soon
        } else {
            $self Shown $name
        }
    }
    method Build {} {
        if {![winfo exists $win]} return
        set at [focus -displayof $win]
        destroy {*}[winfo children $inner]
        set marks {}
        for {set i [lindex [grid size $inner] 1]} {$i > 0} {} {
            grid rowconfigure $inner [incr i -1] -minsize 0
        }
        set row 0
        set from 1
        set n 0
        set cards 0
        set shut 0
        foreach entry $entries {
            dict with entry {
                if {$what eq {} && $row > $from} {
                    ::sorma::parts::card [ttk::frame $inner.card[incr cards] -style Card.TFrame] $from [incr row]
                    set from [expr {[incr row] + 1}]
                }
                if {$row < $from} {
                    set row $from
                }
                if {$what eq {}} {
                    ::sorma::fold title $inner.field$n $name [mymethod fold $name]
                    ::sorma::fold place $inner.field$n [incr row]
                    set shut [expr {$name in $folded}]
                } else {
                    $self Row $n $name $what $settings
                    if {!$shut} {
                        ::sorma::parts::row $inner $n [incr row]
                        incr row
                    }
                    ::sorma::style tip $inner.label$n "$name $what"
                }
            }
            incr n
        }
        if {$entries ne {}} {
            ::sorma::parts::card [ttk::frame $inner.card[incr cards] -style Card.TFrame] $from [incr row]
        }
        grid columnconfigure $inner 2 -weight 1
        if {$entries eq {}} {
            grid [ttk::label $inner.none -style Page.TLabel -text [::msgcat::mc "nothing is chosen yet: the right button or the Menu key adds an option of an object"] \
                -wraplength [::sorma::style pixels 360]]
        }
        $self Tagged $win
        if {[string match $inner.* $at] && [winfo exists $at]} {
            focus $at
        }
        $self Titles
        foreach name [dict keys $subjects] {
            $self Shown $name
        }
    }
    # All windows of it know the form's keys, its menu and its wheel.
    method Tagged window {
        ::sorma::style tag $window [$self Tag]
        ::sorma::style bindWheel [expr {$window eq $win ? "$win.body.canvas" : $window}] $win.body.canvas
    }
    # As large as what is in it, as far as the screen reaches.
    method SizeSoon {} {
        after cancel $sizing
        set sizing [after idle [mymethod Size]]
    }
    method Size {} {
        set view $win.body.canvas
        $view configure -scrollregion [$view bbox all] -width [winfo reqwidth $inner] \
            -height [expr {max(20, min([winfo reqheight $inner], [winfo vrootheight $win] * 3 / 4))}]
    }
    # The widgets of an entry; of an option, as long as nobody knows what it is, a label stands there.
    method Row {n name what settings} {
        set subject [lindex [dict get $subjects $name] 0]
        set parent $inner
        set unit [set danger {}]
        set isOption [string match -* $what]
        ttk::label $parent.mark$n -width 2 -anchor center
        if {!$isOption} {
            ::sorma::reading $parent.field$n -name $name -request $what {*}[dict remove $settings -text]
        } elseif {[catch {$subject option $what} facts]} {
            ttk::label $parent.field$n -text [if {[$subject table] eq {}} {string cat \u2026}]
        } else {
            set unit [dict get $facts unit]
            set danger [if {[dict exists $facts hints danger]} {dict get $facts hints danger}]
            switch -- [dict get $settings -show] {
                field { ::sorma::field $parent.field$n $facts -name $name -option $what -apply $options(-apply) -state $options(-state) }
                led { ::sorma::led $parent.field$n -name $name -option $what }
                meter {
                    ::sorma::meter $parent.field$n -name $name -option $what -length 220
                    set unit {}         ;# it shows that itself
                }
            }
            bind $parent.field$n <<SormaBuilt>> [mymethod Tagged $parent.field$n]
        }
        if {$unit ne {} && [winfo class $parent.field$n] ni {Led TLabel}} {
            ttk::label $parent.unit$n -style Unit.TLabel -text $unit
            catch {$parent.field$n beside $parent.unit$n}
        }
        set text [dict get $settings -text]
        ttk::label $parent.label$n -text [if {$text ne {}} {set text} elseif {$isOption} {string range $what 1 end} else {join [lrange $what 1 end]}][::sorma::actions mark $danger]
    }
    method Shown name {
        set subject [lindex [dict get $subjects $name] 0]
        set n -1
        foreach entry $entries {
            incr n
            set what [dict get $entry what]
            if {[dict get $entry name] ne $name || ![string match -* $what] || ![winfo exists $inner.mark$n]} continue
            set shown [if {[$subject table] eq {}} {
                set told [$subject get $what]
                list [dict get $told state] [dict get $told why]
            } elseif {[catch {$subject mark $what} mark]} {
                list gone $mark
            } else {
                set mark
            }]
            if {[lindex $shown 0] in {asking stale} || [lindex $shown 0] eq "gone" && [$subject gone]} {
                lset shown 1 {}         ;# it stands at the top
            }
            if {![dict exists $marks $n] || [dict get $marks $n] ne $shown} {
                dict set marks $n $shown
                ::sorma::parts::mark $inner $n {*}$shown
            }
        }
        $self Titles
        $self Head
        set edited "disabled"
        foreach other [dict keys $subjects] {
            if {[$self Edited $other] ne {}} {
                set edited "!disabled"
            }
        }
        $win.apply.apply state [expr {$options(-state) eq "normal" ? $edited : "disabled"}]
        $win.apply.revert state $edited
        if {$options(-apply) eq "now" && $edited eq "disabled" && [lindex [$win.say says] 1] eq {}} {
            grid remove $win.apply
        } else {
            grid $win.apply
        }
    }

    # A folded group tells how many entries it has, and the worst of their states.
    method Titles {} {
        set states {}
        for {set n [llength $entries]} {$n > 0} {} {
            set entry [lindex $entries [incr n -1]]
            if {[dict get $entry what] ne {}} {
                lappend states [if {[dict exists $marks $n]} {lindex [dict get $marks $n] 0}]
                continue
            }
            if {[winfo exists $inner.field$n]} {
                set title [dict get $entry name]
                ::sorma::fold show $inner.field$n $title [expr {$title in $folded}] $states
            }
            set states {}
        }
    }
    # The top says what holds for all values of an object, of the first object with such a message.
    method Head {} {
        set say {live {}}
        set others 0
        dict for {name pair} $subjects {
            set subject [lindex $pair 0]
            lassign [$subject trouble] state text
            if {$state in {live locked}} continue
            if {[lindex $say 0] ne "live"} {
                incr others
                continue
            }
            set can [expr {$state eq "gone" && $options(-state) eq "normal" && [$subject makes]}]
            set say [list stale "[::sorma::style mark $state] $name: $text" [if {$can} {list $subject make}]]
        }
        if {$others > 0} {
            lset say 1 "[lindex $say 1] (and $others more)"
        }
        $win.say say {*}$say
    }

    # ---- menus ----

    method Menu {menu window} {
        if {[string match $win.ask* $window]} return
        if {[regexp {^\.\D+(\d+)} [string range $window [string length $inner] end] -> n] && [string match $inner.* $window]} {
            $self EntryMenu $menu $n
        }
        $menu add command -label [::msgcat::mc "Add \u2026"] -underline 0 -command [mymethod Ask]
        $menu add command -label [::msgcat::mc "Load form \u2026"] -underline 0 -command [mymethod AskFile load tk_getOpenFile]
        $menu add command -label [::msgcat::mc "Save form \u2026"] -underline 0 -command [mymethod AskFile save tk_getSaveFile]
    }
    method EntryMenu {menu n} {
        set entry [lindex $entries $n]
        dict with entry {
            if {$what ne {}} {
                set subject [lindex [dict get $subjects $name] 0]
                if {![catch {$subject option $what}]} {
                    ::sorma::parts::fieldMenu $menu $subject $what [expr {$options(-state) eq "normal"}]
                    $menu add separator
                } elseif {![string match -* $what]} {
                    ::sorma::parts::plotEntry $menu $name $what {*}[dict filter $settings key -part -index -every]
                }
                $menu add command -label [::msgcat::mc "Panel of %s" $name] -underline 0 -command [list ::sorma::window panel $name]
            }
            foreach {label script} [list "Move up" [mymethod move $n -1] "Move down" [mymethod move $n 1] Remove [mymethod remove $n]] {
                $menu add command -label [::msgcat::mc $label] -command $script
            }
            $menu add separator
        }
    }
    method Ask {} {
        grid $win.ask
        focus $win.ask.entry
    }
    method Asked {} {
        if {[catch {$self add $asked} message]} {
            return [$self Say $message]
        }
        set asked {}
        grid remove $win.ask
        $self Say {}
    }
    method AskFile {method command} {
        set file [$command -parent $win -defaultextension .form -filetypes {{Form .form} {All *}}]
        if {$file ne {}} {
            catch {$self $method $file} message
            $self Say $message
        }
    }
    method Say text {
        $win.said configure -text $text
        if {$text ne {}} {
            grid $win.said
        } else {
            grid remove $win.said
        }
    }
}
