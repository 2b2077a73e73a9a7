# doors.tcl -- what the scripts of suite doors need at a daemon.

set hasMetrics [expr {![catch {package require sorma::service::metrics}]}]

# Two more classes: one can be locked, and one publishes an event with each EXEC.
proc toolsFile {} {
    return [makeFile {
        oo::class create ::locked {
            superclass sorma::Service
            sorma::concurrency exclusive
            method exec message {return {}}
        }
        oo::class create ::bell {
            superclass sorma::Service
            method exec message {my publish rung; return {}}
        }
    } tools.tcl]
}

# What the scripts need.
proc furnish d {
    if {$::hasMetrics} {
        sorm@$d CTRL -create metrics -port 0
        set ::metricsAt [lindex [metrics@$d DBX -address] 3]
    }
    foreach name {foo.a nop.a cycle.door cycle.timed circuit.door fork.door gain.door host.door foo.gone locked.a locked.owned bell.a} {
        sorm@$d CTRL -create $name
    }
    sorm@$d CTRL -create shmem_w.door[pid] -floats 2
    sorm@$d CTRL -alias shmem_w.door shmem_w.door[pid]
    sorm@$d CTRL -alias foo.second foo.a
    sorm@$d CTRL -alias locked.second locked.a
    foo.a@$d CTRL -tempo largo
    locked.owned@$d CTRL -lock
}

# Ask for the metrics; a refusal is an error as that of a request.
proc GetMetrics {} {
    lassign [http::get {*}[split $::metricsAt :] /metrics] status text
    if {$status == 403} {
        return -code error -errorcode [list SORMA COMM DENIED metrics [lindex [regexp -inline {may not (\w+)} $text] 1]] $text
    }
    return $status
}
