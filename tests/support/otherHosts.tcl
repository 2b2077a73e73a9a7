# otherHosts.tcl -- other hosts, as far as names go: processes with a runtime folder and a dictionary of their own.
#
# The constraint etcd: there is one, and SORMA was built with libcurl (etcdBuilt).
#
# elsewhere SCRIPT      run it as on another host. $::line is what the dictionary says of the directory
# newName               one that no other suite has: all of them are on this host
# result CLIENT SCRIPT  what a client (child.tcl) answers; an error: its code and text
# standBy NAME WORD ... start a standby daemon; its pipe, when it waits
# takesOver PIPE        wait until it serves; its line
# answers CLIENT NAME   the process that answers for a name
# noMore                end clients, daemons and standbys
# elsewhereEnd          remove what it has left

source [file join $supportFolder etcd.tcl]
source [file join $supportFolder child.tcl]

set count 0
set home $env(SORMA_RUNTIME_DIR)
set folders {}

# Without libcurl, a line of etcd fails otherwise than by its syntax.
proc etcdBuilt {} {
    set inner [interp create]
    $inner eval [list set auto_path $::auto_path]
    $inner eval {package require sorma}
    $inner eval {sorma::so::dict CTRL -add @directory etcd:}
    catch {$inner eval {sorm DBX -where @robot}} - options
    interp delete $inner
    return [string match "SORMA DIRECTORY SYNTAX*" [dict get $options -errorcode]]
}
testConstraint etcd [expr {[etcd::available] && [etcdBuilt]}]

proc elsewhere script {
    set folder [exec mktemp -d [file join [temporaryDirectory] runXXXXXX]]
    lappend ::folders $folder
    set ::env(SORMA_RUNTIME_DIR) $folder
    set ::env(SORMA_DICT) [file join $folder lab.dict]
    set f [open $::env(SORMA_DICT) w]
    puts $f "@directory $::line"
    close $f
    try {
        uplevel 1 $script
    } finally {
        set ::env(SORMA_RUNTIME_DIR) $::home
        unset ::env(SORMA_DICT)
    }
}
proc newName {} {
    return robot[pid]x[incr ::count]
}
proc result {client script} {
    lassign [child::ask $client $script] code result errorCode
    return [if {$code} {list [lrange $errorCode 1 2] $result} else {set result}]
}
proc standBy {name args} {
    set pipe [open [list | sormad -name $name -standby 1 {*}$args 2>@stderr] r]
    lappend ::standbys $pipe
    if {[gets $pipe line] < 0 || [lrange $line 0 1] ne "standby $name"} {
        error "sormad said \"$line\" instead of standby"
    }
    fconfigure $pipe -blocking 0
    return $pipe
}
proc takesOver pipe {
    waitFor {[gets $pipe ::took] >= 0}
    return $::took
}
proc endStandbys {} {
    foreach pipe $::standbys {
        exec sh -c {kill "$@"} kill -TERM [pid $pipe]
        fconfigure $pipe -blocking 1
        close $pipe                         ;# an error unless it has ended with 0
    }
    set ::standbys {}
}
set standbys {}
proc answers {client name} {
    result $client [list nop@$name EXEC]
    return [expr {[regexp {\[(\d+)\]} [result $client [list sorm@$name DBX -connection]] -> pid] ? $pid : {}}]
}
proc noMore {} {
    child::endAll
    daemon stopAll
    endStandbys
}
proc elsewhereEnd {} {
    file delete -force {*}$::folders
}
