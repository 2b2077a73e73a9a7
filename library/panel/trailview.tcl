# trailview.tcl -- sorma::trailview: the messages of an object, of a daemon or of all, as they come, the newest below.

package require Tk
package require snit
package require sorma::parts
package require sorma::style
package require sorma::text
package require sorma::world
package provide sorma::trailview 1.0

# ::sorma::trailview .w ?-keys PATTERNS? ?-severity LIST? ?-daemon PART? ?-object PART? ?-text PART? ?-paused BOOLEAN? ?-keep n? ?-height lines? --
# Options:
#       -keys PATTERNS          of sorma::world, default *@*: trails of all objects; * is what daemons say for themselves
#       -severity LIST          those that are shown, default {error warning}
#       -daemon PART            a part of the KEY of the daemon
#       -object PART            a part of NAME@DAEMON, a pattern
#       -text PART              a part of the message
#       -keep N                 how many messages are kept
#       -paused BOOLEAN         the list holds still, and new messages are kept
#       -state disabled         grey, and nothing can be chosen
#       -style Page.TFrame      it stands on the window's ground
# Methods:
#       clear                   forget all messages
#       messages                those that are wanted, dicts as sorma::world tells them, also while it is paused
#       text                    what is shown, in lines
snit::widget ::sorma::trailview {
    hulltype ttk::frame
    delegate option -style to hull
    typevariable States {error refused warning warn verbose asking}     ;# a severity's colour and mark
    option -keys -default *@* -readonly 1
    option -severity -default {error warning} -configuremethod Choose
    option -daemon -default {} -configuremethod Choose
    option -object -default {} -configuremethod Choose
    option -text -default {} -configuremethod Choose
    option -paused -default 0 -configuremethod Choose
    option -keep -default 500
    option -height -default 6 -readonly 1
    ::sorma::stateParts
    component tree
    variable tokens {}
    variable kept {}            ;# list of {KEY MESSAGE}

    constructor args {
        $self configurelist $args
        install tree using ttk::treeview $win.tree -style [::sorma::style own Treeview] -columns {mark time object text} -show headings -height $options(-height) \
            -selectmode extended -yscrollcommand [list $win.bar set]
        ttk::scrollbar $win.bar -style [expr {[$hull cget -style] eq "Page.TFrame" ? "Page." : {}}][::sorma::style own Vertical.TScrollbar] -command [list $tree yview]
        foreach {column title width stretch} {mark {} 24 0 time Time 100 0 object Object 130 0 text Message 360 1} {
            $tree heading $column -text [::msgcat::mc $title] -anchor w
            $tree column $column -width [::sorma::style pixels $width] -stretch $stretch
        }
        bind $win <<ThemeChanged>> [mymethod Enable]
        $self Enable
        pack $win.bar -side right -fill y
        pack $tree -side left -fill both -expand 1
        ::sorma::parts::byKeys $tree
        bind $tree <Control-c> [mymethod Act Copy]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        set tokens [lmap pattern $options(-keys) {::sorma::world watch $pattern -events trail -command [mymethod Told]}]
    }
    method Enable {} {
        if {$tree eq {}} return
        dict for {severity state} $States {
            $tree tag configure $severity -foreground [$self Shade $state]
        }
        # Keys and mouse are bound to its class.
        set tags [lsearch -all -inline -exact -not [bindtags $tree] Treeview]
        if {[$self Enabled]} {
            $tree state !disabled
            bindtags $tree [linsert $tags [lsearch -exact $tags $tree]+1 Treeview]
        } else {
            $tree state disabled
            $tree selection set {}
            bindtags $tree $tags
        }
    }
    method Ended window {
        if {$window eq $win} {
            foreach token $tokens {
                ::sorma::world unwatch $token
            }
        }
    }
    method Told {event key message} {
        if {![winfo exists $tree]} return
        if {[dict get $message so] eq {}} {
            set key @$key                   ;# a daemon's own
        }
        if {[dict get $message lost] > 0} {
            $self Keep $key [dict merge $message [dict create text "[dict get $message lost] messages were lost here" severity warning]]
        }
        $self Keep $key $message
    }
    method Keep {key message} {
        dict set message text [string range [dict get $message text] 0 2000]    ;# strangers write as much as they like
        lappend kept [list $key $message]
        if {[llength $kept] > 1.2 * $options(-keep)} {
            set kept [lrange $kept end-[expr {$options(-keep) - 1}] end]
        }
        if {$options(-paused) || ![$self Wanted $key $message]} return
        set below [expr {[lindex [$tree yview] 1] >= 1.0}]
        $self Add $key $message
        set items [$tree children {}]
        if {[llength $items] > $options(-keep)} {
            $tree delete [lrange $items 0 end-$options(-keep)]
        }
        if {$below} {
            $tree see [lindex [$tree children {}] end]
        }
    }
    method Wanted {key message} {
        set daemon [string range $key [string length [dict get $message so]]+1 end]
        return [expr {[dict get $message severity] in $options(-severity) && [string match -nocase *$options(-object)* $key]
            && [string match -nocase *[::sorma::text::escape $options(-daemon)]* $daemon]
            && [string match -nocase *[::sorma::text::escape $options(-text)]* [dict get $message text]]}]
    }
    # A message that is among the newest ones already keeps its line: that goes to the end, with its last time and how often it came.
    method Add {key message} {
        set time [::sorma::text::time [dict get $message time]]
        lassign [lmap text [list [::sorma::world shown $key] [dict get $message text]] {::sorma::text::clean [string map {\n { }} $text]}] object text
        foreach item [lrange [$tree children {}] end-7 end] {
            set times [$tree item $item -text]
            set values [$tree item $item -values]
            if {[lrange $values 2 end] eq [list $object [Often $text $times]]} {
                $tree item $item -text [incr times] -values [list [lindex $values 0] $time $object [Often $text $times]]
                $tree move $item {} end
                return
            }
        }
        set severity [dict get $message severity]
        $tree insert {} end -tags [list $severity] -text 1 -values [list [::sorma::style mark [dict get $States $severity]] $time $object $text]
    }
    proc Often {text times} {
        return [expr {$times > 1 ? "$text ($times times)" : $text}]
    }
    # Other messages are wanted: show what is kept of them.
    method Choose {option value} {
        set options($option) $value
        if {$tree eq {} || $options(-paused)} return
        $tree delete [$tree children {}]
        foreach item [lrange $kept end-[expr {$options(-keep) - 1}] end] {
            if {[$self Wanted {*}$item]} {
                $self Add {*}$item
            }
        }
        $tree yview moveto 1
    }
    method Copy {} {
        clipboard clear -displayof $win
        clipboard append -displayof $win -- [$self Lines [$tree selection]]
    }
    method Lines items {
        return [join [lmap item $items {join [lrange [$tree item $item -values] 1 end] "  "}] \n]
    }
    method text {} {
        return [$self Lines [$tree children {}]]
    }
    method clear {} {
        $tree delete [$tree children {}]
        set kept {}
    }
    method messages {} {
        return [lmap item $kept {
            if {![$self Wanted {*}$item]} continue
            lindex $item 1
        }]
    }
}
