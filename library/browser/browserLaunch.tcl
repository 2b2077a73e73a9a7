# browserLaunch.tcl -- sorma::browserLaunch: the daemons of a launch file are started and ended, and what they say is shown.
#
# Each has a sorma-launch of its own (--only), which looks after it: it restarts it when the file says so, and ends it when this window
# goes.

package require Tk
package require snit
package require sorma::launchFile
package require sorma::parts
package require sorma::style
package require sorma::text
package provide sorma::browserLaunch 1.0

# ::sorma::browserLaunch .w ?-keep lines? --
# Methods:
#       open FILE           a launch file
#       start ?NAME ...?    default all; it waits for those that a daemon comes after
#       stop ?NAME ...?     default all
#       state NAME          ended, waits, starts, ready or ends
#       text                what they have said
snit::widget ::sorma::browserLaunch {
    hulltype ttk::frame
    option -keep -default 5000 -readonly 1
    component tree
    component output
    variable file {}            ;# that was read
    variable typed {}           ;# in the entry
    variable daemons {}         ;# dict: NAME -> settings, as the file has them
    variable states {}          ;# dict: NAME -> state
    variable pipes {}           ;# dict: NAME -> pipe to its launcher

    constructor args {
        $self configurelist $args
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        ttk::frame $win.bar
        ttk::label $win.bar.label -text [::msgcat::mc "Launch file"]
        ttk::entry $win.bar.file -textvariable [myvar typed]
        ttk::button $win.bar.read -text [::msgcat::mc "Read"] -command [mymethod Open]
        ttk::button $win.bar.browse -text [::msgcat::mc "Browse\u2026"] -command [mymethod Browse]
        pack $win.bar.label -side left -padx [list 0 $pad]
        pack $win.bar.browse $win.bar.read -side right -padx [list $pad 0]
        pack $win.bar.file -side left -fill x -expand 1         ;# the last: it gives way in a small window
        install tree using ttk::treeview $win.tree -style [::sorma::style own Treeview] -columns state -height 5 -selectmode extended
        $tree heading #0 -text [::msgcat::mc Daemon] -anchor w
        $tree heading state -text [::msgcat::mc State] -anchor w
        foreach {tag state} {ready good ended gone} {
            $tree tag configure $tag -foreground [::sorma::style colour $state]
        }
        ttk::frame $win.do
        foreach {name title script} [list start Start [mymethod Chosen start] stop Stop [mymethod Chosen stop] \
            all "Start all" [mymethod start] none "Stop all" [mymethod stop]] {
            ttk::button $win.do.$name -text $title -command $script
            pack $win.do.$name -side left -padx [list 0 $pad]
        }
        ttk::frame $win.said
        set output [::sorma::style text $win.said.text {} -wrap char -height 8 -width 40 -state disabled -takefocus 1 -padx $pad -pady $pad \
            -yscrollcommand [list $win.said.scroll set]]
        ttk::scrollbar $win.said.scroll -style [::sorma::style own Vertical.TScrollbar] -command [list $output yview]
        pack $win.said.scroll -side right -fill y
        pack $output -side left -fill both -expand 1
        pack $win.bar -side top -fill x -padx $edge -pady [list $edge $pad]
        pack $tree -side top -fill x -padx $edge
        pack $win.do -side top -fill x -padx $edge -pady $pad
        pack $win.said -side top -fill both -expand 1 -padx [list $edge 0] -pady [list 0 $edge]
        ::sorma::parts::byKeys $tree
        bind $win.bar.file <Return> [mymethod Open]
        bind $output <ButtonPress-1> {+focus %W}
        bind $win <Destroy> +[mymethod Ended %W]
    }
    method Ended window {
        if {$window eq $win} {
            foreach pipe [dict values $pipes] {
                chan event $pipe readable {}
                catch {exec kill {*}[pid $pipe]}
                catch {close $pipe}                 ;# it does not block: the launcher ends behind the scenes
            }
        }
    }

    # ---- what programs say ----

    method open path {
        if {[dict size $pipes] > 0} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "$file: its daemons run ([join [dict keys $pipes] {, }]); stop them before another file is read"
        }
        set read [::sorma::launchFile::read $path]
        set file [file normalize $path]
        set typed $path
        set daemons $read
        set states {}
        $tree delete [$tree children {}]
        foreach name [dict keys $daemons] {
            $tree insert {} end -id [list $name] -text $name
            $self State $name ended
        }
    }
    method start args {
        foreach name [if {[llength $args] > 0} {set args} else {dict keys $daemons}] {
            if {[dict get $states $name] eq "ended"} {
                $self State $name waits
            }
        }
        $self StartDue
    }
    # Those that come after others are told first.
    method stop args {
        foreach name [if {[llength $args] > 0} {set args} else {lreverse [::sorma::launchFile::startOrder $daemons]}] {
            if {[dict exists $pipes $name]} {
                catch {exec kill {*}[pid [dict get $pipes $name]]}
                $self State $name ends
            } elseif {[dict get $states $name] eq "waits"} {
                $self State $name ended
            }
        }
    }
    method state name {
        return [dict get $states $name]
    }
    method text {} {
        return [$output get 1.0 end-1c]
    }

    # ---- running ----

    method StartDue {} {
        foreach {name settings} $daemons {
            if {[dict get $states $name] ne "waits"} continue
            set missing [lmap other [dict get $settings -after] {
                if {[dict get $states $other] in {ready ended}} continue
                set other
            }]
            if {[llength $missing] > 0} continue
            if {[catch {
                set pipe [::open |[list {*}[$self Launcher] --only $name $file </dev/null 2>@1]]
            } message]} {
                $self Put "$name: $message"
                $self Failed $name
                continue
            }
            chan configure $pipe -blocking 0 -encoding utf-8
            catch {chan configure $pipe -profile replace}           ;# Tcl 9 is strict otherwise
            dict set pipes $name $pipe
            $self State $name starts
            chan event $pipe readable [list ::sorma::parts::answer [mymethod Said $name]]
        }
    }
    # The one that lies beside this program, else the one along PATH.
    method Launcher {} {
        set beside [file join [file dirname [file normalize $::argv0]] sorma-launch]
        if {[file executable $beside]} {
            return [list $beside]
        }
        set found [auto_execok sorma-launch]
        if {$found eq {}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "there is no sorma-launch along PATH, which starts daemons; put its folder there"
        }
        return $found
    }
    method Said name {
        set pipe [dict get $pipes $name]
        set count 0
        while {[incr count] < 200 && [chan gets $pipe line] >= 0} {
            $self Put $line
            if {[regexp {^ *\* \| ready: } $line] && [dict get $states $name] eq "starts"} {
                $self State $name ready
                $self StartDue
            }
        }
        if {[eof $pipe]} {
            dict unset pipes $name
            chan configure $pipe -blocking 1
            catch {close $pipe}
            if {[dict get $states $name] eq "starts"} {
                $self Failed $name
            } else {
                $self State $name ended
            }
            $self StartDue
        }
    }
    # It does not get ready, and those that wait for it are not started.
    method Failed name {
        $self State $name ended
        foreach {other settings} $daemons {
            if {[dict get $states $other] eq "waits" && $name in [dict get $settings -after]} {
                $self Put "$other is not started: it comes after $name"
                $self Failed $other
            }
        }
    }
    method State {name state} {
        dict set states $name $state
        $tree item [list $name] -values [list $state] -tags [list $state]
    }
    method Put line {
        set below [expr {[lindex [$output yview] 1] >= 1.0}]
        $output configure -state normal
        $output insert end [::sorma::text::cut [::sorma::text::clean $line] 2000]\n
        set many [expr {int([$output index end]) - $options(-keep)}]
        if {$many > 0} {
            $output delete 1.0 $many.0
        }
        $output configure -state disabled
        if {$below} {
            $output see end
        }
    }

    # ---- the window ----

    method Open {} {
        if {[catch {$self open $typed} message]} {
            $self Put $message
        }
    }
    method Browse {} {
        set path [tk_getOpenFile -parent $win -filetypes {{{Launch files} .launch} {{All files} *}}]
        if {$path ne {}} {
            set typed $path
            $self Open
        }
    }
    method Chosen action {
        set names [lmap item [$tree selection] {lindex $item 0}]
        if {[llength $names] > 0} {
            $self $action {*}$names
        }
    }
}
