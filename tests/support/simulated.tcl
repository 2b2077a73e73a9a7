# simulated.tcl -- an ideal arm in time of its own, its sensor and its clock, for tests of the robot's ticks.
#
# The test moves the clock on tick by tick. As fast as the machine can, and each run of a seed is the same.
#
#     simulated start {-guards wspc.room -tasks circuit.tracker}      pino, with power; buffers begin with $simulated::Prefix
#     simulated tick              one tick of the control task; simulated::Time, Place and Joints are known afterwards
#     simulated end
#
# The other side's state may be changed between ticks: simulated::Power, Cause, Wrist (6), Clock [s] added to the times of its records.

package require sorma::service::shmem

namespace eval simulated {
    variable Period 0.015
    variable Home {0.2713 1.1164 -3.2675 0 -0.9905 -2.8703}        ;# above the table, the tool down
    variable Runs 0
    variable Prefix {} Time 0 Begin 0 Ticks 0
    variable Power 0 Cause 0 Wrist {0 0 0 0 0 0} Clock 0
    variable Joints {} Place {} Posed 0
    variable InUse 0            ;# number of the set-point
    namespace export start tick on end
    namespace ensemble create
}

proc simulated::start {words {prefix {}}} {
    variable Prefix [expr {$prefix eq {} ? "t[pid]sim[incr ::simulated::Runs]." : $prefix}]
    variable Period
    variable Home
    variable Time 100.0 Begin 100.0 Ticks 0 Power 0 Cause 0 Wrist {0 0 0 0 0 0} Clock 0 Joints $Home Place {} Posed 0 InUse 0
    variable Waking 0
    foreach {name key floats blocks} {state arm.state 22 64 wrist wrist.state 7 64 clock lab.clock 3 16} {
        sorma::create shmem_w.sim$name -key $Prefix$key -floats $floats -blocks $blocks
    }
    Write
    sorma::so::dict CTRL -add cycle.pino {-watchdog 20}
    sorma::create pino -prefix $Prefix -labTime 1 -interval $Period -priority 0 {*}$words
    pino CTRL -start
    foreach {name key} {set arm.set pose tool.pose} {
        sorma::create shmem_r.sim$name -key $Prefix$key
    }
    on
}
# What is there of the other side, at the present time.
proc simulated::Write {} {
    variable Time
    variable Clock
    variable Joints
    variable Power
    variable Cause
    variable Wrist
    variable InUse
    set time [expr {$Time + $Clock}]
    shmem_w.simstate EXEC FMSG 22 $time {*}$Joints 0 0 0 0 0 0 0 0 0 0 0 0 $Power $Cause $InUse
    shmem_w.simwrist EXEC FMSG 7 $time {*}$Wrist
    shmem_w.simclock EXEC FMSG 3 $Time 1 0
}
# One tick: it has written its set-point, which the arm reaches at once.
proc simulated::tick {} {
    variable Period
    variable Begin
    variable Time
    variable Ticks
    variable Joints
    variable Place
    variable Posed
    variable Power
    variable Cause
    variable Waking
    variable InUse
    incr Ticks
    # A little late, so that rounding never makes it early.
    set Time [expr {$Begin + $Ticks * $Period + 1e-6}]
    Write
    set bound [expr {[clock milliseconds] + 30000}]
    # The pose is written after the set-point.
    while {[catch {shmem_r.simpose exec} pose] || [lindex [dict get $pose ints] 0] <= $Posed} {
        if {[clock milliseconds] > $bound} {
            return -code error "the control task has written no set-point"
        }
        update
    }
    set Posed [lindex [dict get $pose ints] 0]
    set sent [shmem_r.simset exec]
    set InUse [lindex [dict get $sent ints] 0]
    set floats [dict get $sent floats]
    set mode [lindex $floats 13]
    if {$mode == 0} {
        set Waking [expr {$Cause == 0}]
        set Power 0
    } elseif {$Waking && !$Power} {
        set Power 1
        set Waking 0
    }
    if {$Power} {
        set Joints [lrange $floats 1 6]
    }
    set Place [lrange [dict get $pose floats] 1 7]
    update
}
# Give it power; what was wrong has been put right.
proc simulated::on {} {
    variable Cause 0
    variable Power
    pino EXEC reset
    set waking [sorma::async -timeout 0 pino EXEC power on]
    for {set n 0} {![$waking done] && $n < 1000} {incr n} {
        tick
    }
    $waking take
}
proc simulated::end {} {
    variable Power 0
    foreach name {follow.ball follow.t pino shmem_r.simset shmem_r.simpose shmem_w.simstate shmem_w.simwrist shmem_w.simclock} {
        catch {sorma::remove $name}
    }
}
