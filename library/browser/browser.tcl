# browser.tcl -- sorma::browser: the bus in one window. Left what there is, and a search; right what was chosen, in tabs, and a log.

package require sorma::announced
package require sorma::browserCircuit
package require sorma::browserDict
package require sorma::browserEvents
package require sorma::browserGraph
package require sorma::browserLaunch
package require sorma::browserLog
package require sorma::browserOverview
package require sorma::browserSearch
package require sorma::browserTabs
package require sorma::browserText
package require sorma::browserTimeline
package require sorma::browserTree
package require sorma::panel
package require sorma::text
package provide sorma::browser 1.0

# ::sorma::browser .w --
#       A frame; the window around it gets its menu. It asks nobody itself: what it shows is what the model knows, or is told.
# Methods:
#       choose PLACE ?OPTION?       as if it was clicked; its panel shows that option
#       tree, search                those parts
#       tab NAME ?select?           the window of a tab; select: it is brought to the front
#       text                        what the tab in front shows
#       copy                        that text, to the clipboard
#       save FILE                   that text; of the graph as its own save FILE
snit::widget ::sorma::browser {
    hulltype ttk::frame
    component tree -public tree
    component search -public search
    component tabs
    variable place {}           ;# what is shown, as the tree has it
    variable panel {}           ;# the panel that is shown; empty: none
    variable timer {}           ;# until the choice rests
    variable at {}              ;# option at which the panel is to be opened
    variable entering 0         ;# its first field gets the keyboard
    typevariable Help {apply {text {dict get [::sorma::table parse $text] help}}}
    typevariable Titles {overview Overview panel Panel help Help statistics Statistics audit Audit
        dictionary Dictionary events Events graph Graph launch Launch log Log circuit Circuit timeline "Time line"}

    constructor {} {
        set pad [::sorma::style pixels 8]
        $hull configure -style Page.TFrame
        ttk::panedwindow $win.panes -orient horizontal
        ttk::frame $win.left -style Page.TFrame
        install tree using ::sorma::browserTree $win.left.tree -command [mymethod Chosen]
        install search using ::sorma::browserSearch $win.left.search -tree $tree -command [mymethod Found]
        pack $search -side top -fill x -padx $pad -pady [list [::sorma::style pixels 4] 0]
        pack $tree -side top -fill both -expand 1 -padx [list $pad 0]
        lower $tree $search                                 ;# the search comes first by Tab
        install tabs using ttk::notebook $win.tabs -width [::sorma::style pixels 560] -height [::sorma::style pixels 480]
        ::sorma::browserOverview $tabs.overview -command [mymethod Pressed]
        ttk::frame $tabs.panel
        foreach name {help statistics audit} {
            ::sorma::browserText $tabs.$name
        }
        ::sorma::browserDict $tabs.dictionary
        ::sorma::browserEvents $tabs.events
        ::sorma::browserGraph $tabs.graph
        ::sorma::browserLaunch $tabs.launch
        ::sorma::browserLog $tabs.log
        ::sorma::browserCircuit $tabs.circuit
        ::sorma::browserTimeline $tabs.timeline
        dict for {name title} $Titles {
            $tabs add $tabs.$name -text [::msgcat::mc $title] -underline [expr {$name in {launch circuit timeline} ? 2 : 0}]
        }
        ::sorma::browserTabs::manage $tabs
        ttk::label $tabs.panel.none -justify left -anchor nw -padding $pad -text [::msgcat::mc "Choose an object at the left, or search (Ctrl-F)."]
        pack $tabs.panel.none -fill both -expand 1
        ttk::label $win.state -anchor w -style Page.TLabel -padding [list $pad [expr {$pad / 2}]]
        $win.panes add $win.left -weight 0
        $win.panes add $tabs -weight 1
        pack $win.state -side bottom -fill x
        pack $win.panes -fill both -expand 1
        $self Menu
        if {[winfo toplevel $win] ne "."} {
            wm minsize [winfo toplevel $win] [::sorma::style pixels 820] [::sorma::style pixels 530]
        }
        bind $win <Destroy> +[mymethod Ended %W]
    }
    method Ended window {
        if {$window eq $win} {
            after cancel $timer
        }
    }

    # ---- keys ----

    method Menu {} {
        set top [winfo toplevel $win]
        menu $win.menu -tearoff 0
        foreach {name label} {file File view View} {
            menu $win.menu.$name -tearoff 0
            $win.menu add cascade -label [::msgcat::mc $label] -underline 0 -menu $win.menu.$name
        }
        set entries [list file "Save the view\u2026" Ctrl+S s [mymethod AskSave] file "Copy the view" Ctrl+Y y [mymethod copy] \
            file "Listen to the events, or stop" Ctrl+L l [mymethod Do events listen] file "Pause the log, or go on" Ctrl+P p [mymethod Do log pause] \
            \
            file "New dashboard" Ctrl+N n {::sorma::window dashboard} file "Open a dashboard\u2026" Ctrl+O o [mymethod AskDashboard] \
            file "Open a recording\u2026" Ctrl+R r [mymethod AskRecording] file Quit Ctrl+Q q [list destroy $top] view Search Ctrl+F f [list focus $win.left.search.bar.entry] \
            view Tree Ctrl+T t [list focus $tree.tree]]
        set number -1
        dict for {name title} $Titles {
            # The digits first, then letters.
            set key [if {[incr number] < 10} {set number} else {dict get {circuit u timeline m} $name}]
            lappend entries view $title Ctrl+[string toupper $key] Key-$key [mymethod tab $name select]
        }
        foreach {menu label shown key script} $entries {
            $win.menu.$menu add command -label [::msgcat::mc $label] -accelerator $shown -command $script
            bind $top <Control-$key> "$script; break"
        }
        $win.menu.file insert last cascade -label [::msgcat::mc "Announced in the network"] -menu [menu $win.menu.file.network -tearoff 0]
        # Avahi is asked when somebody comes near, not by each browser that is opened.
        $win.menu.file configure -postcommand [list ::sorma::announced::ask [list ::sorma::parts::answer [mymethod Announced]]]
        $self Announced {}
        ttk::notebook::enableTraversal $tabs
        $top configure -menu $win.menu
    }
    # Daemons that others announce, as they were heard last. One that is chosen is called, no other one.
    method Announced found {
        set menu $win.menu.file.network
        $menu delete 0 end
        foreach one $found {
            $menu add command -label [::sorma::text::clean [join $one {  }]] -command [list ::sorma::world add [lindex $one 1]]
        }
        if {$found eq {}} {
            $menu add command -label [::msgcat::mc "None, as far as Avahi knows"] -state disabled
        }
    }

    # ---- what programs say ----

    method tab {name {select {}}} {
        if {$select ne {}} {
            $tabs select $tabs.$name
            focus $tabs
        }
        return $tabs.$name
    }
    method choose {what {option {}}} {
        set at $option
        $tree choose $what
        if {$option ne {}} {
            $tabs select $tabs.panel
            $self Chosen $what
        }
    }
    # Something was pressed in the overview.
    method Pressed what {
        lassign $what kind daemon
        if {$kind eq "errors"} {
            $tabs.log about $daemon
            $tabs select $tabs.log
        } else {
            set entering [expr {$kind eq "object"}]
            $self choose $what
        }
    }
    method Found {what option} {
        $self choose $what $option
    }
    method text {} {
        set name [lindex [split [$tabs select] .] end]
        if {$name ne "panel"} {
            return [$tabs.$name text]
        }
        if {$panel eq {}} {
            return [$tabs.panel.none cget -text]
        }
        set subject [$panel subject]
        set table [$subject table]
        return [join [list [$subject name] {*}[if {$table ne {}} {
            lmap option [dict get $table options] {string cat "[lindex $option 0] [list [dict get [$subject get [lindex $option 0]] value]]"}
        }]] \n]
    }
    method copy {} {
        clipboard clear -displayof $win
        clipboard append -displayof $win -- [$self text]
    }
    method save file {
        if {[$tabs select] eq "$tabs.graph"} {
            $tabs.graph save $file
        } else {
            ::sorma::text::writeFile $file [$self text]\n
        }
    }
    # A command of a tab, which is shown meanwhile.
    method Do {name method} {
        $tabs select $tabs.$name
        $tabs.$name $method
    }
    method AskSave {} {
        set types [if {[$tabs select] eq "$tabs.graph"} {list {PDF .pdf} {Picture .png} {PostScript .ps}}]
        set file [tk_getSaveFile -parent $win -filetypes [list {*}$types {Text .txt}]]
        if {$file ne {} && [catch {$self save $file} message]} {
            tk_messageBox -parent $win -icon error -message $message
        }
    }

    method AskDashboard {} {
        set file [tk_getOpenFile -parent $win -filetypes {{Dashboard .dash} {All *}}]
        if {$file ne {} && [catch {::sorma::window dashboard $file} message]} {
            tk_messageBox -parent $win -icon error -message $message
        }
    }

    method AskRecording {} {
        set file [tk_getOpenFile -parent $win -filetypes {{Recording .rec} {All *}}]
        if {$file ne {} && [catch {::sorma::window timeline $file} message]} {
            tk_messageBox -parent $win -icon error -message $message
        }
    }

    # ---- what was chosen ----

    # Moving through the tree with the arrow keys must not make a panel for each row.
    method Chosen what {
        if {$place ne $what && [$tabs select] eq "$tabs.overview" && [lindex $what 0] ne "daemon"} {
            $tabs select $tabs.panel
        }
        set place $what
        after cancel $timer
        set timer [after 60 [mymethod Show]]
    }
    method Show {} {
        lassign $place kind key name
        set daemon [::sorma::world get $key]
        $win.state configure -text [if {$kind in {connection subscription}} {
            $tree shown $place
        } elseif {$daemon ne {}} {
            ::sorma::text::clean [string trimright "[dict get $daemon name]  [dict get $daemon address]  [dict get $daemon state]  [dict get $daemon why]"]
        }]
        $tabs.dictionary about $key
        $tabs.events about [if {$kind in {object flavor}} {$self Name $key $name} elseif {$kind eq "subscription"} {$self Name $key [lindex $name 0]}]
        set object [if {$kind eq "object"} {::sorma::world get $name@$key}]
        foreach {tab class} {circuit circuit timeline recorder} {
            $tabs.$tab about [if {[dict exists $object class] && [dict get $object class] eq $class} {$self Name $key $name}]
        }
        $self Show[string totitle $kind] $key $name
    }
    method Name {key name} {
        return [if {$key eq "self"} {set name} else {string cat $name@$key}]
    }
    method ShowObject {key name} {
        $tabs.statistics ask $key [list "CALLS AND THEIR TIMES" [list sorm DBX -look $name -stats] {} "THE LAST MESSAGES" [list sorm DBX -look $name -trail] {}]
        $tabs.audit ask $key [list "WHO SENT WHICH CTRL" [list sorm DBX -look $name -audit] {}]
        $tabs.help ask $key [list {} [list sorm DBX -describe $name] $Help]
        $self Panel [$self Name $key $name]
    }
    method ShowClass {key name} {
        $tabs.help ask $key [list {} [list sorm DBX -describe $name.?] $Help]
        foreach tab {statistics audit} {
            $tabs.$tab show "Choose an object of the class."
        }
        $self Panel {}
    }
    # A recipe: there is no object of that name, and looking makes none.
    method ShowFlavor {key name} {
        $tabs.help ask $key [list {} [list sorm DBX -describe $name] $Help]
        foreach tab {statistics audit} {
            $tabs.$tab show "[$self Name $key $name] has not been made; its first use makes it."
        }
        $tabs.dictionary choose $name
        $self Panel {}
    }
    method ShowConnections {key name} {
        $self ShowRows $key connections
    }
    method ShowSubscriptions {key name} {
        $self ShowRows $key subscriptions
    }
    method ShowConnection {key row} {
        $self ShowConnections $key {}
    }
    method ShowSubscription {key row} {
        $self ShowSubscriptions $key {}
    }
    method ShowRows {key what} {
        $tabs.statistics ask $key [list [string toupper $what] [list sorm DBX -inventory $what] [mymethod Table $what]]
        foreach tab {help audit} {
            $tabs.$tab show "[string totitle $what] are in the tab Statistics."
        }
        $self Panel {}
    }
    method Table {what text} {
        set rows [dict get $text $what]
        return [if {$what eq "connections"} {
            ::sorma::text::table {{} who address seconds calls waiting} [lmap row $rows {lrange $row 0 5}] -width 0 -right {3 4 5}
        } else {
            ::sorma::text::table {object events for} [lmap row $rows {lrange $row 0 2}] -width 0
        }]
    }
    method ShowDaemon {key name} {
        $tabs.help ask $key [list CLASSES {sorm CTRL -classes} {}]
        $tabs.statistics ask $key [list STATISTICS {sorm CTRL -statistics} {} CONNECTIONS {sorm CTRL -connections} {} BUDGETS {sorm DBX -budgets} {}]
        $tabs.audit ask $key [list "WHAT WAS REFUSED" {sorm DBX -denied} {} "WHO MAY DO WHAT" {sorm CTRL -policy} {}]
        $self Panel {}
    }
    # The panel of an object. One in which something was typed and not applied stays, and comes again with its object.
    method Panel name {
        if {$panel ne {}} {
            if {[[$panel subject] name] ne $name} {
                if {[llength [[$panel subject] edited]] > 0} {
                    pack forget $panel
                } else {
                    destroy $panel
                }
                set panel {}
            }
        }
        if {$name eq {}} {
            pack $tabs.panel.none -fill both -expand 1
            return
        }
        pack forget $tabs.panel.none
        if {$panel eq {}} {
            foreach child [winfo children $tabs.panel] {
                if {[winfo class $child] eq "Panel" && [[$child subject] name] eq $name} {
                    set panel $child
                }
            }
            if {$panel eq {}} {
                set panel [::sorma::panel $tabs.panel.p[incr Last] $name]
            }
            pack $panel -fill both -expand 1
        }
        if {$entering} {
            $panel enter
            set entering 0
        }
        if {$at ne {}} {
            $panel search $at
            set at {}
        }
    }
    typevariable Last 0
}
