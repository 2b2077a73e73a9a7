# consoleHistory.tcl -- sorma::consoleHistory, typed lines come back to a console: by Up and Down, and by a search. A macro for its body.

package require snit
package require sorma::shell
package provide sorma::consoleHistory 1.0

# ::sorma::consoleHistory -- the widget has the text raw, with the mark limit before what is typed, and the methods input, SetInput, write,
# Insert and HintSoon of a console. It gives these methods to it:
#
#       BeginHistory            lines of earlier consoles, and of scott, can come back
#       Keep COMMAND            one more line
#       LeaveHistory            the next older line is the last one again
#       Older, Newer            Up and Down
#       Search                  Ctrl-R: search, or go to an older line that fits
#       Searched KEY CHARACTER  a key while there is a search
#       Searches, SearchHint    is there a search; the line below the text
#       EndSearch               what was typed is there again; returns whether there was a search
snit::macro ::sorma::consoleHistory {} {
    variable history {}
    variable place 0            ;# in the history; its length: none of it
    variable draft {}           ;# the line that was being typed before the user went to the history
    variable wanted             ;# what is searched for there; does not exist: nothing

    method BeginHistory {} {
        try {
            set history [::sorma::shell::recall]
        } on error message {
            $self write "scott: $message\n" error
        }
        $self LeaveHistory
    }
    method LeaveHistory {} {
        set place [llength $history]
    }
    # A line that begins with a blank is kept out of the history.
    method Keep command {
        if {[string index $command 0] ne " "} {
            if {$command ne [lindex $history end]} {
                lappend history $command
            }
            try {
                ::sorma::shell::remember $command
            } on error message {
                $self Insert "scott: $message\n" sgr31
            }
        }
        $self LeaveHistory
    }

    # Up and Down move in a text of several lines, and leave it at its first and last one. Returns whether they have left it.
    method Older {} {
        if {[$raw compare insert >= limit] && int([$raw index insert]) > int([$raw index limit])} {
            return 0
        }
        $self Recall -1
        return 1
    }
    method Newer {} {
        if {[$raw compare insert >= limit] && int([$raw index insert]) < int([$raw index end-1c])} {
            return 0
        }
        $self Recall 1
        return 1
    }
    method Recall step {
        set n [llength $history]
        if {$place == $n} {
            set draft [$self input]
        }
        set to [expr {$place + $step}]
        if {$to < 0 || $to > $n} return
        set place $to
        $self SetInput [if {$to == $n} {set draft} else {lindex $history $to}]
    }
    # Ctrl-R searches what was typed, again for older ones.
    method Search {} {
        if {![info exists wanted]} {
            set draft [$self input]
            set wanted {}
            $self LeaveHistory
            $self HintSoon
        } else {
            $self Find [expr {$place - 1}]
        }
    }
    method Find from {
        for {set i [expr {min($from, [llength $history] - 1)}]} {$i >= 0} {incr i -1} {
            if {[string first $wanted [lindex $history $i]] >= 0} {
                set place $i
                $self SetInput [lindex $history $i]
                return
            }
        }
        $self HintSoon
    }
    method Searches {} {
        return [info exists wanted]
    }
    method SearchHint {} {
        return [::msgcat::mc "search: %s   (Ctrl-R: an older one, Return: take it, Escape: as it was)" $wanted]
    }
    method EndSearch {} {
        if {![info exists wanted]} {
            return 0
        }
        unset wanted
        $self SetInput $draft
        return 1
    }
    # A key while there is a search: is it used up?
    method Searched {key character} {
        if {![info exists wanted]} {
            return 0
        }
        if {$key eq "BackSpace"} {
            set wanted [string range $wanted 0 end-1]
        } elseif {[string is print -strict $character]} {
            append wanted $character
        } elseif {[regexp {^(Shift|Control|Alt|Meta|Super|Caps|ISO|Num)_|^(Escape|r|c)$} $key]} {
            return 0
        } else {
            unset wanted                ;# what was found stays
            $self HintSoon
            return [expr {$key in {Return KP_Enter Tab}}]
        }
        $self Find [llength $history]
        return 1
    }
}
