# cell.tcl ?DAEMON? -- an operator's panel for a cell with two devices, a server of breakfast and a belt; written by hand.
#
#     wish doc/examples/cell.tcl          makes the devices here; with a daemon's name, uses that daemon's devices

package require sorma
package require sorma::panel

set at [if {[llength $argv] > 0} {string cat @[lindex $argv 0]}]
wm title . "Cell"
grid [ttk::frame .f -padding [sorma::style pixels 12]] -sticky nsew
grid columnconfigure . 0 -weight 1
grid columnconfigure .f 1 -weight 1
set row 0
foreach {text widget options} [list \
    "Where to serve"  sorma::entry  [list -name foo.cell$at -option -where] \
    "Tempo"           sorma::choice [list -name foo.cell$at -option -tempo] \
    "Breakfast"       sorma::check  [list -name foo.cell$at -option -breakfast] \
    "Period of the belt" sorma::slider [list -name cycle.belt$at -option -period]] {
    incr row
    grid [ttk::label .f.label$row -text $text] [$widget .f.field$row {*}$options] -sticky ew -padx 6 -pady 4
}
grid [sorma::button .f.serve -name foo.cell$at -request EXEC -text Serve] \
    [sorma::button .f.stop -name cycle.belt$at -request {CTRL -stop} -text "Stop the belt"] -sticky ew -padx 6 -pady 8

# A device does not exist before its first call, and looking makes none: call both.
foreach device [list foo.cell$at cycle.belt$at] {
    sorma::async -command {apply {{future} {catch {$future result}; $future destroy}}} $device CTRL -dump
}
