# pieces.tcl -- what suites that read streams have in common.

set script [file join $supportFolder counter.tcl]
source $script

# All pieces of a stream.
proc pieces {request args} {
    set s [sorma::stream $request {*}$args]
    try {
        set all {}
        while {[$s next piece]} { lappend all [dict remove $piece code] }
        return $all
    } finally {
        $s close
    }
}
proc openAt object { lindex [$object DBX -stream list] 3 }
proc made object { $object cget -made }
# Error symbol or result of a request.
proc told {object args} {
    if {[catch {$object DBX -stream {*}$args} message options]} {
        return [lrange [dict get $options -errorcode] 1 2]
    }
    return $message
}
