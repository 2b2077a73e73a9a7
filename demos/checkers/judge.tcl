# judge.tcl -- judge: counts what the robot believes and is not so. It knows where the tokens are, and what was said aloud; nobody asks it
# what to play.
#
#     judge EXEC begin            counts from zero. Answers a number: this count
#     judge EXEC FMSG 1 N counts  what has been counted since
#     judge EXEC look             where the tokens lie otherwise than was said last
#     judge EXEC TMSG 1 TOLD look otherwise than the robot told (text of event plot)
#
# The robot says what lies where (event plot of class checkers) when it has read the person's move, has carried a token, and at the end.
# A word is compared with the tokens as long as nobody may have moved one since. A difference is counted once, as long as it
# lasts.

package require sorma
package require sorma::await
package require checkers::tokens
package require sorma::service::drycarry

oo::class create ::sorma::service::judge {
    superclass ::checkers::laboratory
    sorma::purpose "counts wrong readings and lost tokens of a game"
    sorma::option -lab service -default simlab -help "the laboratory: where the tokens are"
    sorma::option -robot service -default checkers -help "what it says is judged (class checkers)"
    sorma::option -person service -default {} -help "who sets out the tokens of a laboratory that is new (class human); none: nobody"
    sorma::words "begin|counts|look"
    sorma::reads floats 0..1 "" "counts: which count"
    sorma::reads text * "" "look: what the robot told (event plot of class checkers), default: what was heard last"
    sorma::writes floats 0..1 "" "begin: which count this is"
    sorma::writes ints 0..1 "" "look: how much differs"
    sorma::writes text * "" "counts: dict of wrong, lost, judged, unjudged, setOut; look: what differs, in words"
    sorma::concurrency concurrent
    sorma::example "judge EXEC look"

    variable Hears          ;# subscriptions
    variable Counts         ;# dict, as counts answers it
    variable Number         ;# of this count; 0: none has begun
    variable Said           ;# what was said last of what lies where: dict number, state, width, lies; empty: nothing
    variable Last           ;# the same, also of the person's turn, which is not judged: look
    variable Open           ;# Said waits to be judged
    variable Moves          ;# how often somebody was about to move a token
    variable Working        ;# a coroutine judges
    variable Wrong          ;# what differs and has been counted, as keys of Differences
    variable Held           ;# at the last look tokens were missing beside the board while a hand was over it: they may be in it
    variable Began          ;# when the daemon of the laboratory was started [us]; empty: it is in this process
    variable Forgotten      ;# the laboratory is new, and nobody has set out the tokens
    variable Dead           ;# why it does not answer; empty: it does
    method born {} {
        set Hears [set Said [set Last [set Wrong [set Began [set Dead {}]]]]]
        set Number [set Open [set Moves [set Working [set Forgotten [set Held 0]]]]]
        my Zero
    }
    destructor {
        foreach subscription $Hears {
            sorma::unsubscribe $subscription
        }
    }
    method Zero {} {
        set Counts {wrong 0 lost 0 judged 0 unjudged 0 setOut 0}
    }

    method exec message {
        switch [dict get $message words] {
            begin { return [my Begin] }
            counts { return [my Result [dict get $message floats]] }
            look {
                set differs [my Differences [my ToldOf [dict get $message text]] [my Truth]]
                return [dict create ints [dict size $differs] text [join [dict values $differs] "; "]]
            }
        }
        sorma::fail [list CHECKERS WORD] "[my name]: bad word \"[dict get $message words]\": must be begin, counts, or look"
    }
    method dump {} {
        return [join [lmap {name value} $Counts {string cat $name { } $value}] \n]
    }
    # Width and lies of what the caller has heard, or else of what the judge has heard last.
    method ToldOf told {
        if {$told eq {} && $Last eq {}} {
            sorma::fail [list CHECKERS JUDGE [my name]] "[my name]: the robot has not said yet what lies where"
        }
        return [expr {$told eq {} ? $Last : [my Lies $told]}]
    }
    method Lies told {
        foreach key {pdn lies} {
            if {[catch {dict exists $told $key} is] || !$is} {
                sorma::fail [list CHECKERS JUDGE [my name]] "[my name]: what the robot told has no \"$key\": expected the text of event plot, got \"$told\""
            }
        }
        return [dict create width [::checkers::tokens width [dict get $told pdn]] lies [dict get $told lies]]
    }
    method Begin {} {
        if {$Hears eq {}} {
            set listen [list [my cget -robot] plot Plot]
            if {[my cget -person] ne {}} {
                lappend listen [my cget -person] person Person
            }
            foreach {object event method} $listen {
                lappend Hears [sorma::subscribe $object -event $event -queue 10000 -command [namespace code [list my $method]]]
            }
            if {[my Daemon] ne {}} {
                lappend Hears [sorma::subscribe [my cget -lab] -event sorma.reconnected -command [namespace code {my Again}]]
                set Began [my Started]
            }
        }
        set Said [set Last [set Wrong {}]]
        set Open [set Held 0]
        my Zero
        # Another process would not begin with the same number.
        set Number [expr {$Number ? $Number + 1 : [clock milliseconds] % 1000000000 * 1000}]
        return [dict create floats $Number]
    }
    # While the laboratory is dead, or its tokens have not been set out, it is said so; what was said last is judged when they have been.
    method Result number {
        if {$Number == 0 || $number != $Number} {
            sorma::fail [list CHECKERS COUNT [my name]] "[my name]: count $number is not known: the judge was started anew, or another count has begun"
        }
        while {$Working} {
            sorma::await sleep 10
        }
        set Working 1
        try {
            my Sure
            while {$Open && [my Judge]} {}
            if {$Held && !$Open} {
                my Judge 1
            }
            if {$Open} {
                my Sure
            }
            if {$Held} {
                sorma::fail [list CHECKERS HAND [my cget -lab]] "[my name]: tokens are missing, and a hand is over the board: nothing can be counted before it has put them down"
            }
        } finally {
            set Working 0
        }
        my Start
        return [dict create text $Counts]
    }
    method Sure {} {
        if {[catch {my Truth} text]} {
            sorma::fail [list CHECKERS DEAD [my cget -lab]] "[my name]: the laboratory does not answer, so nothing can be counted: $text"
        }
        if {$Forgotten} {
            sorma::fail [list CHECKERS DEAD [my cget -lab]] "[my name]: the laboratory was started anew, and nobody has set out its tokens: nothing can be counted"
        }
    }

    # ---- what is said ----

    method Plot event {
        if {[dict get $event event] ne "plot" || $Number == 0} {
            return
        }
        set told [dict get $event text]
        set state [dict get $told state]
        if {$state in {carry tidy person}} {
            incr Moves
        }
        if {$state in {answer carried played person over}} {
            set Last [dict merge [dict create moves $Moves state $state] [my Lies $told]]
        }
        # A move that goes on has perhaps been carried in part.
        if {$state ni {answer carried over} || ($state eq "answer" && [dict get $told again])} {
            return
        }
        if {$Open} {
            my Missed "\"[dict get $Said state]\""
        }
        set Said $Last
        set Open 1
        my Start
    }
    method Person event {
        if {[dict get $event event] eq "person" && [dict get $event text state] in {remembered order undid}} {
            dict incr Counts setOut
            set Forgotten 0
        }
    }
    # The connection was away. Another laboratory knows nothing of the tokens of this one.
    method Again event {
        if {[dict get $event event] eq "sorma.reconnected"} {
            my Another
        }
    }
    method Another {} {
        if {[my Daemon] eq {} || [catch {my Started} began] || $began eq $Began} {
            return
        }
        set Began $began
        set Forgotten 1
        # The tokens will lie as the person remembers the game: perhaps after the move that is being carried.
        if {$Open && [dict get $Said state] ne "over"} {
            my Missed "\"[dict get $Said state]\""
        }
    }
    method Daemon {} {
        return [lindex [split [my cget -lab] @] 1]
    }
    method Started {} {
        return [dict get [sorma::health [my Daemon]] started]
    }

    # ---- judging ----

    method Start {} {
        if {$Open && !$Working} {
            set Working 1
            coroutine [self namespace]::Judges[incr ::checkers::Judged] [namespace which my] Work
        }
    }
    method Work {} {
        try {
            while {$Open && [my Judge]} {}
        } finally {
            set Working 0
        }
    }
    method Missed what {
        dict incr Counts unjudged
        my publish found -text [dict create kind unjudged text "what was said at $what could not be compared in time"]
        set Open 0
    }
    # Compares the last message with the tokens as they lie. AGAIN: also if it has been judged. Returns whether there may be
    # more to judge.
    method Judge {{again 0}} {
        if {!$Open && !$again} {
            return 0
        }
        set said $Said
        if {$Forgotten || [catch {my Truth} truth]} {
            my Ails [expr {$Forgotten ? "its tokens have not been set out" : $truth}]
            return 0
        }
        set Dead {}
        # Messages that have come meanwhile are taken first. A difference must be seen twice. A token that is missing both times
        # may have been in a hand between.
        sorma::await sleep 10
        set hand 0
        set differs [my Differences $Said $truth]
        if {$differs ne {} && $said eq $Said && [catch {
            sorma::await sleep 20
            set hand [my Hand]
            set second [my Differences $Said [my Truth]]
            set differs [dict filter $differs script {place -} {dict exists $second $place}]
            my Another
        } text]} {
            my Ails $text
            return 0
        }
        if {$said ne $Said} {
            return 1
        }
        if {$Forgotten} {
            return 0
        }
        if {[dict get $said moves] != $Moves && [dict get $said state] ne "over"} {
            if {$Open} {
                my Missed "\"[dict get $said state]\""
            }
            return 0
        }
        if {$Open} {
            dict incr Counts judged
        }
        set Open 0
        my Count $differs $hand
        return 0
    }
    method Ails text {
        if {$Dead ne $text} {
            set Dead $text
            my publish found -text [dict create kind dead text "the laboratory does not answer: $text"]
        }
    }
    # A laboratory that is away is not waited for.
    method Asked args {
        return [[sorma::async -timeout 2000 [my cget -lab] {*}$args] take]
    }
    method Truth {} {
        return [::checkers::tokens seen [my Asked exec tokens]]
    }
    # Is the person's hand over the board?
    method Hand {} {
        return [expr {[lindex [my Asked DBX -person] 3] ne "away"}]
    }
    # HAND: one is over the board. A token that is missing beside the board may be in this hand, also when the person has been
    # killed.
    method Count {differs hand} {
        set Held 0
        dict for {place text} $differs {
            if {$place in $Wrong} continue
            if {[my Beside $place]} {
                if {$hand} {
                    set Held 1
                    continue
                }
                set kind lost
            } else {
                set kind [expr {[dict get $Said state] eq "carried" ? "lost" : "wrong"}]
            }
            lappend Wrong $place
            dict incr Counts $kind
            my publish found -text [dict create kind $kind place $place text $text]
        }
        set Wrong [lmap place $Wrong {expr {[dict exists $differs $place] ? $place : [continue]}}]
    }
    method Beside place {
        return [expr {[lindex $place 0] eq "beside"}]
    }
    # Differences -> words. A difference is a field {file rank} of the board, or {beside colour n}: the heaps of that colour
    # lack their n-th token. A person may put a victim on another heap than the robot thinks. A token high above the board is in
    # somebody's hand.
    method Differences {said truth} {
        set width [dict get $said width]
        set strays {}
        lassign [my Sorted [lmap token $truth {
            lassign $token name file rank - - z
            set colour [lindex [split $name _] 0]
            set onBoard [expr {$file > 0.5 && $rank > 0.5 && $file < $width + 0.5 && $rank < $width + 0.5}]
            set place [list [expr {$onBoard ? round($file) : $file < 1 ? -0.4 : $width + 1.4}] [expr {round($rank)}]]
            # A heap has no token that lies half beside it.
            set away [expr {hypot($file - [lindex $place 0], $rank - min(max([lindex $place 1], 1), $width))}]
            if {$onBoard ? $z >= 0.03 : $z >= 0.06 || $away > 0.45} {
                # Those that play no part lie far away.
                if {$file < -3 || $file > $width + 4 || $rank < -2 || $rank > $width + 3} continue
                dict append strays $colour [format {, %s at %.2f %.2f, %.0f mm high} $name $file $rank [expr {1e3 * $z}]]
                continue
            }
            list $place $colour
        }] $width] is beside
        set told {}
        dict for {place stack} [dict get $said lies] {
            foreach colour $stack {
                lappend told [list $place $colour]
            }
        }
        lassign [my Sorted $told $width] should besideShould
        set differs {}
        foreach place [lsort -unique [concat [dict keys $is] [dict keys $should]]] {
            set here [expr {[dict exists $is $place] ? [dict get $is $place] : "nothing"}]
            set there [expr {[dict exists $should $place] ? [dict get $should $place] : "nothing"}]
            if {$here ne $there} {
                dict set differs $place "at $place lies [join $here {, }], and the robot says: [join $there {, }]"
            }
        }
        dict for {colour count} $besideShould {
            set there [expr {[dict exists $beside $colour] ? [dict get $beside $colour] : 0}]
            set stray [expr {[dict exists $strays $colour] ? "; elsewhere[string range [dict get $strays $colour] 1 end]" : {}}]
            for {set n 1} {$n <= $count - $there} {incr n} {
                dict set differs [list beside $colour $n] "on the heaps lie $there $colour tokens, and the robot says: $count$stray"
            }
        }
        return $differs
    }
    # Sorts tokens {place colour}, the lowest first, into place -> colours on the board, and colour -> number beside it.
    method Sorted {tokens width} {
        set onBoard [set beside {}]
        foreach token $tokens {
            lassign $token place colour
            if {[lindex $place 0] >= 1 && [lindex $place 0] <= $width} {
                dict lappend onBoard $place $colour
            } else {
                dict incr beside $colour
            }
        }
        return [list $onBoard $beside]
    }
}

package provide sorma::service::judge 1.0
