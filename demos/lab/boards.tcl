# boards.tcl TABLE ?COUNT? ?SEED? -- how well boards are read.
#
# Random situations in the simulated laboratory, each seen once by the hand's camera. The picture has noise, the light varies by 20 %,
# some situations have shadows, and the board is shifted and turned.
#
# TABLE is a file of hsvtable. Prints how many were read right, refused, and read wrong; exit code 0: none wrong.

package require sorma

namespace eval lab::boards {
    variable Fields {}          ;# dark ones: list of {file rank}
    variable Place {0 0 0}      ;# of the board: dx dy [m], turn [rad]
    foreach rank {1 2 3 4 5 6 7 8} {
        foreach file {1 2 3 4 5 6 7 8} {
            if {($file + $rank) % 2 == 0} {
                lappend Fields [list $file $rank]
            }
        }
    }
}

# lab::boards::prepare TABLE PREFIX -- a laboratory in this process, and who reads its board.
proc lab::boards::prepare {table prefix} {
    sorma::create simlab.boards -prefix $prefix -cameraRate 20 -paused 1
    simlab.boards EXEC FMSG 1 0.2
    sorma::create shmem_r.boards -key ${prefix}camera.image
    sorma::create getBrdSit.boards -table $table -picture shmem_r.boards -at {0.5 0 0.52 0 1 0 0}
}

# lab::boards::next -- another situation; returns what must be read, as getBrdSit says it.
proc lab::boards::next {} {
    variable Fields
    variable Place
    set fields $Fields
    set symbols [string repeat . 64]
    foreach colour {red yellow} {
        for {set i 1} {$i <= 14} {incr i} {
            simlab.boards CTRL -steal ${colour}_$i
        }
    }
    foreach colour {red yellow} {
        set n [expr {1 + int(rand() * 12)}]
        for {set i 1} {$i <= $n} {incr i} {
            set k [expr {int(rand() * [llength $fields])}]
            lassign [lindex $fields $k] file rank
            set fields [lreplace $fields $k $k]
            set off [list [expr {$file + (rand() - 0.5) * 0.17}] [expr {$rank + (rand() - 0.5) * 0.17}]]
            simlab.boards CTRL -move ${colour}_$i {*}$off
            set at [expr {(8 - $rank) * 8 + $file - 1}]
            set symbols [string replace $symbols $at $at [string index $colour 0]]
        }
    }
    # By how much it differs from where the board is.
    set place [list [expr {0.04 * rand() - 0.02}] [expr {0.06 * rand() - 0.03}] [expr {0.4 * rand() - 0.2}]]
    simlab.boards CTRL -board {*}[lmap to $place from $Place {expr {$to - $from}}]
    set Place $place
    simlab.boards CTRL -light [expr {0.8 + 0.4 * rand()}] -shadows [expr {rand() < 0.3}]
    return $symbols
}

# lab::boards::read -- what is read in the first picture that was taken from now on: the symbols, or the error.
proc lab::boards::read {} {
    set now [lindex [dict get [simlab.boards exec -floats 0.002] floats] 0]
    while {[lindex [dict get [shmem_r.boards exec] floats] 0] <= $now} {
        simlab.boards EXEC FMSG 1 0.05
    }
    catch {dict get [getBrdSit.boards exec] text} result
    return $result
}

proc lab::boards::run {table count seed} {
    expr {srand($seed)}
    prepare $table boards[pid].
    set right [set refused [set wrong 0]]
    for {set i 0} {$i < $count} {incr i} {
        set expected [next]
        set seen [read]
        if {$seen eq $expected} {
            incr right
        } elseif {![regexp {^[.ry]{64}$} $seen]} {
            incr refused
            puts "[expr {$i + 1}] refused: $seen"
        } else {
            incr wrong
            puts "[expr {$i + 1}] WRONG\n  is   $expected\n  read $seen"
        }
    }
    puts "$count situations: $right read right at the first look, $refused refused, $wrong wrong"
    return [expr {$wrong > 0}]
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    if {[llength $argv] == 0} {
        puts stderr "usage: boards.tcl TABLE ?COUNT? ?SEED?"
        exit 2
    }
    lassign [concat $argv [lrange {- 100 1} [llength $argv] end]] table count seed
    exit [lab::boards::run $table $count $seed]
}
