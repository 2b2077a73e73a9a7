# console.tcl -- sorma::console: scott's prompt as a widget. shell.tcl runs, completes, explains and remembers the typed lines,
# as at scott's own prompt. Here are the keys and the looks.
#
# The text is the output, a prompt, and what is being typed. Only the latter can be changed. Output is inserted as text and
# never evaluated; its colours are the escape sequences that a terminal gets.

package require Tk
package require snit
package require sorma::consoleHistory
package require sorma::line
package require sorma::shell
package require sorma::style
package require sorma::text
package require sorma::trail
package require sorma::world
package provide sorma::console 1.0

# ::sorma::console .w ?-keep n? ?-output boolean? ?-command prefix? ?-width n? ?-height n? --
#       -keep: lines of output that are kept; -output: what the program writes to stdout and stderr is shown here, and not there;
#       -command: called on Ctrl-D at an empty line; width and height in characters
# Methods:
#       execute LINES: as if typed; write TEXT ?error?: show a text; stop: give up what runs; clear; unfold ?N?: the trail of a message;
#       running, output, input: what there is
# Event <<SormaDone>> comes after each command.
snit::widget ::sorma::console {
    hulltype ttk::frame
    delegate option -takefocus to hull
    option -keep -default 5000
    option -output -default 0 -readonly 1
    option -command -default {}
    option -width -default 100 -readonly 1
    option -height -default 30 -readonly 1
    component screen            ;# the text; its command, by which bindings reach it, is Edit
    component raw               ;# the text itself
    variable queue {}           ;# lines that have been entered and not run yet
    variable running 0          ;# number of the command that runs, 0: none
    variable line {}            ;# the command that runs
    variable coming {}          ;# pairs of text and tag: what has come and is not shown yet
    variable flushing {}        ;# id of after
    variable hinting {}
    variable going {}
    variable folds {}           ;# numbers of the trails that are there
    typevariable Last 0         ;# number of the last command, fold or completion of all consoles
    typevariable Readers {}     ;# consoles that show what the program writes
    ::sorma::consoleHistory

    constructor args {
        $self configurelist $args
        set screen $win.text
        # The colours that a terminal would show for the same sequences.
        ::sorma::style text $screen {sgr31 refused sgr33 warn sgr32 good sgr2 asking sgr36 mine prompt asking fold mine} -wrap char -undo 0 \
            -padx [::sorma::style pixels 6] -pady [::sorma::style pixels 4] -width $options(-width) -height $options(-height) \
            -yscrollcommand [list $win.bar set] -insertwidth [::sorma::style pixels 2]
        # Each binding that changes the text does so by the command of its name. So it is known which part may be changed.
        set raw ::sorma::console::raw$screen
        rename $screen $raw
        interp alias {} ::$screen {} {*}[mymethod Edit]
        ::sorma::style menu $screen $win [mymethod Menu]
        # begin: before the prompt, where output goes; limit: behind it
        foreach mark {begin limit} {
            $raw mark set $mark 1.0
            $raw mark gravity $mark left
        }
        ttk::scrollbar $win.bar -style [::sorma::style own Vertical.TScrollbar] -command [list $screen yview]
        # Its width is that of the window, whatever stands there.
        ttk::label $win.hint -font [::sorma::style font small] -anchor w -width 1 -padding [list [::sorma::style pixels 12] [::sorma::style pixels 6]]
        grid $screen $win.bar -sticky nsew
        grid $win.hint - -sticky ew
        grid columnconfigure $win 0 -weight 1
        grid rowconfigure $win 0 -weight 1
        bindtags $screen [linsert [bindtags $screen] 1 SormaSearch SormaConsole]
        foreach tag {sgr1 typed} {
            $raw tag configure $tag -font [::sorma::style font fixedStrong]
        }
        $raw tag configure fold -underline 1
        $raw tag raise sel
        $self Looks
        bind $win <<ThemeChanged>> [mymethod Looks]
        bind $win <Destroy> +[mymethod Ended %W]
        $hull configure -takefocus 0
        bind $win <FocusIn> [mymethod Focused]
        $raw tag bind fold <Button-1> [mymethod FoldAt @%x,%y]
        $raw tag bind fold <Enter> [list $raw configure -cursor hand2]
        $raw tag bind fold <Leave> [list $raw configure -cursor xterm]
        ::sorma::shell::prepare
        $self BeginHistory
        ::sorma::news::hook {answer counted} [mymethod HintSoon]
        if {$options(-output)} {
            $type Read $win
        }
        $self Prompt
    }
    method Ended window {
        if {$window ne $win} return
        after cancel $flushing
        after cancel $hinting
        after cancel $going
        ::sorma::news::unhook [mymethod HintSoon]
        if {$running} {
            ::sorma::shell::cancel console$running
        }
        $type Unread $win
        interp alias {} ::$screen {}
    }
    # Tk tells that to the windows around one, too.
    method Focused {} {
        if {[focus -displayof $win] eq $win} {
            focus $screen
        }
    }

    method Looks {} {
        $win.hint configure -foreground [::sorma::style colour asking]
    }

    # ---- the text ----

    # The bindings' commands: they only change the line that is being typed.
    method Edit {word args} {
        switch -- $word {
            insert {
                set args [lassign $args index]
                if {[$raw compare $index < limit]} {
                    $self ToEnd
                    set index end-1c
                }
                $raw insert $index {*}$args
            }
            delete { $self Remove {*}$args }
            replace {
                set args [lassign $args from to]
                $self Remove $from $to
                $self Edit insert $from {*}$args
            }
            default { $raw $word {*}$args }
        }
    }
    method Remove {from {to {}}} {
        if {$to eq {}} {
            set to "$from + 1 chars"
        }
        if {[$raw compare $from < limit]} {
            set from limit
        }
        if {[$raw compare $from < $to]} {
            $raw delete $from $to
        }
    }
    method ToEnd {} {
        $raw mark set insert end-1c
    }
    # Above the prompt.
    method Above args {
        $raw mark gravity begin right
        $raw mark gravity limit right
        $raw insert begin {*}$args
        $raw mark gravity begin left
        $raw mark gravity limit left
    }
    method Prompt {{text "% "}} {
        $raw delete begin limit
        $raw mark gravity limit right
        $raw insert begin $text prompt
        $raw mark gravity limit left
        if {[$raw compare insert < limit]} {
            $self ToEnd
        }
        $raw see insert
    }
    # Lines of the output that are no longer kept, the oldest.
    method Forget lines {
        set to [expr {$lines + 1}].0
        $raw delete 1.0 [expr {[$raw compare $to < begin] ? $to : "begin"}]
        foreach n $folds {
            if {[$raw tag ranges detail$n] ne {}} break
            $raw tag delete detail$n fold$n
            set folds [lrange $folds 1 end]
        }
    }

    # ---- output ----

    # write TEXT ?error? -- shown above what is being typed, soon; with what comes in the same moment.
    method write {text {severity {}}} {
        lappend coming $text [if {$severity eq "error"} {string cat sgr31}]
        if {$flushing eq {}} {
            set flushing [after 20 [mymethod Flush]]
        }
    }
    # The output so far, up to the last end of a line; with whole: all of it.
    method Flush {{whole 0}} {
        after cancel $flushing
        set flushing {}
        set pieces $coming
        set coming {}
        if {[llength $pieces] > 0 && ![string match *\n [lindex $pieces end-1]]} {
            lassign [lrange $pieces end-1 end] text tag
            if {$whole} {
                lset pieces end-1 $text\n
            } else {
                set at [string last \n $text]
                set coming [list [string range $text $at+1 end] $tag]
                lset pieces end-1 [string range $text 0 $at]
            }
        }
        set below [expr {[lindex [$raw yview] 1] >= 1.0}]
        foreach {text tag} $pieces {
            $self Insert $text $tag
        }
        $self Trim
        if {$below} {
            $raw see insert
        }
    }
    # A longer text than is kept loses its begin. Lines so long that Tk would be slow are broken.
    method Insert {text tags} {
        set lines [split $text \n]
        if {[llength $lines] > $options(-keep)} {
            set text [join [lrange $lines end-$options(-keep) end] \n]
        }
        if {[string length $text] > 4000} {
            regsub -all {[^\n]{4000}} $text "&\n" text
        }
        set colours {}
        set at 0
        set pieces {}
        foreach {range code} [regexp -all -inline -indices "\x1b\\\[(\[0-9;\]*)m" $text] {
            lappend pieces [string range $text $at [lindex $range 0]-1] [concat $tags $colours]
            set code [string range $text {*}$code]
            set colours [if {$code ni {{} 0}} {string cat sgr$code}]
            set at [expr {[lindex $range 1] + 1}]
        }
        $self Above {*}$pieces [string range $text $at end] [concat $tags $colours]
    }
    # Now and then, that is quicker than with each line.
    method Trim {} {
        set more [expr {int([$raw index end]) - $options(-keep)}]
        if {$more > $options(-keep) / 10} {
            $self Forget $more
        }
    }
    method clear {} {
        $self Flush 1
        $self Forget [expr {int([$raw index end])}]
    }
    method output {} {
        $self Flush
        return [$raw get 1.0 begin]
    }
    # Columns of a line.
    method Columns {} {
        if {![winfo ismapped $screen]} {
            return $options(-width)
        }
        return [expr {max(20, ([winfo width $screen] - 2 * [$raw cget -padx]) / [font measure [$raw cget -font] 0])}]
    }

    # Text that is written to stdout and stderr goes to its readers.
    typemethod Read console {
        if {$Readers eq {}} {
            foreach channel {stdout stderr} {
                chan configure $channel -encoding utf-8
                chan push $channel [mytypemethod Tap]
                chan configure $channel -buffering none -buffersize 1000000      ;# one write is one text
            }
        }
        lappend Readers $console
    }
    typemethod Unread console {
        if {$console ni $Readers} return
        set Readers [lsearch -all -inline -exact -not $Readers $console]
        if {$Readers eq {}} {
            foreach channel {stdout stderr} {
                catch {chan pop $channel}       ;# other code may have closed it
            }
        }
    }
    typemethod Tap {command handle args} {
        switch -- $command {
            initialize { return {initialize finalize write} }
            write {
                if {[catch {encoding convertfrom utf-8 [lindex $args 0]} text]} {
                    set text [encoding convertfrom iso8859-1 [lindex $args 0]]
                }
                foreach console $Readers {
                    catch {$console write $text [if {$handle eq "stderr"} {string cat error}]}
                }
                return {}
            }
        }
    }

    # ---- the part below a message ----

    method Fold trail {
        lappend folds [incr Last]
        set n [llength [lmap entry $trail {if {[::sorma::trail::isStack $entry]} continue; set entry}]]
        $self Above "  " {} "\u25b8 trail: $n message[expr {$n == 1 ? {} : "s"}]" [list fold fold$Last] "\n" {}
        $self Insert [::sorma::showTrail $trail -width [$self Columns] -colour 1]\n detail$Last
        $raw tag configure detail$Last -elide 1
    }
    method FoldAt index {
        foreach tag [$raw tag names $index] {
            if {[regexp {^fold(\d+)$} $tag -> n]} {
                $self unfold $n
            }
        }
    }
    # unfold ?N? -- unfold, or fold again, the N-th trail of those that are there; default the last one.
    method unfold {{n {}}} {
        if {$n eq {}} {
            set n [lindex $folds end]
        }
        if {$n ni $folds || $n eq {}} return
        set hidden [$raw tag cget detail$n -elide]
        set typing [expr {[$raw dlineinfo insert] ne {}}]
        $raw tag configure detail$n -elide [expr {!$hidden}]
        set mark [lindex [$raw tag ranges fold$n] 0]
        $raw insert "$mark + 1 chars" [expr {$hidden ? "\u25be" : "\u25b8"}] [$raw tag names $mark]
        $raw delete $mark
        foreach {from to} [lrange [$raw tag ranges detail$n] 0 1] {
            $raw see [expr {$hidden ? "$to - 1 chars" : $mark}]
        }
        if {$typing} {
            $raw see insert
        }
    }

    # ---- what is typed ----

    method input {} {
        return [$raw get limit end-1c]
    }
    method SetInput text {
        $raw delete limit end-1c
        $raw insert end-1c $text
        $self ToEnd
        $raw see insert
        $self HintSoon
    }
    # Where the cursor is in what is typed.
    method Point {} {
        return [string length [if {[$raw compare insert < limit]} {$self input} else {$raw get limit insert}]]
    }

    # execute LINES -- as if they had been typed. An incomplete command goes on in the next line.
    method execute lines {
        lappend queue {*}[split $lines \n]
        $self Next
    }
    method Entered {} {
        set text [$self input]
        $self ToEnd
        if {![::sorma::line::isComplete $text]} {
            $raw insert insert \n
            $raw see insert
            return
        }
        $self SetInput {}
        $self execute $text
    }
    method Next {} {
        if {$running || [llength $queue] == 0} return
        set command {}
        while {[llength $queue] > 0} {
            set queue [lassign $queue next]
            append command $next
            if {[::sorma::line::isComplete $command]} break
            append command \n
        }
        if {![::sorma::line::isComplete $command]} {
            $self SetInput $command[$self input]
            return
        }
        $self Prompt {}
        $self Above "% " prompt $command typed "\n" {}
        if {[string trim $command] eq {}} {
            $self Prompt
            set going [after 0 [mymethod Next]]
            return
        }
        $self Keep $command
        set line $command
        set running [incr Last]
        $self HintSoon
        $raw see insert
        ::sorma::shell::begin console$running $command [$self Settings] [mymethod Done $running]
    }
    method Settings {} {
        return [list -json 0 -width [$self Columns] -colour 1 -whole 0]
    }
    method running {} {
        return [expr {$running > 0}]
    }
    # Its outcome is there.
    method Done {number code result settings} {
        if {$number != $running} return
        set running 0
        $self Flush 1
        set text [::sorma::shell::show $line $code $result $settings [$self Settings]]
        if {$text ne {}} {
            $self Insert $text\n {}
        }
        set trail [if {[HasTrail $code $result $settings]} {::sorma::trail}]
        if {[llength $trail] > 0} {
            $self Fold $trail
        }
        $self Trim
        try {
            ::sorma::shell::note $line $code $result $settings
        } on error message {
            $self Insert "scott: $message\n" sgr31
        }
        $self Prompt
        $self HintSoon
        set going [after 0 [mymethod Next]]
        event generate $win <<SormaDone>>
    }
    proc HasTrail {code result settings} {
        if {$code == 1} {
            return [string match "SORMA *" [dict get $settings -errorcode]]
        }
        return [expr {![catch {llength $result}] && ([lindex $result 0] eq "RET" && "TDBX" in $result
            || [lindex $result end-1] eq "trail" && [dict exists $result code])}]
    }
    # stop -- give up what runs, and what was to follow.
    method stop {} {
        set queue {}
        if {$running} {
            $self Done $running {*}[::sorma::shell::cancel console$running]
        }
    }

    # ---- keys ----

    method Cancel {} {
        if {[$self EndSearch]} return
        if {$running} {
            $self stop
        } elseif {[$self input] ne {}} {
            $self LeaveHistory
            $self SetInput {}
        }
    }
    # Ctrl-C copies the selection; without one it cancels, as in a terminal.
    method Interrupt {} {
        if {[$raw tag ranges sel] ne {}} {
            tk_textCopy $screen
            $raw tag remove sel 1.0 end
        } else {
            $self Cancel
        }
    }
    method EndOfInput {} {
        if {[$self input] ne {}} {
            $self Remove insert
        } elseif {$options(-command) ne {} && !$running} {
            uplevel #0 $options(-command)
        }
    }
    method Home {} {
        $raw mark set insert limit
        $raw tag remove sel 1.0 end
    }
    method Menu {menu window} {
        $menu add command -label [::msgcat::mc Copy] -underline 0 -accelerator Ctrl-C -command [list tk_textCopy $screen] \
            -state [expr {[$raw tag ranges sel] eq {} ? "disabled" : "normal"}]
        $menu add command -label [::msgcat::mc Paste] -underline 0 -accelerator Ctrl-V -command [list event generate $screen <<Paste>>]
        $menu add separator
        $menu add command -label [::msgcat::mc "Unfold the last trail"] -underline 0 -accelerator Alt-T -command [mymethod unfold] \
            -state [expr {$folds eq {} ? "disabled" : "normal"}]
        $menu add command -label [::msgcat::mc "Stop what runs"] -underline 0 -accelerator Escape -command [mymethod stop] \
            -state [expr {$running ? "normal" : "disabled"}]
        $menu add command -label [::msgcat::mc Clear] -underline 1 -accelerator Ctrl-L -command [mymethod clear]
    }

    # Tab: what all that can stand there have in common; when nothing more is clear, all of them. Nothing stands still meanwhile, and it ends
    # with the window.
    method Complete {} {
        coroutine ${selfns}::completing[incr Last] {*}[mymethod Completing]
    }
    method Completing {} {
        set text [$self input]
        set point [$self Point]
        set found [::sorma::shell::complete {} $text $point]
        if {[$self input] ne $text || [$self Point] != $point} return
        set words [dict get $found words]
        set from [dict get $found from]
        if {[llength $words] == 0 || $from > $point} {
            return [bell -displayof $win]
        }
        set common [lindex $words 0]
        foreach word $words {
            while {![string equal -length [string length $common] $common $word]} {
                set common [string range $common 0 end-1]
            }
        }
        set unique [expr {[llength $words] == 1}]
        if {$unique && ![regexp {[/@.:]$} $common] && [string index $text $point] ne " "} {
            append common " "           ;# it is finished
        }
        if {[string length $common] > $point - $from || $common ne [string range $text $from $point-1]} {
            $raw delete "limit + $from chars" "limit + $point chars"
            $raw insert "limit + $from chars" $common
            $raw mark set insert "limit + [expr {$from + [string length $common]}] chars"
        } elseif {!$unique} {
            $self List $words
        }
        $raw see insert
        $self HintSoon
    }
    method List words {
        set wide [expr {2 + [::tcl::mathfunc::max {*}[lmap word $words {::sorma::text::columns $word}]]}]
        set perRow [expr {max(1, [$self Columns] / $wide)}]
        set rows [expr {([llength $words] + $perRow - 1) / $perRow}]
        set text {}
        for {set row 0} {$row < min($rows, 12)} {incr row} {
            for {set i $row} {$i < [llength $words]} {incr i $rows} {
                set word [lindex $words $i]
                append text $word [string repeat " " [expr {$wide - [::sorma::text::columns $word]}]]
            }
            append text \n
        }
        if {$rows > 12} {
            append text "... [llength $words] in all\n"
        }
        $self Insert $text sgr2
    }

    # The line below: the expected words, the searched text, or a note that something runs.
    method HintSoon args {
        if {$hinting eq {}} {
            set hinting [after idle [mymethod Hint]]
        }
    }
    method Hint {} {
        set hinting {}
        set text [if {[$self Searches]} {
            $self SearchHint
        } elseif {$running && [$self input] eq {}} {
            ::msgcat::mc "running; Escape gives it up"
        } elseif {[$self input] eq {}} {
            ::msgcat::mc "Tab completes, Up and Ctrl-R bring back what was typed, help tells what there is"
        } else {
            ::sorma::shell::hint {} [$self input] [$self Point]
        }]
        $win.hint configure -text $text
    }
}

# During a search, keys belong to the search first.
bind SormaSearch <Key> {if {[[winfo parent %W] Searched %K %A]} break}
apply {{} {
    foreach {event script} {
        <Return> Entered  <KP_Enter> Entered  <Tab> Complete  <Control-c> Interrupt  <Escape> Cancel  <Control-d> EndOfInput
        <Control-l> clear  <Control-r> Search  <Alt-t> unfold  <Home> Home  <Control-a> Home
    } {
        bind SormaConsole $event "\[winfo parent %W\] $script; break"
    }
    foreach {event script} {<Up> Older  <Down> Newer  <Control-p> Older  <Control-n> Newer} {
        bind SormaConsole $event "if {\[\[winfo parent %W\] $script\]} break"
    }
    foreach {event script} {
        <Control-u> {%W delete limit insert}
        <Control-k> {%W delete insert {insert lineend}}
        <Control-w> {%W delete [tk::TextPrevPos %W insert tcl_startOfPreviousWord] insert}
        <Left> {if {[%W compare insert != limit]} {tk::TextSetCursor %W insert-1displayindices}}
        <Control-o> {}
        <Control-t> {}
    } {
        bind SormaConsole $event "$script; break"
    }
}}
bind SormaConsole <KeyRelease> {[winfo parent %W] HintSoon}
