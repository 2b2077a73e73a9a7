# checkData.tcl -- values to check against, as they stand in tests/data: sections [name] of lines "key = numbers".

# The file as a dictionary: section -> key -> list of numbers.
proc checkData file {
    set in [open [file join [file dirname $::supportFolder] data $file]]
    set data {}
    foreach line [split [read $in] \n] {
        if {[regexp {^\[(\w+)\]$} $line -> section]} continue
        if {[regexp {^([^#\s]+) = (.*)$} $line -> key numbers]} {
            dict set data $section $key $numbers
        }
    }
    close $in
    return $data
}

# The largest difference of two lists of numbers; Inf when their lengths differ.
proc difference {one other} {
    if {[llength $one] != [llength $other]} {
        return Inf
    }
    return [tcl::mathfunc::max 0.0 {*}[lmap x $one y $other {expr {abs($x - $y)}}]]
}
