# run.tcl SUITE ?TMPDIR? ?tcltest option ...? -- runs one suite in this process.
#
# Takes its own words out of argv before tcltest is loaded, which would parse them.

set words [lassign $argv suite folder]
if {$suite eq {}} {
    puts stderr "usage: run.tcl SUITE ?TMPDIR? ?tcltest option ...?"
    exit 2
}
set argv [list {*}[expr {$folder eq {} ? {} : [list -tmpdir $folder]}] {*}$words]
set argc [llength $argv]
set argv0 $suite
cd [file dirname [file normalize $suite]]
source -encoding utf-8 [file tail $suite]
exit [expr {$::suiteFailed > 0}]
