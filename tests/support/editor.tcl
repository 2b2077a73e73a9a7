# editor.tcl ?SCRIPT? -- reads lines at a terminal with sorma::edit and says what came, until the end. For edit.test.
#
# A line that begins with ! is executed, between two lines. Completion knows fruits, and some names that lead on; the
# hint is the length of the line.

package require sorma::edit
fconfigure stdout -encoding utf-8         ;# also where the locale says nothing

proc complete {line point} {
    set from [expr {[string last " " $line $point-1] + 1}]
    set typed [string range $line $from $point-1]
    set known {apple apricot banana blueberry folder/ größe so@}
    return [dict create from $from words [lsearch -all -inline -glob $known $typed*] hint {}]
}

proc hint {line point} {
    if {$line eq "fail"} {
        error "the hint fails"
    }
    return [expr {$line eq {} ? {} : "[string length $line] characters, cursor at $point, and the rest of a hint"}]
}

proc show result {
    puts "<[join $result " "]>"
}

interp bgerror {} {apply {{message options} {puts stderr "background: $message"}}}
eval [lindex $argv 0]
while 1 {
    try {
        set came [sorma::edit read -prompt "> " -complete complete -hint hint]
        show $came
        lassign $came how line
        if {$how eq "end"} break
        if {[string match !* $line]} {
            puts "= [uplevel #0 [string range $line 1 end]]"
        }
        sorma::edit remember $line
    } on error {message options} {
        puts "error $message [dict get $options -errorcode]"
        if {[lrange [dict get $options -errorcode] 0 1] eq {SORMA EDIT}} break
    }
}
