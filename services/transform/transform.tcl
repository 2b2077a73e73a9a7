# transform -- between the board, the picture and the world; and from where a token is seen to where the hand must go.
#
#     transform EXEC learnBoard                       the board has been moved: look for its markers
#     transform EXEC boardToWorld FMSG 3 3 4 0        -> FMSG 4 x y z yaw
#     transform EXEC learnGrasp FMSG 3 3 4 0          a token stands there: learn what it looks like beside the tool
#     transform EXEC correct FMSG 2 251.3 388.0       -> FMSG 2 dx dy, of the tool
#
# Two maps of class psom are underneath. One has a node for each of 4 x 4 x 2 places on and above the board, with the components
# file rank h  x y z  u v. It answers in all directions. The other one has the four places that the arm has visited, dx dy u v.

package require math::linearalgebra
package require sorma

oo::class create ::sorma::service::transform {
    superclass sorma::Service

    sorma::purpose "between the board, the picture and the world, learned from what the hand's camera sees"
    sorma::option -board vector -unit "m, rad" -length 3 -default {0.57 0 0} -help "where the board lies: x, y of its middle, yaw"
    sorma::option -learnFirst flag -default 0 -help "-board is where a board that may be moved was first: until learnBoard has found it, all else is an error"
    sorma::option -fields int -range {2 26} -default 8 -help "of a side of the board"
    sorma::option -field double -unit m -range {0.001 1} -default 0.045 -help "side of a field"
    sorma::option -markers vector -unit m -length 2 -default {0.206 0.160} -help "how far behind the middle of the board the markers are, and how far to its sides"
    sorma::option -token vector -unit m -length 2 -default {0.015 0.008} -help "radius and height of a token"
    sorma::option -survey vector -unit "m, 1" -length 7 -default {0.5 0 0.52 0 1 0 0} -help "pose of the tool from where the whole board is seen"
    sorma::option -lookHeight double -unit m -range {0.02 1} -default 0.1 -help "of the tool above a token that is looked at"
    sorma::option -grid double -unit m -range {0.001 0.05} -default 0.012 -help "how far learnGrasp goes to each side"
    sorma::option -mount vector -unit "m, 1" -length 7 -default {0.115 0 -0.150 0.703233 -0.0739128 -0.0739128 0.703233} \
        -help "the camera (x right, y down, z forward) in the tool's frame: position, quaternion w x y z"
    sorma::option -fieldOfView double -unit rad -range {0.05 3} -default 1.0122909661567112 -help "of the camera, from the top row to the bottom row"
    sorma::option -size vector -unit pixels -length 2 -default {500 500} -help "width and height of its pictures"
    sorma::option -mostResidual double -unit pixels -range {0.01 100} -default 1 -help "with a larger one learnCamera fails"
    sorma::option -colour enum -choices {red yellow} -default red -help "of the token that learnGrasp looks at"
    sorma::option -boardMap service -default psom.board -help "map of the board (class psom)"
    sorma::option -graspMap service -default psom.grasp -help "map of the correction (class psom)"
    sorma::option -finder service -help "finds the markers"
    sorma::option -disk service -help "finds a token"
    sorma::option -mover service -help "moves the tool on lines, to a pose in the world (class mvpos); none: it is moved by somebody else"
    sorma::option -hand service -help "centres the token before learnGrasp by closing on it (class manus); none: it stands in the middle"
    sorma::option -rest double -unit s -range {0 10} -default 0.1 -help "of the arm before it looks: its servos need a moment"
    sorma::option -picture service -help "answers a picture, its first float is its time: it must be new; none: the object that sees takes a new one"
    sorma::option -pose service -help "answers where the tool is: floats lab time, position, quaternion"
    sorma::words "boardToWorld|worldToBoard|boardToImage|imageToBoard|worldToImage|imageToWorld|correct|under|learnBoard|learnGrasp|learnCamera|learned"
    sorma::repeatable boardToWorld worldToBoard boardToImage imageToBoard worldToImage imageToWorld learned
    sorma::danger move learnBoard learnGrasp learnCamera
    sorma::reads floats 0..3 "" "board: file, rank, h (tokens underneath); world: x, y, z \[m\]; image: u, v \[pixels\], and how many\
        tokens high the point is, none: 0; correct: u, v; learnGrasp: file, rank, h of a token"
    sorma::writes floats 0.. "" "boardToWorld: x, y, z \[m\], yaw of the tool; others what their names say, as above; correct: dx, dy of the tool \[m\];\
        under: u, v where a token is seen that is under the tool;\
        learnBoard: x, y \[m\], yaw, by how much a marker has moved \[m\]; learnGrasp: residual \[m\]; learnCamera: mount (7), field of view,\
        residual \[pixels\]"
    sorma::writes ints 0..3 "" "learned: have board, grasp and camera been? each 1 or 0"
    sorma::writes text 0.. "" "learnGrasp, learnCamera: when"
    sorma::example "transform EXEC boardToWorld FMSG 3 3 4 0"

    variable Nodes      ;# what the map of the board was made of; empty: it must be made
    variable Learned    ;# dict: board grasp camera -> when, and the residual

    method born {} {
        set Nodes {}
        set Learned {}
    }

    method exec message {
        set words [dict get $message words]
        set word [lindex $words 0]
        set counts {boardToWorld 3 worldToBoard 3 boardToImage 3 imageToBoard {2 3} worldToImage 3 imageToWorld {2 3} correct 2 under 0
            learnBoard 0 learnGrasp 3 learnCamera 0 learned 0}
        if {[llength $words] != 1 || ![dict exists $counts $word]} {
            sorma::fail [list TRANSFORM WORD $word] "[my name]: bad word \"$word\": must be [join [dict keys $counts] {, }]"
        }
        set floats [dict get $message floats]
        if {[llength $floats] ni [dict get $counts $word]} {
            sorma::fail {TRANSFORM FLOATS} "[my name]: $word takes [join [dict get $counts $word] { or }] floats, got [llength $floats]"
        }
        if {[my cget -learnFirst] && $word ni {learnBoard learnCamera learned} && ![dict exists $Learned board]} {
            sorma::fail {TRANSFORM UNLEARNED} "[my name]: $word: since this object was made nobody has looked where the board lies: say [my name] EXEC learnBoard"
        }
        return [my [string toupper $word 0] {*}$floats]
    }

    method dump {} {
        set lines [list "board [my cget -board]"]
        dict for {what when} $Learned {
            lappend lines "$what learned $when"
        }
        return [join $lines \n]
    }

    # ---- the board and the world: the markers say where it lies, the rest is exact ----

    method World {file rank h} {
        lassign [my cget -board] x y yaw
        set half [expr {([my cget -fields] + 1) / 2.0}]
        set along [expr {($half - $rank) * [my cget -field]}]
        set aside [expr {($file - $half) * [my cget -field]}]
        return [list [expr {$x + cos($yaw) * $along - sin($yaw) * $aside}] [expr {$y + sin($yaw) * $along + cos($yaw) * $aside}] \
            [expr {$h * [lindex [my cget -token] 1]}]]
    }
    method BoardToWorld {file rank h} {
        return [dict create floats [concat [my World $file $rank $h] [lindex [my cget -board] 2]]]
    }
    method WorldToBoard {x y z} {
        lassign [my cget -board] x0 y0 yaw
        set half [expr {([my cget -fields] + 1) / 2.0}]
        set along [expr {cos($yaw) * ($x - $x0) + sin($yaw) * ($y - $y0)}]
        set aside [expr {-sin($yaw) * ($x - $x0) + cos($yaw) * ($y - $y0)}]
        return [dict create floats [list [expr {$half + $aside / [my cget -field]}] [expr {$half - $along / [my cget -field]}] \
            [expr {$z / [lindex [my cget -token] 1]}]]]
    }
    # Where the markers are on the table, for a place of the board.
    method MarkersAt board {
        return [::sorma::service::transform::markersAt $board [my cget -markers]]
    }

    # ---- the picture from the survey pose ----

    method BoardToImage {file rank h} {
        return [dict create floats [lrange [my Complete {1 1 1 0 0 0 0 0} [list $file $rank $h 0 0 0 0 0]] 6 7]]
    }
    method WorldToImage {x y z} {
        return [dict create floats [lrange [my Complete {0 0 0 1 1 1 0 0} [list 0 0 0 $x $y $z 0 0]] 6 7]]
    }
    method ImageToBoard {u v {h 0}} {
        return [dict create floats [lrange [my Complete {0 0 1 0 0 0 1 1} [list 0 0 $h 0 0 0 $u $v]] 0 2]]
    }
    method ImageToWorld {u v {h 0}} {
        return [dict create floats [lrange [my Complete {0 0 1 0 0 0 1 1} [list 0 0 $h 0 0 0 $u $v]] 3 5]]
    }
    method Complete {metric components} {
        my MakeBoardMap
        set map [my cget -boardMap]
        $map CTRL -metric $metric
        set answer [$map exec -floats $components complete]
        if {[dict exists $answer text] && [dict get $answer text] ne {}} {
            sorma::fail {TRANSFORM OUTSIDE} "[my name]: [join $components] ([join $metric]: inputs of file rank h x y z u v) is\
                [dict get $answer text] of the map of the board"
        }
        return [dict get $answer floats]
    }
    # A field's width beyond the board on all sides, from the table to four tokens high.
    method MakeBoardMap {} {
        set basis [lmap option {-board -fields -field -token -survey -mount -fieldOfView -size} {my cget $option}]
        if {$basis eq $Nodes} {
            return
        }
        set last [expr {[my cget -fields] + 1}]
        set axis [lmap k {0 1 2 3} {expr {$k * $last / 3.0}}]
        set vectors {}
        foreach file $axis {
            foreach rank $axis {
                foreach h {0 4} {
                    set point [my World $file $rank $h]
                    lappend vectors $file $rank $h {*}$point {*}[my PixelOf $point [my cget -survey]]
                }
            }
        }
        set map [my cget -boardMap]
        $map CTRL -axes [list $axis $axis {0 4}] -dimension 8 -scale 1 -margin 0.15
        $map exec -floats $vectors train
        set Nodes $basis
    }
    # The picture of a point in the world, when the tool is at a pose.
    method PixelOf {point pose} {
        return [::sorma::service::transform::pixelOf $point $pose [my cget -mount] [my cget -fieldOfView] [my cget -size]]
    }

    # ---- learning ----

    method LearnBoard {} {
        my Need learnBoard -finder
        set before [my cget -board]
        if {[my cget -mover] ne {}} {
            my Go [my cget -survey]
        }
        ::sorma::service::transform::fresh [my cget -picture] [my cget -pose] [my cget -rest]
        set board [lrange [dict get [[my cget -finder] exec] floats] 4 6]
        my configure -board $board
        my MakeBoardMap
        set moved 0
        foreach old [my MarkersAt $before] new [my MarkersAt $board] {
            set moved [expr {max($moved, hypot([lindex $new 0] - [lindex $old 0], [lindex $new 1] - [lindex $old 1]))}]
        }
        my Note board [format {moved %.1f mm} [expr {1e3 * $moved}]]
        return [dict create floats [concat $board $moved]]
    }

    # The tool above the token; then to the four corners around it. The map is made from the view there.
    method LearnGrasp {file rank h} {
        my Need learnGrasp -mover -disk
        lassign [my World $file $rank $h] x y z
        lassign [my cget -board] - - yaw
        set down [list 0 [expr {cos($yaw / 2)}] [expr {sin($yaw / 2)}] 0]
        set top [expr {$z + [lindex [my cget -token] 1]}]
        set over [expr {$top + [my cget -lookHeight]}]
        my Go [list $x $y $over {*}$down]
        if {[my cget -hand] ne {}} {
            my Centre $x $y $z $over $down
        }
        set grid [my cget -grid]
        set vectors {}
        foreach sx {-1 1} {
            foreach sy {-1 1} {
                lassign [::sorma::service::transform::inWorldAxes [expr {$sx * $grid}] [expr {$sy * $grid}] $yaw] dx dy
                set pose [list [expr {$x + $dx}] [expr {$y + $dy}] $over {*}$down]
                my Go $pose
                # To stand above the token the tool goes back by as much.
                lappend vectors [expr {-$sx * $grid}] [expr {-$sy * $grid}] {*}[my See [list $x $y $top] $pose]
            }
        }
        set map [my cget -graspMap]
        $map CTRL -axes {{-1 1} {-1 1}} -dimension 4 -scale 1 -margin 1
        $map exec -floats $vectors train
        # Above the token there is nothing to correct.
        my Go [list $x $y $over {*}$down]
        set residual [::tcl::mathfunc::hypot {*}[dict get [my Correct {*}[my See [list $x $y $top] [list $x $y $over {*}$down]]] floats]]
        my Note grasp [format {residual %.2f mm} [expr {1e3 * $residual}]]
        return [dict create floats $residual text [dict get $Learned grasp]]
    }
    method Correct {u v} {
        return [dict create floats [lrange [my Grasped {0 0 1 1} [list 0 0 $u $v]] 0 1]]
    }
    method Under {} {
        return [dict create floats [lrange [my Grasped {1 1 0 0} {0 0 0 0}] 2 3]]
    }
    method Grasped {metric components} {
        set map [my cget -graspMap]
        $map CTRL -metric $metric
        set answer [$map exec -floats $components complete]
        if {[dict exists $answer text] && [dict get $answer text] ne {}} {
            sorma::fail {TRANSFORM OUTSIDE} "[my name]: a token at pixel [lrange $components 2 3] is [dict get $answer text] of what learnGrasp has seen"
        }
        return [dict get $answer floats]
    }
    # The hand closes on the token and opens: now it stands under the middle of the tool.
    method Centre {x y z over down} {
        set hand [my cget -hand]
        $hand exec release
        my Go [list $x $y [expr {$z + 0.006}] {*}$down]
        $hand exec grasp
        $hand exec release
        my Go [list $x $y $over {*}$down]
    }

    # From poses around the survey pose, tilted and turned, the markers are looked at. How the camera is mounted, what it sees of the
    # world, and where the board lies is what fits best.
    method LearnCamera {} {
        my Need learnCamera -mover -finder -pose
        set views {}
        foreach {dx dy dz a b c} {0 0 0 0 0 0   0.03 0 -0.05 0 0.1 0   -0.03 0 0.02 0 -0.1 0.1   0 0.05 0 0.12 0 0.2   0 -0.05 0 -0.12 0 -0.2
                0.02 0.03 -0.06 0.08 0.08 -0.25   -0.02 -0.03 0.03 -0.08 0.08 0.25   0.02 -0.04 -0.03 0.06 -0.1 0   0 0 -0.08 0 0 0.3} {
            lassign [my cget -survey] x y z q0 q1 q2 q3
            set turned [::sorma::service::transform::turned [list $q0 $q1 $q2 $q3] [list $a $b $c]]
            my Go [concat [expr {$x + $dx}] [expr {$y + $dy}] [expr {$z + $dz}] $turned]
            ::sorma::service::transform::fresh [my cget -picture] [my cget -pose] [my cget -rest]
            set pixels [lrange [dict get [[my cget -finder] exec] floats] 0 3]
            lappend views [lrange [dict get [[my cget -pose] exec] floats] 1 7] $pixels
        }
        my Go [my cget -survey]
        set guess [list [my cget -mount] [my cget -fieldOfView] [my cget -board]]
        lassign [::sorma::service::transform::calibrated $guess $views [my cget -markers] [my cget -size]] mount fieldOfView board residual
        if {$residual > [my cget -mostResidual]} {
            sorma::fail {TRANSFORM CALIBRATION} [format {%s: the markers are off by %.2f pixels, -mostResidual is %.2f: they are not what was\
                seen, or -mount is too far from the truth} [my name] $residual [my cget -mostResidual]]
        }
        my configure -mount $mount -fieldOfView $fieldOfView -board $board
        [my cget -finder] CTRL -mount $mount -fieldOfView $fieldOfView
        my Note camera [format {residual %.2f pixels} $residual]
        return [dict create floats [concat $mount $fieldOfView $residual] text [dict get $Learned camera]]
    }

    # ---- requests to others ----

    method Need {word args} {
        foreach part $args {
            if {[my cget $part] eq {}} {
                sorma::fail [list TRANSFORM PART $part] "[my name]: $word needs $part, which names nobody"
            }
        }
    }
    method Go pose {
        [my cget -mover] exec -floats $pose
    }
    # Where a token is seen in a picture that is taken now.
    method See {point pose} {
        ::sorma::service::transform::fresh [my cget -picture] [my cget -pose] [my cget -rest]
        return [lrange [dict get [[my cget -disk] exec -floats [my PixelOf $point $pose] -text [my cget -colour]] floats] 0 1]
    }
    method Learned {} {
        return [dict create ints [lmap what {board grasp camera} {dict exists $Learned $what}]]
    }
    method Note {what measured} {
        dict set Learned $what "[clock format [clock seconds] -format {%Y-%m-%d %H:%M:%S}], $measured"
        my publish learned -text "$what [dict get $Learned $what]"
    }
}

# Returns when the arm has rested for so many seconds of lab time, and there is a picture that was taken then.   picture, pose: the
# objects that answer them. Without picture the object that sees takes a new one; without pose there is no waiting. Fails when it takes longer than patience [s].
namespace eval ::sorma::service::transform {
    namespace path ::math::linearalgebra            ;# dotproduct, solveGauss
}
proc ::sorma::service::transform::fresh {picture pose rest {patience 10}} {
    if {$pose eq {}} {
        return
    }
    set since [expr {[lindex [dict get [$pose exec] floats] 0] + $rest}]
    set end [expr {[clock milliseconds] + 1000 * $patience}]
    while {[lindex [dict get [$pose exec] floats] 0] < $since || ($picture ne {} && [lindex [dict get [$picture exec] floats] 0] <= $since)} {
        if {[sorma::cancelled]} {
            return
        }
        if {[clock milliseconds] > $end} {
            sorma::fail {VISION PICTURE} "there is no new picture since $patience s; the camera stands, or the laboratory"
        }
        after 2 [info coroutine]
        yield
    }
}

# ---- a camera on a tool; quaternions w x y z ----

proc ::sorma::service::transform::rotate {q v} {
    lassign $q w x y z
    lassign $v a b c
    set p [expr {2 * ($y * $c - $z * $b)}]
    set q [expr {2 * ($z * $a - $x * $c)}]
    set r [expr {2 * ($x * $b - $y * $a)}]
    return [list [expr {$a + $w * $p + $y * $r - $z * $q}] [expr {$b + $w * $q + $z * $p - $x * $r}] [expr {$c + $w * $r + $x * $q - $y * $p}]]
}
# A point of the world in a frame: position, quaternion.
proc ::sorma::service::transform::into {frame point} {
    lassign $frame x y z w a b c
    lassign $point u v t
    return [rotate [list $w [expr {-$a}] [expr {-$b}] [expr {-$c}]] [list [expr {$u - $x}] [expr {$v - $y}] [expr {$t - $z}]]]
}
proc ::sorma::service::transform::pixelOf {point tool mount fieldOfView size} {
    lassign [into $mount [into $tool $point]] x y z
    lassign $size width height
    set f [expr {$height / (2 * tan($fieldOfView / 2))}]
    return [list [expr {$width / 2.0 - 0.5 + $f * $x / $z}] [expr {$height / 2.0 - 0.5 + $f * $y / $z}]]
}
# A displacement along the axes of a tool that points down and is turned by yaw, in the world's axes.
proc ::sorma::service::transform::inWorldAxes {dx dy yaw} {
    return [list [expr {cos($yaw) * $dx + sin($yaw) * $dy}] [expr {sin($yaw) * $dx - cos($yaw) * $dy}]]
}

# A quaternion, turned by a small rotation vector in its own frame.
proc ::sorma::service::transform::turned {q by} {
    set angle [expr {max(1e-12, sqrt([dotproduct $by $by]))}]
    set s [expr {sin($angle / 2) / $angle}]
    lassign $q w x y z
    lassign [lmap b $by {expr {$s * $b}}] a b c
    set d [expr {cos($angle / 2)}]
    return [list [expr {$w * $d - $x * $a - $y * $b - $z * $c}] [expr {$w * $a + $x * $d + $y * $c - $z * $b}] \
        [expr {$w * $b - $x * $c + $y * $d + $z * $a}] [expr {$w * $c + $x * $b - $y * $a + $z * $d}]]
}
proc ::sorma::service::transform::markersAt {board markers} {
    lassign $board x y yaw
    lassign $markers behind aside
    return [lmap side {-1 1} {
        list [expr {$x - cos($yaw) * $behind - sin($yaw) * $side * $aside}] [expr {$y - sin($yaw) * $behind + cos($yaw) * $side * $aside}] 0
    }]
}

# ---- the camera that fits best what was seen: Gauss-Newton, with Levenberg's term ----

# guess: mount, field of view, board; views: pose of the tool, pixels of both markers, and so on. Returns mount, field of view, board,
# and the rms of what is left [pixels].
proc ::sorma::service::transform::calibrated {guess views markers size} {
    set steps [lrepeat 10 0.0]
    set left [Residuals $guess $views $markers $size]
    set damping 1e-3
    for {set round 0} {$round < 30} {incr round} {
        # Columns of the Jacobian.
        set columns {}
        for {set k 0} {$k < 10} {incr k} {
            set moved [Residuals [Changed $guess [lreplace $steps $k $k 1e-6]] $views $markers $size]
            lappend columns [lmap m $moved l $left {expr {($m - $l) / 1e-6}}]
        }
        set normal [lmap one $columns {lmap other $columns {dotproduct $one $other}}]
        for {set k 0} {$k < 10} {incr k} {
            lset normal $k $k [expr {[lindex $normal $k $k] * (1 + $damping)}]
        }
        set change [solveGauss $normal [lmap one $columns {expr {-[dotproduct $one $left]}}]]
        set next [Changed $guess $change]
        set leftNext [Residuals $next $views $markers $size]
        if {[dotproduct $leftNext $leftNext] > [dotproduct $left $left]} {
            set damping [expr {10 * $damping}]
            continue
        }
        set guess $next
        set left $leftNext
        set damping [expr {$damping / 10}]
        if {[dotproduct $change $change] < 1e-18} {
            break
        }
    }
    return [concat $guess [expr {sqrt([dotproduct $left $left] / [llength $left])}]]
}
proc ::sorma::service::transform::Residuals {camera views markers size} {
    lassign $camera mount fieldOfView board
    set left {}
    foreach {tool pixels} $views {
        foreach marker [markersAt $board $markers] {u v} $pixels {
            lassign [pixelOf $marker $tool $mount $fieldOfView $size] a b
            lappend left [expr {$a - $u}] [expr {$b - $v}]
        }
    }
    return $left
}
proc ::sorma::service::transform::Changed {camera by} {
    lassign $camera mount fieldOfView board
    return [list [concat [lmap a [lrange $mount 0 2] b [lrange $by 0 2] {expr {$a + $b}}] [turned [lrange $mount 3 6] [lrange $by 3 5]]] \
        [expr {$fieldOfView + [lindex $by 6]}] [lmap a $board b [lrange $by 7 9] {expr {$a + $b}}]]
}

package provide sorma::service::transform 1.0
