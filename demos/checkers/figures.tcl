# figures.tcl -- games that nobody watches, and their figures.
#
#     figures.tcl ?-games N? ?-seed S? ?-faults F? ?-kills SECONDS? ?-victims NAMES? ?-shifts N? ?-variant V? ?-dry? ?-most SECONDS?
#         ?-folder F? ?-short? ?-json FILE?
#
# In each game the board lies somewhere else, the light is another one (+-20 %), and the person has another seed.
# -kills     every so many seconds of wall time one of the daemons is killed, of all or of -victims
# -shifts    so often the board is moved during a game
# -dry       without arm, hand and eye
# -most      a game that has not ended after so much wall time is given up, and the state of the plot is told
#
# Exit code 0 means: all games were ended by the rules, nothing wrong was believed, each fault was named, and no token was lost without
# being noticed. All daemons that were killed came back. Nobody set out all tokens at once but after a kill of the laboratory or of the
# person.

source [file join [file dirname [file normalize [info script]]] session.tcl]
package require sorma::service::drycarry

namespace eval checkers::figures {
    variable Place {0 0 0}      ;# of the board: by how much it has been moved
    variable Shifts 0           ;# that are still to come in this game
    variable Killing {}         ;# id of after
}

proc checkers::figures::uniform most {
    return [expr {$most * (2 * rand() - 1)}]
}
# Where nothing stands the board may be put, within what the arm reaches.
proc checkers::figures::shift width {
    variable Place
    set place [list [uniform 0.02] [uniform 0.03] [uniform 0.15]]
    ::checkers::moveBoard simlab@lab {*}[lmap to $place from $Place {expr {$to - $from}}] $width
    set Place $place
}
# While the person thinks, now and then.
proc checkers::figures::Watch told {
    variable Shifts
    if {[dict get $told state] eq "think" && $Shifts > 0 && !$::checkers::session::Forgotten && rand() < 0.3} {
        # The laboratory may just have been killed; then another time.
        incr Shifts [expr {-![catch {shift [::checkers::tokens width [dict get $told pdn]]}]}]
    }
}
proc checkers::figures::Kill {daemons seconds} {
    variable Killing
    set victim [lindex $daemons [expr {int(rand() * [llength $daemons])}]]
    if {[checkers::session::kill $victim] && $victim eq "lab"} {
        variable Place {0 0 0}
    }
    set Killing [after [expr {int(1e3 * $seconds)}] [list checkers::figures::Kill $daemons $seconds]]
}

proc checkers::figures::run given {
    variable Shifts
    variable Killing
    dict with given {}
    set folder [expr {${-folder} eq {} ? [file join [pwd] checkersFigures] : ${-folder}}]
    file delete [file join $folder checkers.game] [file join $folder human.game]
    set common [checkers::session::settings [list -variant ${-variant} -look 10 -tidy 60] {-level 5} ${-dry}]
    set width [expr {${-variant} eq "intl" ? 10 : 8}]
    set victims [expr {${-victims} ne {} ? ${-victims} : ${-dry} ? {voice player human} : {lab robot eye hand transform laser voice player human}}]
    set rows {}
    try {
        for {set n 1} {$n <= ${-games}} {incr n} {
            set settings [dict merge $common [dict create human.sim [list -variant ${-variant} -level [expr {1 + $n % 4}] -seed [expr {${-seed} * 1000 + $n}] -faults ${-faults}]]]
            if {$n == 1} {
                checkers::session::begin $folder $settings ${-speed} -intl [expr {$width == 10}] -dry ${-dry}
                checkers::session::ready
                set ::checkers::session::Watch checkers::figures::Watch
                if {${-kills} > 0} {
                    set Killing [after [expr {int(1e3 * ${-kills})}] [list checkers::figures::Kill $victims ${-kills}]]
                }
            } else {
                checkers::session::again $settings
            }
            shift $width
            simlab@lab CTRL -light [expr {1 + [uniform 0.2]}] -shadows [expr {rand() < 0.3}]
            set Shifts ${-shifts}
            set figures [checkers::session::play ${-most}]
            lappend rows $figures
            puts "game $n: [join [lmap {name value} $figures {string cat $name { } [join $value]}] {, }]"
        }
    } finally {
        after cancel $Killing
        set kills [checkers::session::killed 60]
        checkers::session::end
        Report $rows $kills
    }
}
# KILLS: daemon -> how often.
proc checkers::figures::Report {rows kills} {
    set games [llength $rows]
    set ended_by_the_rules [llength [lsearch -all -regexp [lmap row $rows {dict get $row result}] {1-0|0-1|1/2-1/2}]]
    set daemons_killed [tcl::mathop::+ 0 {*}[dict values $kills]]
    set daemons_that_stay_away [dict size $::checkers::session::Killed]
    if {$daemons_that_stay_away > 0} {
        puts "killed, and not come back: [dict keys $::checkers::session::Killed]"
    }
    set allowed [tcl::mathop::+ 0 {*}[dict values [dict filter $kills script {name -} {expr {$name in {lab human}}}]]]
    # Figure, its unit where it is none, its target where it has one.
    foreach {name target} {
        games {} ended_by_the_rules {$ended_by_the_rules == $games} daemons_killed {} daemons_that_stay_away {$daemons_that_stay_away == 0}
        carries {} troubles {} heights_felt {} moves_foreseen {} board_moved {}
        wrong_readings_accepted {$wrong_readings_accepted == 0} tokens_lost_unnoticed {$tokens_lost_unnoticed == 0} claims_judged {$claims_judged > 0} claims_not_judged {}
        faults_of_the_person {} faults_undone {} faults_named {$faults_named + $faults_undone >= $faults_of_the_person}
        put_in_order {$put_in_order == 0} set_out_again {$set_out_again <= $allowed} lab_time {} wall_time {} speed {}
    } {
        if {$name eq "speed"} {
            set speed [format %.1f [expr {double($lab_time) / max(1, $wall_time)}]]
        } elseif {![info exists $name]} {
            set $name [tcl::mathop::+ 0 {*}[lmap row $rows {lindex [dict get $row $name] 0}]]
        }
        measure row $name -measured "[set $name] [expr {[string match *_time $name] ? "s" : "1"}]" -target $target
    }
}

if {[file normalize $argv0] eq [file normalize [info script]]} {
    exit [measure run {-games {any 20} -faults {any 0} -kills {any 0} -shifts {any 0} -variant {{choice braz engl intl} braz} -speed {any 0}
        -folder any -dry flag -most {any 900} -victims {any {}}} {-games 1 -dry 1} $argv checkers::figures::run]
}
