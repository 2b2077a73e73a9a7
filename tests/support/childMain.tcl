# childMain.tcl -- does what comes on standard input, a list of one script a line; answers with code, result, error code.
package require sorma
puts ready
flush stdout
while {[gets stdin line] >= 0} {
    if {$line eq "exit"} exit
    set code [catch [lindex $line 0] result options]
    puts [list $code $result [expr {$code ? [dict get $options -errorcode] : {}}]]
    flush stdout
}
