# tutorialShell.tcl -- a tclsh for a program that types: a command as base64 on a line, back what a terminal would show,
# and a byte 1. The event loop runs meanwhile, as it does in scott and under readline.

fconfigure stdout -encoding utf-8
proc tutorialRead {} {
    if {[gets stdin line] < 0} {
        if {[eof stdin]} exit
        return
    }
    catch {uplevel #0 [encoding convertfrom utf-8 [binary decode base64 $line]]} came
    if {$came ne {}} {
        puts $came
    }
    puts -nonewline \1\n
    flush stdout
}
fconfigure stdin -blocking 0
fileevent stdin readable tutorialRead
vwait forever
