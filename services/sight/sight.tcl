# sight -- where a ball is relative to the tool, from what its camera sees: a map (psom) that the arm itself has taught.
#
#     sight.ball EXEC learn           the tool must stand so that the ball is at -nominal; it goes to the nodes of the map
#     sight.ball CTRL -stream 1       from now on each picture's answer goes to -result
#
# It needs nothing but the bus: the arm, and who uses the answer, may be elsewhere.

package require sorma
package require sorma::service::transform

namespace eval ::sorma::service::sight {}

oo::class create ::sorma::service::sight {
    superclass sorma::Service

    sorma::purpose "where a ball is relative to the tool, from what its camera sees, by a map that the arm has taught"
    sorma::option -map service -help "the map (class psom)"
    sorma::option -file string -kind file -default "" -help "where the map is kept; empty: nowhere"
    sorma::option -seen service -help "what the camera sees: records of ball.obs (class shmem_r)"
    sorma::option -clock service -help "turns the pictures' times into the robot's (class clock); none: they are of the same clock"
    sorma::option -result service -help "is told where the ball is: time, x y z in the tool frame, residual, code; as shmem_w takes it"
    sorma::option -mover service -help "moves the tool to poses in the world (class mvpos)"
    sorma::option -pose service -help "answers where the tool is: position, quaternion (class pino)"
    sorma::option -nominal vector -unit m -length 3 -default {0 0 0.3} -help "where the ball is in the tool frame when learning begins"
    sorma::option -reach vector -unit m -length 3 -default {0.1 0.1 0.08} -help "of the map, to both sides of -nominal"
    sorma::option -samples int -range {1 1000} -default 4 -help "pictures that are averaged at each place"
    sorma::option -rest double -unit s -range {0 10} -default 0.4 -help "of the arm before it looks, by the pictures' time"
    sorma::option -patience double -unit s -range {0.1 1000} -default 20 -help "how long it waits for a valid picture"
    sorma::option -tolerance double -unit m -range {0 1} -default 0.01 -help "a map with a larger error between its nodes is not kept: the ball has moved"
    sorma::option -margin double -range {0 10} -default 1 -help "how far beyond the map, of its width, its answer still counts: coarse, but it leads back"
    sorma::option -stream flag -default 0 -help "tell -result about each picture"
    sorma::reads floats 0..9 "" "a record of ball.obs; none: the newest one of -seen"
    sorma::writes floats 2..7 "" "time, x y z \[m\] in the tool frame, residual, code; learn: mean and largest error \[m\] in between"
    sorma::writes text 0.. "" "learn: what was learned"
    sorma::words "learn"
    sorma::danger move learn
    sorma::example "sight.ball CTRL -samples 8"

    variable Loop       ;# the coroutine that streams; empty: none
    variable Told       ;# how many results

    method born {} {
        set Loop {}
        set Told 0
        my changed -file
    }
    method changed options {
        if {"-file" in $options || "-margin" in $options} {
            my Load
        }
        if {[my cget -stream] && $Loop eq {}} {
            set Loop [namespace current]::loop
            coroutine $Loop my Stream
            after 0 [list catch $Loop]
        }
    }
    method leaving {} {
        if {$Loop ne {}} {
            catch {rename $Loop {}}
        }
    }
    method dump {} { return "told $Told" }

    method exec message {
        set words [dict get $message words]
        if {$words eq "learn"} {
            return [my Learn]
        }
        if {$words ne {}} {
            sorma::fail {SIGHT WORD} "[my name]: bad word \"$words\": must be learn"
        }
        set seen [dict get $message floats]
        if {[llength $seen] == 0} {
            set seen [dict get [[my cget -seen] exec] floats]
        }
        return [dict create floats [my Relative [my Mine $seen]]]
    }

    # ---- one after another ----

    method Stream {} {
        yield
        set counter {}
        while {[my cget -stream]} {
            if {[catch {
                set reply [[my cget -seen] exec next 1 {*}$counter]
                set counter [lindex [dict get $reply ints] 0]
                set told [my Relative [my Mine [dict get $reply floats]]]
                [my cget -result] exec -floats $told
                incr Told
            } - options]} {
                # No picture, no map, nobody who wants to know: each of them may be otherwise soon. It misses nothing that comes before it asks again.
                set code [dict get $options -errorcode]
                set counter [switch [lrange $code 1 2] {
                    {SHMEM TIMEOUT} { lindex $code end }
                    {SHMEM ABSENT} { string cat 0 }
                }]
                if {[lrange $code 1 2] ne {SHMEM TIMEOUT}} {
                    after 100 [list catch [info coroutine]]
                    yield
                }
            }
        }
        set Loop {}
    }

    # The same record, by the robot's clock.
    method Mine seen {
        if {[my cget -clock] ne {}} {
            lset seen 0 [lindex [dict get [[my cget -clock] exec -floats [lindex $seen 0]] floats] 0]
        }
        return $seen
    }

    # time u v area radius eccentricity angle code done -> time x y z residual code
    method Relative seen {
        lassign $seen time u v - radius - - code
        if {$code != 0} {
            return [list $time 0 0 0 0 $code]
        }
        set reply [[my cget -map] exec -floats [list 0 0 0 $u $v $radius] complete]
        lassign [dict get $reply floats] x y z u2 v2 radius2
        # Outside of the learned part the map knows nothing.
        set outside [expr {[dict exists $reply text] && [dict get $reply text] ne {}}]
        set residual [expr {sqrt(($u2 - $u) ** 2 + ($v2 - $v) ** 2 + ($radius2 - $radius) ** 2)}]
        return [list $time $x $y $z $residual [expr {$outside ? 7 : 0}]]
    }

    # ---- learning ----

    method Load {} {
        set map [my cget -map]
        if {$map eq {}} {
            return
        }
        $map CTRL -metric {0 0 0 1 1 1} -scale 1 -margin [my cget -margin]
        if {[file exists [my cget -file]]} {
            $map CTRL -map [my cget -file]
        }
    }

    method Learn {} {
        foreach option {-map -seen -mover -pose} {
            if {[my cget $option] eq {}} {
                sorma::fail {SIGHT PARTS} "[my name]: $option is not set; EXEC learn needs it"
            }
        }
        try {
            return [my Teach]
        } on error {text options} {
            # The previous map counts again.
            catch {my Load}
            return -options $options $text
        }
    }

    method Teach {} {
        set map [my cget -map]
        $map CTRL -map {} -axes {{chebyshev 3 -1 1} {chebyshev 3 -1 1} {chebyshev 3 -1 1}} -dimension 6
        set begin [my Pose]
        set ball [my Local $begin [my cget -nominal]]
        set orientation [lrange $begin 3 6]
        set nodes [dict get [$map exec nodes] floats]
        set vectors {}
        set count [expr {[llength $nodes] / 3}]
        set wrong {}
        try {
            set k 0
            foreach {a b c} $nodes {
                my publish progress -text "node [incr k] of $count" -floats [list [expr {double($k - 1) / ($count + 8)}]]
                lappend vectors {*}[my Look $ball $orientation [my At $a $b $c] "node $k of $count"]
            }
            $map exec -floats $vectors train
            set k 0
            foreach a {-0.5 0.5} {
                foreach b {-0.5 0.5} {
                    foreach c {-0.5 0.5} {
                        my publish progress -text "check [incr k] of 8" -floats [list [expr {double($count + $k - 1) / ($count + 8)}]]
                        set is [my Look $ball $orientation [my At $a $b $c] "check $k of 8"]
                        lassign [my Relative [list 0 [lindex $is 3] [lindex $is 4] 0 [lindex $is 5] 0 0 0 0]] - x y z
                        lappend wrong [expr {sqrt(($x - [lindex $is 0]) ** 2 + ($y - [lindex $is 1]) ** 2 + ($z - [lindex $is 2]) ** 2)}]
                    }
                }
            }
        } finally {
            # Also when it was given up; but then what this request calls fails at once: another coroutine calls. A new learning
            # waits for it.
            if {[sorma::cancelled]} {
                after 0 [namespace code [list coroutine [namespace current]::back my Back $begin [info coroutine]]]
                if {[info coroutine] ne {}} {
                    yield
                }
            } else {
                my Back $begin
            }
        }
        set mean [expr {[::tcl::mathop::+ {*}$wrong] / [llength $wrong]}]
        set most [::tcl::mathfunc::max {*}$wrong]
        if {$most > [my cget -tolerance]} {
            $map CTRL -map {}
            sorma::fail {SIGHT WRONG} [format "%s: the map is up to %.1f mm off between its nodes, more than -tolerance, %.1f mm: has the ball\
                moved? Nothing has been learned" [my name] [expr {1e3 * $most}] [expr {1e3 * [my cget -tolerance]}]]
        }
        if {[my cget -file] ne {}} {
            $map CTRL -save [my cget -file]
        }
        set text [format "%d nodes; between them %.2f mm off, at most %.2f mm" $count [expr {1e3 * $mean}] [expr {1e3 * $most}]]
        my publish progress -text $text -floats 1
        return [dict create floats [list $mean $most] text $text]
    }

    # Back to where learning began. The arm may be slowing down still, and refuse. Then a coroutine goes on.
    method Back {begin {then {}}} {
        set end [expr {[clock milliseconds] + 1000 * [my cget -patience]}]
        while {[catch {[my cget -mover] exec -floats $begin} - how] && [lrange [dict get $how -errorcode] 1 2] eq {ROBOT BUSY} &&
                [clock milliseconds] < $end && [info coroutine] ne {}} {
            after 100 [list catch [info coroutine]]
            yield
        }
        if {$then ne {}} {
            after 0 [list catch $then]
        }
    }

    method At {a b c} {
        return [lmap nominal [my cget -nominal] reach [my cget -reach] x [list $a $b $c] {expr {$nominal + $reach * $x}}]
    }
    method Pose {} { return [lrange [dict get [[my cget -pose] exec] floats] 0 6] }
    # A point of the tool frame in the world.
    method Local {pose point} {
        return [lmap a [lrange $pose 0 2] b [::sorma::service::transform::rotate [lrange $pose 3 6] $point] {expr {$a + $b}}]
    }

    # Fails when nobody wants to know any more.
    method Wanted what {
        if {[sorma::cancelled]} {
            sorma::fail {SIGHT CANCELLED} "[my name]: given up at $what; the map has not been learned"
        }
    }

    # Go to where the ball is at a place of the tool frame, and look: where it is, what is seen of it.
    method Look {ball orientation place what} {
        my Wanted $what
        set shift [::sorma::service::transform::rotate $orientation $place]
        [my cget -mover] exec -floats [concat [lmap a $ball b $shift {expr {$a - $b}}] $orientation]
        set begin [lindex [dict get [[my cget -seen] exec] floats] 0]
        set end [expr {[clock milliseconds] + 1000 * [my cget -patience]}]
        set sums {0 0 0}
        set got 0
        set code 1
        set counter {}
        while {$got < [my cget -samples]} {
            my Wanted $what
            if {[clock milliseconds] > $end} {
                sorma::fail {SIGHT NOTHING} "[my name]: at $what the ball was not seen in [my cget -patience] s, only $got of [my cget -samples]\
                    pictures were good, the last one's code is [format %g $code]; nothing has been learned"
            }
            if {[catch {[my cget -seen] exec next 1 {*}$counter} reply]} {
                continue
            }
            set counter [lindex [dict get $reply ints] 0]
            lassign [dict get $reply floats] time u v - radius - - code
            if {$code == 0 && $time > $begin + [my cget -rest]} {
                set sums [lmap sum $sums x [list $u $v $radius] {expr {$sum + $x}}]
                incr got
            }
        }
        # Where it stands, not where it was sent.
        set pose [my Pose]
        lassign [lrange $pose 3 6] w x y z
        set rel [::sorma::service::transform::rotate [list $w [expr {-$x}] [expr {-$y}] [expr {-$z}]] \
            [lmap a $ball b [lrange $pose 0 2] {expr {$a - $b}}]]
        return [concat $rel [lmap sum $sums {expr {$sum / $got}}]]
    }
}

package provide sorma::service::sight 1.0
