# dry.tcl -- a game without robot and camera: drycarry and drysight do by requests to simlab what carry and getBrdSit do by hand and eye.
#
#     drycarry -lab simlab@lab            drycarry EXEC FMSG 6 3 3 0 4 4 0
#     drysight -lab simlab@lab            drysight EXEC; publishes seen as boardsight does

package require sorma
package require checkers::tokens

# The part of the laboratory that both know.
oo::class create ::checkers::laboratory {
    superclass sorma::Service

    # Tokens that lie at a place, the lowest first: {name z}.
    method At {file rank} {
        set here {}
        foreach token [my Tokens] {
            lassign $token name f r - - z
            if {abs($f - $file) < 0.3 && abs($r - $rank) < 0.3} {
                lappend here [list $name $z]
            }
        }
        return $here
    }
    method Tokens {} {
        return [::checkers::tokens seen [[my cget -lab] exec tokens]]
    }
}

oo::class create ::sorma::service::drycarry {
    superclass ::checkers::laboratory
    sorma::purpose "puts tokens from field to field, without a robot"
    sorma::option -lab service -default simlab -help "the laboratory"
    sorma::words "?height|finish?"
    sorma::reads floats 2..6 "" "from: file, rank, tokens underneath; to: the same. height: file, rank"
    sorma::reads ints 0..1 "" "how many tokens are carried together: all that lie there"
    sorma::reads text * "" "their colour"
    sorma::writes floats 1..3 "" "how far beside the field it lies, file and rank; seconds. height: how many tokens lie there; finish: 0, the hand holds nothing"
    sorma::example "drycarry CTRL -help"

    method exec message {
        switch [dict get $message words] {
            height { return [dict create floats [llength [my At {*}[dict get $message floats]]]] }
            finish { return {floats 0} }
        }
        lassign [dict get $message floats] file rank underneath toFile toRank above
        set underneath [expr {int($underneath)}]
        set above [expr {int($above)}]
        set here [my At $file $rank]
        if {[llength $here] <= $underneath} {
            return -code error -errorcode [list SORMA CARRY EMPTY [my name]] \
                "[my name]: at $file $rank lie [llength $here] tokens; there is none above $underneath"
        }
        set there [llength [my At $toFile $toRank]]
        if {$there != $above} {
            return -code error -errorcode [list SORMA CARRY OCCUPIED [my name]] "[my name]: at $toFile $toRank lie $there tokens, not $above"
        }
        my Put [lmap token [lrange $here $underneath end] {lindex $token 0}] $toFile $toRank $above
        return {floats {0 0 0}}
    }
    # Tokens, the lowest first, on so many others.
    method Put {names file rank above} {
        foreach name $names {
            [my cget -lab] CTRL -move $name $file $rank $above
            set above [expr {$above + 1}]
        }
    }
}

oo::class create ::sorma::service::drysight {
    superclass ::checkers::laboratory
    sorma::purpose "says what stands on the board, without a camera"
    sorma::option -lab service -default simlab -help "the laboratory"
    sorma::option -width int -range {8 10} -default 8 -help "files of the board"
    sorma::writes text 0.. "" "a character for each field: . nothing, or the first letter of a colour; the last rank first"
    sorma::example "drysight CTRL -help"

    method exec message {
        set width [my cget -width]
        set fields [lrepeat [expr {$width * $width}] .]
        foreach token [my Tokens] {
            lassign $token name file rank
            if {$file < 0.5 || $file >= $width + 0.5 || $rank < 0.5 || $rank >= $width + 0.5} continue
            lset fields [expr {($width - round($rank)) * $width + round($file) - 1}] [string index $name 0]
        }
        my publish seen -text [join $fields {}] -floats [lrepeat [llength $fields] 1]
        return [dict create text [join $fields {}]]
    }
}

# Move the board [m, rad], and what lies beside it as well. Tokens that lie there are taken away first: one that is put where another
# one still lies pushes it away.
proc ::checkers::moveBoard {lab dx dy turn {width 8}} {
    set beside {}
    foreach token [::checkers::tokens seen [$lab exec tokens]] {
        lassign $token name file rank - - z
        if {$file < 0.5 || $file > $width + 0.5} {
            lappend beside [list $name $file $rank [expr {round($z / 0.008 - 0.5)}]]
        }
    }
    set beside [lmap token $beside {
        lassign $token name file rank
        expr {min($file, $rank) > -4 && max($file, $rank) < $width + 4 ? $token : [continue]}
    }]
    foreach token $beside {
        $lab CTRL -steal [lindex $token 0]
    }
    $lab CTRL -board $dx $dy $turn
    foreach token $beside {
        lassign $token name file rank above
        catch {$lab CTRL -move $name $file $rank $above}
    }
}

package provide sorma::service::drycarry 1.0
package provide sorma::service::drysight 1.0
