# session.tcl -- the daemons of checkers.launch, and games in them that are watched and counted.
#
#     checkers::session::begin FOLDER SETTINGS SPEED ?-intl 1? ?-dry 1?     files of the game and its daemons are in the folder
#     checkers::session::play ?SECONDS?                     until the game is over, or so much wall time; a dict of figures
#     checkers::session::end

package require fileutil
package require sorma
foreach file {lab/lab lab/colours checkers/packages measure} {
    source [file join [file dirname [file dirname [file normalize [info script]]]] $file.tcl]
}
package require checkers::tokens

namespace eval checkers::session {
    variable Here [file dirname [file normalize [info script]]]
    variable Launch {}          ;# pipe of the launcher
    variable Hears {}           ;# subscriptions of what the daemons tell
    variable Watch {}           ;# command that gets what the plot tells: a dict
    variable Dry 0              ;# there is no arm, hand and eye
    variable State {}           ;# where the plot stands: what it told last
    variable Counts {}          ;# state of the plot -> how often it was entered, in this game
    variable Faults 0           ;# of the person
    variable Named 0            ;# those of which he was told, with a field where they are
    variable Undone 0           ;# those that he put right because a daemon was killed, before he was told
    variable Ordered 0          ;# how often he has put all tokens where they belong, because he was told once more
    variable Remembered 0       ;# how often he has set out all tokens because a daemon was new
    variable Speed 1            ;# of lab time
    variable Earlier 0          ;# [s] lab time of laboratories that have been killed
    variable Began {}           ;# when the laboratory's daemon was started [us]
    variable Forgotten 0        ;# a laboratory has been started anew, and nobody has set out the tokens again
    variable Killed {}          ;# daemon -> process that was killed, as long as there is no other one
    variable Kills {}           ;# daemon -> how often it was killed and has come back
    variable Fault {}           ;# of which he has not been told yet: dict kind, fields; empty: none
}

# ::checkers::session::settle FOLDER SETTINGS -- a folder with a table of colours, where there is an eye, and what the daemons read: dict, object -> options.
proc checkers::session::settle {folder settings} {
    file mkdir $folder
    cd $folder
    if {!$::checkers::session::Dry && ![file exists board.hsv]} {
        lab::colours::learn board.hsv
    }
    fileutil::writeFile settings $settings
}

# -intl: the board has 10 x 10 fields; -dry: without arm, hand and eye.
proc checkers::session::begin {folder settings speed args} {
    variable Launch
    variable Dry
    set args [sorma::options::parse {-intl {boolean 0} -dry {boolean 0}} $args]
    set Dry [dict get $args -dry]
    settle $folder $settings
    set Launch [lab::launch [LaunchFile {*}[dict values $args]]]
    variable Speed $speed
    variable Earlier 0
    variable Forgotten 0
    simlab@lab CTRL -speed $speed
    variable Began [Started]
    variable Hears [list [sorma::subscribe simlab@lab -event sorma.reconnected -command checkers::session::Anew] \
        [sorma::subscribe checkers@player -event plot -queue 10000 -command checkers::session::Plot] \
        [sorma::subscribe checkers@player -event said -queue 10000 -command checkers::session::Said] \
        [sorma::subscribe human.sim@human -event person -queue 10000 -command checkers::session::Person] \
        [sorma::subscribe judge@judge -event found -command checkers::session::Found]]
}
# The launch file of this game. Other recipes, or fewer daemons, make another one of it, in this folder.
proc checkers::session::LaunchFile {intl dry} {
    variable Here
    set file [file join $Here checkers.launch]
    if {!$intl && !$dry} {
        return $file
    }
    set dicts "-dict [file join $Here checkers.dict]"
    foreach {used name} [list $intl intl $dry dry] {
        if {$used} {
            append dicts " -dict [file join $Here $name.dict]"
        }
    }
    fileutil::writeFile game.launch [join [lmap line [split [fileutil::cat $file] \n] {
        if {$dry && [regexp {^daemon (\S+)} $line -> name]} {
            if {$name ni {lab voice player human judge}} continue
            if {$name eq "player"} {
                regsub -- {-after .*} $line {-after lab} line
            }
        }
        string map [list "-dict ../lab/lab.dict" "-dict [file join [file dirname $Here] lab lab.dict]" "-dict checkers.dict" $dicts "-script " "-script $Here/"] $line
    }] \n]
    return [file join [pwd] game.launch]
}

# Another game with the same daemons.
proc checkers::session::again settings {
    settle [pwd] $settings
    human.sim@human configure {*}[dict get $settings human.sim]
    human.sim@human CTRL -new
    checkers@player CTRL -new
    # The person waits as long as the arm is low over the board.
    catch {boardsight@player exec}
    Until idle
    sorma::async -timeout 0 -command checkers::session::Played human.sim@human exec play
    ready
}
proc checkers::session::Played future {
    if {[catch {$future take} text how] && [lindex [dict get $how -errorcode] 1] ne "COMM"} {
        puts stderr "the person does not play: $text"
    }
}
# Until the person has set out the tokens. Before that nobody else may move any, nor the board.
proc checkers::session::ready {} {
    Until play
}
# His daemon may be killed, and be back soon; then he goes on with the game that he was to give up.
proc checkers::session::Until state {
    measure until {[catch {
        if {[set is [dict get [human.sim@human exec state] text]] eq "play" && $state eq "idle"} {
            catch {human.sim@human CTRL -new}
        }
        set is
    } is] == 0 && $is eq $state} -within 120 -every 50 -else {the person should be in state $state, and for two minutes it was: $is}
}
# The daemons of a game read these: options of checkers and of the engine. DRY: without arm, hand and eye. The engine thinks on
# all cores but one, at idle priority.
proc checkers::session::settings {checkers engine dry} {
    set threads [expr {[catch {exec nproc} cores] ? 1 : max(1, $cores - 1)}]
    set width [expr {[dict exists $checkers -variant] && [dict get $checkers -variant] eq "intl" ? 10 : 8}]
    return [dict create checkers $checkers draughts.engine [list -threads $threads {*}$engine] \
        {*}[expr {$dry ? [list drysight [list -width $width]] : [list porter [list -fields $width]]}]]
}
# Before begin: a person who has no memory of the game (a real one played) has the robot's.
proc checkers::session::remember folder {
    if {[file exists [file join $folder human.game]]} {
        return
    }
    fileutil::writeFile -encoding utf-8 [file join $folder human.game] [dict replace [fileutil::cat -encoding utf-8 [file join $folder checkers.game]] intended {}]
}
proc checkers::session::end {} {
    variable Launch
    variable Hears
    foreach subscription $Hears {
        sorma::unsubscribe $subscription
    }
    set Hears {}
    lab::finish $Launch
}

# ---- one game ----

# It lasts until it is over, also when the player's daemon ends, or for so many seconds of wall time (0: no limit). Then the state of the
# plot is told. A call of interrupt ends it at once. The figures: dict of name -> {value unit}.
proc checkers::session::interrupt {} {
    variable Ended interrupted
}
proc checkers::session::play {{most 0}} {
    variable State
    variable Remembered 0
    variable Faults 0
    variable Named 0
    variable Undone 0
    variable Ordered 0
    variable Fault {}
    variable Counts {}
    set begun [clock milliseconds]
    set labTime [labTime]
    set count [lindex [dict get [judge@judge exec begin] floats] 0]
    set timer [if {$most > 0} {after [expr {int(1e3 * $most)}] {set ::checkers::session::Ended timeout}}]
    try {
        while 1 {
            set call [sorma::async -timeout 0 -command {set ::checkers::session::Ended} checkers@player exec play]
            vwait ::checkers::session::Ended
            if {$::checkers::session::Ended in {timeout interrupted}} {
                if {$::checkers::session::Ended eq "timeout"} {
                    puts "    (no end after $most s of wall time; the plot stands at: $State)"
                }
                set came {text *}
                $call destroy
                break
            }
            set failed [catch {$call take} came how]
            if {!$failed} {
                # Its last events may come after the answer.
                catch {measure until {[dict exists $State result]} -within 2 -every 10}
                break
            }
            if {[lindex [dict get $how -errorcode] 1] ne "COMM"} {
                return -options $how $came
            }
            sorma::await sleep 500
        }
    } finally {
        after cancel $timer
    }
    set wall [expr {([clock milliseconds] - $begun) / 1e3}]
    set judged [Judged $count]
    set lab [expr {[labTime] - $labTime}]
    lassign [lmap state {carried verify trouble shifted validate felt foreseen} {expr {[dict exists $Counts $state] ? [dict get $Counts $state] : 0}}] \
        carries looks troubles shifts moves felt foreseen
    return [dict create result [list [dict get $came text] {}] moves_of_the_person [list $moves 1] carries [list $carries 1] looks [list $looks 1] \
        troubles [list $troubles 1] heights_felt [list $felt 1] moves_foreseen [list $foreseen 1] board_moved [list $shifts 1] \
        wrong_readings_accepted [list [dict get $judged wrong] 1] tokens_lost_unnoticed [list [dict get $judged lost] 1] \
        claims_judged [list [dict get $judged judged] 1] claims_not_judged [list [dict get $judged unjudged] 1] set_out_again [list $Remembered 1] \
        faults_of_the_person [list $Faults 1] faults_named [list $Named 1] faults_undone [list $Undone 1] put_in_order [list $Ordered 1] \
        lab_time [list [format %.0f $lab] s] wall_time [list [format %.0f $wall] s] speed [list [format %.1f [expr {$lab / max(0.001, $wall)}]] 1]]
}
# The judge's counts. It waits for a laboratory that is dead, or whose tokens have not been set out.
proc checkers::session::Judged count {
    set end [expr {[clock milliseconds] + 60000}]
    while 1 {
        try {
            return [dict get [judge@judge exec -floats $count counts] text]
        } trap {CHECKERS COUNT} {text how} {
            return -options $how $text
        } on error {text how} {
            if {[clock milliseconds] > $end} {
                return -options $how $text
            }
        }
        sorma::await sleep 200
    }
}
proc checkers::session::Found event {
    if {[dict get $event event] eq "found" && [dict get $event text kind] ne "unjudged"} {
        puts "    (the judge: [dict get $event text kind]: [dict get $event text text])"
    }
}
proc checkers::session::labTime {} {
    variable Earlier
    return [expr {$Earlier + [lindex [dict get [simlab@lab exec time] floats] 0]}]
}

proc checkers::session::Started {} {
    return [dict get [sorma::health lab] started]
}
# Another laboratory, which knows nothing of this one's time and tokens. A connection may also have been away for long.
proc checkers::session::Anew event {
    variable Speed
    variable Began
    variable Forgotten
    if {[dict get $event event] eq "sorma.reconnected" && [set began [Started]] ne $Began} {
        set Began $began
        set Forgotten 1
        forgotten
        sorma::async -command {apply {future {catch {$future take}}}} simlab@lab CTRL -speed $Speed
    }
}

proc checkers::session::Plot event {
    variable Counts
    variable Watch
    variable State
    if {[dict get $event event] ne "plot"} {
        return
    }
    set told [dict get $event text]
    set State $told
    dict incr Counts [dict get $told state]
    if {$Watch ne {}} {
        {*}$Watch $told
    }
}
proc checkers::session::Said event {
    if {[dict get $event event] eq "said"} {
        puts "    \"[dict get $event text]\""
    }
}
proc checkers::session::Person event {
    variable Faults
    variable Named
    variable Fault
    if {[dict get $event event] ne "person"} {
        return
    }
    set told [dict get $event text]
    switch [dict get $told state] {
        fault {
            incr Faults
            set Fault $told
            puts "    (the person: [dict get $told kind], [dict get $told fields])"
        }
        remembered {
            variable Forgotten 0
            incr ::checkers::session::Remembered
            forgotten
            puts "    (the person sets out the tokens as they were)"
        }
        undid {
            incr ::checkers::session::Remembered
            puts "    (the person sets out the tokens as they were before he erred)"
        }
        order {
            incr ::checkers::session::Ordered
            puts "    (the person puts all tokens where they belong)"
        }
        harmless {
            puts "    (the person: [dict get $told kind])"
        }
        told {
            if {$Fault eq {}} {
                return
            }
            if {[lsearch -exact [lmap field [dict get $Fault fields] {regexp "\\m$field\\M" [dict get $told text]}] 1] >= 0} {
                incr Named
            } else {
                puts "    (not named: [dict get $Fault kind], [dict get $Fault fields]; he was told: [dict get $told text])"
            }
            set Fault {}
        }
    }
}
# Kill a daemon, which is started again. Returns its process; 0: it is not there, or has not come back since it was killed last. The kill
# counts when the daemon has another process (see killed).
proc checkers::session::kill name {
    variable Killed
    killed
    set process [measure process $name]
    if {$process == 0 || $process in [dict values [dict filter $Killed key $name]]} {
        return 0
    }
    if {$name eq "lab"} {
        variable Earlier
        set earlier $Earlier
        catch {set earlier [labTime]}
    }
    if {[catch {exec kill -KILL $process}]} {
        return 0
    }
    puts "    (killed: $name)"
    dict set Killed $name $process
    if {$name eq "lab"} {
        set Earlier $earlier
    }
    if {$name eq "human"} {
        forgotten
    }
    return $process
}
# Daemon -> how often it was killed and has come back with another process number. WAIT: for so long [s] for those that have not yet;
# $::checkers::session::Killed has those that are still away.
proc checkers::session::killed {{wait 0}} {
    variable Kills
    catch {measure until {[Away] eq {}} -within $wait -every 100}
    return $Kills
}
# Those that have not come back so far.
proc checkers::session::Away {} {
    variable Killed
    variable Kills
    foreach name [dict keys $Killed] {
        if {[measure process $name] ni [list 0 [dict get $Killed $name]]} {
            dict unset Killed $name
            dict incr Kills $name
        }
    }
    return $Killed
}
# The person's daemon or the laboratory has been killed: what he has done wrong is put right when all tokens lie as they did.
proc checkers::session::forgotten {} {
    variable Fault
    variable Undone
    incr Undone [expr {$Fault ne {}}]
    set Fault {}
}
