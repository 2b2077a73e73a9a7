# player.tcl -- the plot of a game between the robot and a person.
#
#     checkers::player create p GAME -carry carry@robot -sight getBrdSit@eye -engine draughts.engine -say command
#     p play
#
# see -> validate -> answer -> carry -> verify -> and again, until the game is over. play suspends the coroutine in which it runs.
# Whatever is told or decided is an entry for -watch: a command that gets a state and a dict.

package require sorma
package require sorma::await
package require sorma::options
package require checkers::game
package provide checkers::player 1.0

oo::class create ::checkers::player {
    constructor {game args} {
        my variable Game Settings State
        set Game $game
        set State begin
        set Settings [sorma::options::parse {
            -carry {any carry} -sight {any getbrdsit} -engine {any draughts.engine}
            -robot {any black} -still {any 3} -look {any 300} -patience {any 4000} -say {any {}} -watch {any {}}
        } $args]
    }

    method Setting name { my variable Settings; return [dict get $Settings $name] }
    method state {} { my variable State; return $State }

    # The plot is there now; whoever watches hears it.
    method Enter {state args} {
        my variable State
        set State $state
        if {[my Setting -watch] ne {}} {
            {*}[my Setting -watch] $state $args
        }
    }
    method Say text {
        if {[my Setting -say] ne {}} {
            {*}[my Setting -say] $text
        }
    }

    # Play until the game is over. Returns its result.
    method play {} {
        my variable Game
        while {![$Game over]} {
            if {[$Game side] eq [my Setting -robot]} {
                my Answer
            } else {
                my Await
            }
        }
        set result [$Game state result]
        my Enter over result $result reason [$Game state reason]
        my Say "The game is over: $result, [$Game state reason]."
        return $result
    }

    # ---- the person's turn ----

    # Until the board shows a legal move, and shows it -still times.
    method Await {} {
        my variable Game
        my Enter person
        set said [set strange {}]
        while 1 {
            set sight [my Still]
            set reply [[$Game draughts] exec -text $sight explain]
            set text [expr {[dict exists $reply text] ? [dict get $reply text] : {}}]
            switch [dict get $reply code] {
                0 {
                    my Enter validate move $text
                    lassign [$Game plan $text] - lies
                    set played [$Game play $text $lies]
                    my Say "You play $played."
                    return
                }
                1 { set said [set strange {}] }
                default {
                    # Perhaps he is not ready. Said once for each situation.
                    if {$sight ne $strange} {
                        set strange $sight
                        set since [clock milliseconds]
                    } elseif {$sight ne $said && [clock milliseconds] - $since >= [my Setting -patience]} {
                        my Enter trouble sight $sight text $text
                        my Say $text
                        set said $sight
                    }
                }
            }
            sorma::await sleep [my Setting -look]
        }
    }

    # What the camera sees, when it has seen the same so often in a row.
    method Still {} {
        set last {}
        set same 0
        while {$same < [my Setting -still]} {
            if {$same > 0} {
                sorma::await sleep [my Setting -look]
            }
            if {[catch {dict get [[my Setting -sight] exec] text} sight options]} {
                my Trouble $sight $options
                set same 0
                set last {}
                continue
            }
            set same [expr {$sight eq $last ? $same + 1 : 1}]
            set last $sight
        }
        return $last
    }

    # ---- the robot's turn ----

    method Answer {} {
        my variable Game
        my Enter think
        set engine [my Setting -engine]
        $engine configure -variant [[$Game draughts] cget -variant]
        $engine exec -text [$Game pdn] pdn
        set move [dict get [$engine exec go] text]
        my Enter answer move $move
        my Say "I play $move."
        lassign [$Game plan $move] transfers lies
        set stages [my Stages $transfers]
        set done 0
        while 1 {
            set done [my Carry $transfers $done]
            set sight [my Still]
            set seen [lsearch -exact $stages $sight]
            if {$seen == [llength $stages] - 1 && $done == [llength $transfers]} break
            # Something is not as it was meant: go on from where the board is.
            if {$seen >= 0} {
                set done $seen
            } else {
                my Enter trouble sight $sight expected [lindex $stages $done]
                my Say "The board is not as it should be. Please put it in order: [my Difference $sight [lindex $stages $done]]."
                sorma::await sleep [my Setting -look]
            }
        }
        my Enter verify move $move
        $Game play $move $lies
    }

    # What is to be seen before the first transfer, and after each. Carrying to and from the heap may look the same twice: the later counts.
    method Stages transfers {
        my variable Game
        set lies [$Game lies]
        set stages [list [$Game sight $lies]]
        foreach transfer $transfers {
            set lies [::checkers::tokens after $lies $transfer]
            lappend stages [$Game sight $lies]
        }
        return $stages
    }

    # Carry from the given transfer on. Returns how many are done.
    method Carry {transfers done} {
        foreach transfer [lrange $transfers $done end] {
            my Enter carry transfer $transfer
            if {[catch {[my Setting -carry] exec -floats $transfer} message options]} {
                my Trouble $message $options
                return $done
            }
            incr done
        }
        return $done
    }

    # An error of a service: told, once as long as it stays the same; then it is tried again.
    method Trouble {message options} {
        my variable Told
        if {![info exists Told] || $Told ne $message} {
            my Enter trouble text $message code [dict get $options -errorcode]
            my Say $message
            set Told $message
        }
        sorma::await sleep [my Setting -look]
    }

    # Fields that differ, in words.
    method Difference {seen expected} {
        my variable Game
        set width [$Game width]
        set fields {}
        for {set i 0} {$i < $width * $width} {incr i} {
            set should [string index $expected $i]
            if {[string index $seen $i] ne $should} {
                set name [string index abcdefghij [expr {$i % $width}]][expr {$width - $i / $width}]
                lappend fields "$name should [expr {$should eq "." ? "be empty" : $should eq "r" ? "have a red token" : "have a yellow token"}]"
            }
        }
        return [join $fields ", "]
    }
}
