# trailview.tcl -- sorma::trailview: the messages of an object, of a daemon or of all, as they come, the newest below.

package require Tk
package require snit
package require sorma::style
package require sorma::world
package provide sorma::trailview 1.0

# ::sorma::trailview .w ?-keys PATTERN? ?-severity LIST? ?-keep n? ?-height lines? --
#       -keys of sorma::world, default *@*: trails of all objects; -severity: which are shown, default {error warning}; -keep: how many
# Methods:
#       clear; messages: list of dicts as sorma::world tells them
snit::widget ::sorma::trailview {
    hulltype ttk::frame
    option -keys -default *@* -readonly 1
    option -severity -default {error warning}
    option -keep -default 500
    option -height -default 6 -readonly 1
    component tree
    variable token {}
    variable messages {}        ;# dict: item of the tree -> message

    constructor args {
        $self configurelist $args
        install tree using ttk::treeview $win.tree -columns {time object text} -show headings -height $options(-height) -selectmode extended \
            -yscrollcommand [list $win.bar set]
        ttk::scrollbar $win.bar -command [list $tree yview]
        foreach {column title width stretch} {time Time 100 0 object Object 130 0 text Message 360 1} {
            $tree heading $column -text $title -anchor w
            $tree column $column -width [::sorma::style pixels $width] -stretch $stretch
        }
        foreach {severity state} {error refused warning warn verbose asking} {
            $tree tag configure $severity -foreground [::sorma::style colour $state]
        }
        pack $win.bar -side right -fill y
        pack $tree -side left -fill both -expand 1
        bind $tree <Control-c> [mymethod Copy]
        bind $win <Destroy> +[mymethod Ended %W]
        set token [::sorma::world watch $options(-keys) -events trail -command [mymethod Told]]
    }
    method Ended window {
        if {$window eq $win} {
            ::sorma::world unwatch $token
        }
    }
    method Told {event key message} {
        if {![winfo exists $tree] || [dict get $message severity] ni $options(-severity)} return
        set below [expr {[lindex [$tree yview] 1] >= 1.0}]
        if {[dict get $message lost] > 0} {
            $self Add [dict merge $message [dict create text "[dict get $message lost] messages were lost here" severity warning]] $key
        }
        $self Add $message $key
        set items [$tree children {}]
        if {[llength $items] > $options(-keep)} {
            set gone [lrange $items 0 end-$options(-keep)]
            $tree delete $gone
            set messages [dict remove $messages {*}$gone]
        }
        if {$below} {
            $tree see [lindex [$tree children {}] end]
        }
    }
    method Add {message key} {
        set ms [expr {[dict get $message time] / 1000}]
        set item [$tree insert {} end -tags [dict get $message severity] -values [list \
            [clock format [expr {$ms / 1000}] -format %H:%M:%S].[format %03d [expr {$ms % 1000}]] [string map {@self {}} $key] \
            [string map {\n { }} [dict get $message text]]]]
        dict set messages $item $message
    }
    method Copy {} {
        clipboard clear -displayof $win
        clipboard append -displayof $win -- [join [lmap item [$tree selection] {join [$tree item $item -values]}] \n]
    }
    method clear {} {
        $tree delete [$tree children {}]
        set messages {}
    }
    method messages {} {
        return [dict values $messages]
    }
}
