# kills.tcl ?KILLS? ?SEED? -- runs kills.py with a daemon whose service writes each number that it is called with into a file (support/ledger.tcl).

lassign [concat $argv [lrange {200 4711} [llength $argv] end]] kills seed
set here [file dirname [file normalize [info script]]]
set folder [exec mktemp -d /tmp/sorma-run-XXXXXX]
set env(SORMA_RUNTIME_DIR) $folder
set env(LEDGER) [file join $folder ledger]
close [open $env(LEDGER) w]
set python [expr {[file executable /usr/bin/python3] ? "/usr/bin/python3" : "python3"}]
try {
    puts [exec $python [file join $here kills.py] [info nameofexecutable] [file join $here .. support killer.tcl] [file join $here .. support ledger.tcl] $env(LEDGER) python[pid] $kills $seed 2>@stderr]
} finally {
    file delete -force $folder
}
