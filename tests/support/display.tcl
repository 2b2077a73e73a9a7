# display.tcl -- an X server of the suite's own, for tests that draw. Real events stand for the acts of a person.
#
# A process cannot outlive its X server: so the suite runs in a child, and this one starts the server and ends it.

namespace eval display {
    variable Missing {}         ;# why there is no display
}

# display::run SCRIPT ARGS -- run a suite where there is a display. Returns in the child alone, or where there can be none.
proc display::run {script words} {
    variable Missing
    if {[info exists ::env(SORMA_TEST_DISPLAY)]} {
        if {[catch {package require Tk} Missing]} return
        set Missing {}
        wm withdraw .
        return
    }
    if {[auto_execok Xvfb] eq {}} {
        set Missing "Xvfb is not installed"
        return
    }
    set pipe [start]
    if {$pipe eq {}} {
        set Missing "Xvfb does not start"
        return
    }
    set ::env(SORMA_TEST_DISPLAY) 1
    set failed [catch {exec [info nameofexecutable] $script {*}$words >@ stdout 2>@ stderr < /dev/null}]
    end $pipe
    exit $failed
}

# display::start -- an X server, which env(DISPLAY) names from now on; empty: it does not start. end SERVER
proc display::start {} {
    set pipe [open |[list Xvfb -displayfd 1 -screen 0 1280x1024x24 -nolisten tcp 2> /dev/null] r]
    set number [gets $pipe]
    if {![string is integer -strict $number]} {
        catch {close $pipe}
        return
    }
    set ::env(DISPLAY) :$number
    return $pipe
}
proc display::end pipe {
    exec sh -c {kill "$@"} kill [pid $pipe]
    catch {close $pipe}
}

# display::click WINDOW ?x y? -- press and release the left button there.
proc display::click {window {x 5} {y 5}} {
    foreach event {<Enter> <ButtonPress-1> <ButtonRelease-1>} {
        event generate $window $event -x $x -y $y
    }
    update
}

# display::focus WINDOW -- the keyboard is there, or in a part of it, when this returns: the X server gives it when it comes to that.
proc display::focus window {
    ::focus -force $window
    set end [expr {[clock milliseconds] + 30000}]
    update
    while {![string match $window* [::focus -displayof $window]]} {
        if {[clock milliseconds] > $end} {
            error "$window does not get the focus: \"[::focus -displayof $window]\" has it"
        }
        after 10
        update
    }
}

# display::type WINDOW TEXT -- each character as a key.
proc display::type {window text} {
    focus $window
    foreach character [split $text {}] {
        set names [list " " space - minus . period \r Return]
        event generate $window <Key> -keysym [expr {[dict exists $names $character] ? [dict get $names $character] : $character}]
    }
    update
}

# display::saveAs WINDOW TYPE FILE -- what the dialog of WINDOW that asks for a file, once it is there, is answered: a type (a pattern) and a name.
proc display::saveAs {window type file} {
    if {![winfo exists $window.__tk_filedialog]} {
        after 20 [list display::saveAs $window $type $file]
        return
    }
    upvar #0 ::tk::dialog::file::__tk_filedialog data
    $data(typeMenu) invoke $type
    $data(ent) delete 0 end
    $data(ent) insert 0 $file
    $data(okBtn) invoke
}
