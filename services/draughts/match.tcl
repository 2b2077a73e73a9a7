#!/usr/bin/env tclsh
# match.tcl ?-variant V? ?-games N? ?-seed S? ?-a {name value ...}? ?-b {name value ...}? ?-level {nodes=2000}?
#     ?-levelA ...? ?-levelB ...? ?-engine PROGRAM? ?-engineB PROGRAM?
#
# A match of two engines over the Hub protocol: random openings that the first engine thinks level, each played with both colours.
# The rules, and who has won, are looked up in a draughts object. -a and -b: parameters of the two engines. Prints a line a
# game, then games, won, drawn, lost and Elo of the first with an error bar of 95 %.

package require sorma
package require sorma::service::draughts

namespace eval match {
    variable Settings {-variant intl -games 20 -seed 1 -a {} -b {} -level nodes=2000 -levelA {} -levelB {} -engine sorma-draughts -engineB {}}
}

# Start an engine; returns its channel.
proc match::start {program variant parameters} {
    set engine [open |[list $program] r+]
    fconfigure $engine -buffering line -translation lf
    puts $engine hub
    await $engine wait
    foreach {name value} [concat [list variant $variant] $parameters] {
        puts $engine "set-param name=$name value=\"$value\""
    }
    puts $engine init
    await $engine ready
    return $engine
}

# The next line that begins with a word; what comes before is skipped.
proc match::await {engine word} {
    while {[gets $engine line] >= 0} {
        if {[string match $word* $line]} {
            return $line
        }
        if {[string match error* $line]} {
            error "engine says: $line"
        }
    }
    error "the engine has ended; expected $word"
}

# Ask an engine for its move in the position that started so, after moves.
proc match::ask {engine start moves level} {
    puts $engine "pos pos=$start moves=\"[join $moves]\""
    puts $engine "level $level"
    puts $engine "go think"
    set line [await $engine done]
    if {![regexp {move=(\S+)} $line -> move]} {
        error "no move in \"$line\""
    }
    return $move
}

proc match::words {so args} {
    return [dict getdef [$so exec {*}$args] text {}]
}
if {[catch {dict getdef {} a b}]} {
    proc match::words {so args} {
        set reply [$so exec {*}$args]
        return [expr {[dict exists $reply text] ? [dict get $reply text] : {}}]
    }
}

# Half points of the engine that has White. engines: White's and Black's; levels likewise.
proc match::game {board opening engines levels start} {
    $board exec new
    foreach move $opening {
        $board exec play $move
    }
    set moves $opening
    foreach engine $engines {
        puts $engine new-game
    }
    for {set ply 0} {$ply < 400} {incr ply} {
        set state [words $board state]
        switch [dict get $state result] {
            1-0 {return 2}
            0-1 {return 0}
            1/2-1/2 {return 1}
        }
        set who [expr {[dict get $state side] eq {black}}]
        set move [ask [lindex $engines $who] $start $moves [lindex $levels $who]]
        $board exec play $move
        lappend moves $move
    }
    return 1
}

proc match::main arguments {
    variable Settings
    set s [dict merge $Settings $arguments]
    foreach key {-levelA -levelB} {
        if {[dict get $s $key] eq {}} {
            dict set s $key [dict get $s -level]
        }
    }
    if {[dict get $s -engineB] eq {}} {
        dict set s -engineB [dict get $s -engine]
    }
    set variant [dict get $s -variant]
    set board draughts.match
    $board CTRL -variant $variant
    set a [start [dict get $s -engine] $variant [dict get $s -a]]
    set b [start [dict get $s -engineB] $variant [dict get $s -b]]
    expr {srand([dict get $s -seed])}
    set size [expr {$variant eq {intl} ? 20 : 12}]
    set empty [expr {$variant eq {intl} ? 10 : 8}]
    set start [expr {$variant eq {engl} ? {B} : {W}}][string repeat b $size][string repeat e $empty][string repeat w $size]
    array set count {0 0 1 0 2 0}
    set scores {}
    for {set pair 0} {$pair < [dict get $s -games] / 2} {incr pair} {
        set opening [opening $board $a $start]
        set one [game $board $opening [list $a $b] [list [dict get $s -levelA] [dict get $s -levelB]] $start]
        set two [expr {2 - [game $board $opening [list $b $a] [list [dict get $s -levelB] [dict get $s -levelA]] $start]}]
        puts "opening [join $opening]: [expr {$one / 2.}] and [expr {$two / 2.}]"
        incr count($one)
        incr count($two)
        lappend scores [expr {($one + $two) / 4.}]
    }
    foreach engine [list $a $b] {
        puts $engine quit
        catch {close $engine}
    }
    sorma::remove $board
    puts "games [expr {2 * [llength $scores]}] won $count(2) drawn $count(1) lost $count(0) Elo [elo $scores]"
}

# Six random moves after which the engine sees neither side ahead by half a man.
proc match::opening {board engine start} {
    while 1 {
        $board exec new
        set moves {}
        for {set i 0} {$i < 6} {incr i} {
            set legal [words $board legal]
            if {$legal eq {}} break
            set move [lindex $legal [expr {int(rand() * [llength $legal])}]]
            $board exec play $move
            lappend moves $move
        }
        if {[words $board legal] eq {}} continue
        puts $engine "pos pos=$start moves=\"[join $moves]\""
        puts $engine "level nodes=5000"
        puts $engine "go analyze"
        set score 99
        puts $engine stop
        while {[gets $engine line] >= 0 && ![string match done* $line]} {
            regexp {score=(\S+)} $line -> score
        }
        if {abs($score) < 0.5} {
            return $moves
        }
    }
}

proc match::elo scores {
    set n [llength $scores]
    if {$n == 0} {
        return "+0"
    }
    set sum 0.
    set squares 0.
    foreach x $scores {
        set sum [expr {$sum + $x}]
        set squares [expr {$squares + $x * $x}]
    }
    set mean [expr {$sum / $n}]
    set error [expr {1.96 * sqrt(max($squares / $n - $mean * $mean, 0.25 / $n) / $n)}]
    set at {x {format %+.0f [expr {-400 * log10(1 / min(max($x, 0.001), 0.999) - 1)}]}}
    return "[apply $at $mean] ([apply $at [expr {$mean - $error}]] .. [apply $at [expr {$mean + $error}]])"
}

match::main $argv
