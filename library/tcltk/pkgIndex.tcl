# pkgIndex.tcl -- for Debian's Tcl, which looks below P/lib/tcltk: leads to P/lib/sorma1.0.

apply {dir {
    set file [file join $dir pkgIndex.tcl]
    if {[file exists $file]} {
        source -encoding utf-8 $file
    }
}} [file join [file dirname [file dirname $dir]] [file tail $dir]]
