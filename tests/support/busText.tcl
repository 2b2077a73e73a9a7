# busText.tcl -- groups of the program busText (tests/embed/busText.cpp) as tests of a suite.

# Run one group. Returns "ok", or the lines of what failed.
proc busText group {
    set program [file join $::env(SORMA_BUILD) busText]
    if {![catch {exec $program $group 2>@1} output] && [regexp {^[1-9]\d* passed, 0 failed$} $output]} {
        return ok
    }
    return $output
}
