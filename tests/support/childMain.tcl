# childMain.tcl -- does what comes on standard input, a list of one script a line; answers with code, result, error code.
# A list may have several lines.
package require sorma
puts ready
flush stdout
set said {}
while {[gets stdin line] >= 0} {
    append said $line \n
    if {![info complete $said]} continue
    set line [string range $said 0 end-1]
    set said {}
    if {$line eq "exit"} exit
    set code [catch [lindex $line 0] result options]
    puts [list $code $result [expr {$code ? [dict get $options -errorcode] : {}}]]
    flush stdout
}
