# arm.tcl -- class arm, which must never obey two daemons. Each request that it takes is a line of its journal: when [us since 1970], and where.

oo::class create arm {
    superclass sorma::Service
    sorma::purpose "says on which host it is"
    sorma::writes text 0.. "" "the host"
    method exec message {
        set file [open $::env(JOURNAL) a]
        puts $file [list [clock microseconds] $::env(PLACE)]
        close $file
        return [dict create text $::env(PLACE)]
    }
}
