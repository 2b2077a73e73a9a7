# remember.tcl ?kills? ?seed? -- a daemon remembers a hundred values that change all the time, and is killed at random instants. After each
# restart each value is the last one that was answered or the one that was being set, with its author and time.

source [file join [file dirname [file normalize [info script]]] faults.tcl]

# Set values one after another until the daemon has gone.
proc work {daemon objects} {
    while 1 {
        set object [lindex $objects [expr {int(rand() * [llength $objects])}]]
        dict set ::begun $object [incr ::last]
        if {[catch {$object@$daemon CTRL -gain $::last}]} return
        dict set ::answered $object $::last
        update
    }
}

# The objects whose value is neither, or whose author and time are not told.
proc wrong {daemon objects} {
    set wrong {}
    foreach object $objects {
        set told [lindex [$object@$daemon DBX -why -gain] 3]
        regexp {^-gain (\S+): (.*)} $told -> value from
        if {$value ni [list [dict get $::answered $object] [dict get $::begun $object]]
                || ![regexp {^remembered, set by \S+@\S+ \S+ at \d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3};} $from]} {
            lappend wrong $object
            puts "$told, and [dict get $::answered $object] was answered, [dict get $::begun $object] begun"
        }
        dict set ::answered $object $value
        dict set ::begun $object $value
    }
    return $wrong
}

attack {
    set kills [expr {$argc > 0 ? [lindex $argv 0] : 200}]
    expr {srand([expr {$argc > 1 ? [lindex $argv 1] : 1}])}
    set dict [file join $env(SORMA_RUNTIME_DIR) lab.dict]
    close [open $dict w]
    set objects {}
    for {set n 0} {$n < 100} {incr n} {
        lappend objects gain.n$n
    }
    set name remember[pid]
    daemon start -name $name -dict $dict
    foreach object $objects {
        $object@$name CTRL -remember -gain
        $object@$name CTRL -gain 0.5
        dict set answered $object 0.5
        dict set begun $object 0.5
    }
    set all {}
    for {set k 0} {$k < $kills} {incr k} {
        after [expr {int(300 * rand())}] [list daemon kill $name]
        sorma::configure -timeout 500
        work $name $objects
        sorma::configure -timeout 25000
        daemon start -name $name -dict $dict
        lappend all {*}[wrong $name $objects]
    }
    promise "after each kill each value is the old or the new one" [expr {$all eq {}}]
    promise "values were set meanwhile" [expr {$last > $kills}]
    promise "nothing but the file stays" [expr {[glob -nocomplain -tails -directory $env(SORMA_RUNTIME_DIR) lab.dict*] in {{lab.dict lab.dict.remembered} {lab.dict.remembered lab.dict}}}]
    file delete $dict $dict.remembered
    puts "$kills kills, $last values set"
}
