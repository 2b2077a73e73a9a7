# image.tcl -- sorma::image: a picture from a service object (in `any` of its reply) or from a program, with marks of what was found in it.

package require sorma::options
package require sorma::parts
package provide sorma::image 1.0

# ::sorma::image .w ?-name SO -request WORDS -every ms? ?-size WxH? ?-zoom n? ?-brief 0|1? --
# Options:
#       -name SO                        the object that is asked
#       -request WORDS                  the reply has the picture in its part any; default EXEC
#       -every MS                       how often it is asked for, one request at a time; 0 (default): when refresh is called
#       -size WxH                       of a raw picture: bytes of grey, or of red, green and blue
#       -zoom N                         1, 1.5, 2, 3 ..., 0.75, 0.66, 0.6, 0.5, 0.4, 0.33 ..., or what is next
#       -zoom fit                       the largest of these for which there is room, in the middle
#       -width, -height                 of the window
#       -state disabled                 keys and mouse do nothing
#       -brief 1                        without a new picture it says only that: a notice of the window says why
# Methods:
#       show BYTES                      a picture: PPM, PGM, PNG or raw; error IMAGE FORMAT
#       refresh                         ask for it now
#       point|box|text TAG X Y ...      a mark at pixels of the picture: point TAG X Y, box TAG X1 Y1 X2 Y2, text TAG X Y TEXT; options are
#                                       -colour. One with the same tag is replaced
#       unmark ?TAG?                    that mark, or all
#       photo, subject, answer          the image of Tk; what became of the last request: ok, or error and a message
# Event <<SormaShown>> comes after each picture.
snit::widget ::sorma::image {
    hulltype ttk::frame
    option -name -default {} -readonly 1
    option -request -default EXEC
    option -every -default 0 -configuremethod SetEvery
    option -size -default {}
    option -zoom -default 1 -configuremethod SetZoom
    option -brief -default 0
    option -width -default 320 -readonly 1
    option -height -default 240 -readonly 1
    ::sorma::stateParts
    component canvas
    variable photo {}
    variable drawn {}           ;# the photo that is on the canvas: a zoomed one, or the same
    variable subject {}
    variable timer {}
    variable asking 0
    variable answer {}
    variable ratio {1 1}        ;# how the picture is drawn: so many times larger, then smaller
    variable marks {}           ;# dict: tag -> {kind coordinates text colour}

    constructor args {
        set photo [::image create photo]
        set drawn [::image create photo]
        $self configurelist $args
        install canvas using canvas $win.canvas -highlightthickness 0 -borderwidth 0 -background [ttk::style lookup . -background] \
            -width [::sorma::style pixels $options(-width)] -height [::sorma::style pixels $options(-height)] \
            -xscrollcommand [list ::sorma::parts::scrolled $win.x] -yscrollcommand [list ::sorma::parts::scrolled $win.y]
        ttk::scrollbar $win.x -style [::sorma::style own Horizontal.TScrollbar] -orient horizontal -command [list $canvas xview]
        ttk::scrollbar $win.y -style [::sorma::style own Vertical.TScrollbar] -command [list $canvas yview]
        ttk::label $win.below -font [::sorma::style font small] -anchor w
        grid $canvas $win.y -sticky nsew
        grid $win.x -sticky ew
        grid $win.below - -sticky ew
        grid rowconfigure $win 0 -weight 1
        grid columnconfigure $win 0 -weight 1
        $canvas create image 0 0 -anchor nw -image $drawn -tags picture
        bind $canvas <Motion> [mymethod Act Under %x %y]
        bind $canvas <Configure> [mymethod Fit]
        bind $canvas <Leave> [list $win.below configure -text {}]
        bind $canvas <plus> [mymethod Act Zoom 1]
        bind $canvas <minus> [mymethod Act Zoom -1]
        bind $canvas <ButtonPress-1> [mymethod Act Grip %x %y]
        bind $canvas <B1-Motion> [mymethod Act Drag %x %y]
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        if {$options(-name) ne {}} {
            set subject [::sorma::subject of $options(-name)]
            $self refresh
        }
        $self Enable
    }
    method Enable {} {
        if {$canvas ne {}} {
            $canvas configure -takefocus [$self Enabled]
            $win.below state [expr {[$self Enabled] ? "!disabled" : "disabled"}]
        }
    }
    method Grip {x y} {
        focus $canvas
        $canvas scan mark $x $y
    }
    method Drag {x y} {
        $canvas scan dragto $x $y 1
    }
    method Ended window {
        if {$window ne $win} return
        after cancel $timer
        if {$subject ne {}} {
            $subject release
            set subject {}
        }
        ::image delete $photo $drawn
    }

    # ---- what programs say ----

    method photo {} {
        return $photo
    }
    method subject {} {
        return $subject
    }
    method answer {} {
        return $answer
    }
    method show bytes {
        $self Read $bytes
        $self Draw
        event generate $win <<SormaShown>>
    }
    method refresh {} {
        after cancel $timer
        if {$subject eq {} || $asking} return
        set asking 1
        $subject ask $options(-request) [list ::sorma::parts::answer [mymethod Answered]]
    }
    method point {tag x y args} {
        $self Mark $tag point [list $x $y] {} $args
    }
    method box {tag x1 y1 x2 y2 args} {
        $self Mark $tag box [list $x1 $y1 $x2 $y2] {} $args
    }
    method text {tag x y text args} {
        $self Mark $tag text [list $x $y] $text $args
    }
    method unmark {{tag {}}} {
        set marks [if {$tag ne {}} {dict remove $marks $tag}]
        $self DrawMarks
    }

    # ---- pictures ----

    method SetEvery {option value} {
        set options($option) $value
        $self refresh
    }
    method SetZoom {option value} {
        if {$value ne "fit" && (![string is double -strict $value] || $value <= 0 || $value > 32)} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "-zoom expects fit or a number above 0, up to 32, got \"$value\""
        }
        set options($option) $value
        if {$canvas ne {}} {
            $self Draw
        }
    }
    # The next step of 1/3, 1/2, 1, 2, 3.
    method Zoom step {
        set zoom [$self Factor]
        set n [expr {$zoom >= 1 ? int($step < 0 ? ceil($zoom) : $zoom) : -round(1.0 / $zoom + 0.2) + 2}]
        set n [expr {max(-6, min(16, $n + $step))}]
        $self configure -zoom [expr {$n >= 1 ? $n : 1.0 / (2 - $n)}]
    }
    method Answered {status value} {
        set asking 0
        if {$options(-every) > 0} {
            set timer [after $options(-every) [mymethod refresh]]
        }
        if {$status eq "ok" && ![dict exists $value any]} {
            set status error
            set value [list "the reply to $options(-request) has no picture: nothing in its part any" {}]
        }
        if {$status eq "ok" && [catch {$self show [dict get $value any]} message]} {
            set status error
            set value [list $message {}]
        }
        set answer [if {$status eq "ok"} {string cat ok} else {list error [lindex $value 0]}]
        $win.below configure -text [if {$status ne "ok"} {expr {$options(-brief) ? "no new picture" : [lindex $value 0]}}] -foreground [$self Shade refused]
    }
    method Read bytes {
        set wrong {}
        if {[string match "P\[56\]*" $bytes]} {
            if {![catch {$photo configure -format ppm -data $bytes} wrong]} return
        } elseif {[string range $bytes 0 3] eq "\x89PNG"} {
            if {![catch {$photo configure -format png -data $bytes} wrong]} return
        } elseif {[regexp {^(\d+)x(\d+)$} $options(-size) -> width height]} {
            # Raw: a head makes it one of the formats above.
            foreach {channels magic} {1 P5 3 P6} {
                if {[string length $bytes] == $width * $height * $channels} {
                    $photo configure -format ppm -data "$magic\n$width $height\n255\n$bytes"
                    return
                }
            }
            set wrong "a raw picture of $options(-size) has [expr {$width * $height}] or [expr {3 * $width * $height}] bytes, this has [string length $bytes]"
        } else {
            set wrong "it is neither PPM, PGM nor PNG, and -size does not say how large a raw one is"
        }
        return -code error -errorcode {SORMA IMAGE FORMAT} "not a picture: $wrong"
    }
    # The room has changed.
    method Fit {} {
        if {$options(-zoom) eq "fit" && [$self Ratio] ne $ratio} {
            $self Draw
        } else {
            $self Region
        }
    }
    # A picture that fits stands in the middle.
    method Region {} {
        set w [::image width $drawn]
        set h [::image height $drawn]
        set fits [expr {$options(-zoom) eq "fit"}]
        set x [expr {$fits * max(0, [winfo width $canvas] - $w) / 2}]
        set y [expr {$fits * max(0, [winfo height $canvas] - $h) / 2}]
        $canvas configure -scrollregion [list -$x -$y [expr {$w + $x}] [expr {$h + $y}]]
    }
    method Draw {} {
        $drawn blank
        $drawn configure -width 1 -height 1
        $drawn configure -width 0 -height 0
        lassign [set ratio [$self Ratio]] up down
        if {$up == 1 || $down == 1} {
            $drawn copy $photo -zoom $up -subsample $down -shrink
        } else {
            set larger [::image create photo]
            $larger copy $photo -zoom $up
            $drawn copy $larger -subsample $down -shrink
            ::image delete $larger
        }
        $self Region
        $self DrawMarks
    }
    method Factor {} {
        lassign [$self Ratio] up down
        return [expr {double($up) / $down}]
    }
    # The zoom as two whole numbers.
    method Ratio {} {
        set zoom $options(-zoom)
        if {$zoom eq "fit"} {
            if {[::image width $photo] == 0} {
                return {1 1}
            }
            set zoom [expr {min(32, double([winfo width $canvas]) / [::image width $photo], double([winfo height $canvas]) / [::image height $photo])}]
            # Less than two fifths: rather smaller than larger.
            set zoom [expr {$zoom < 0.4 ? 1.0 / min(32, ceil(1 / $zoom)) : $zoom}]
        }
        foreach {least up down} [list 2 [expr {int($zoom)}] 1 1.5 3 2 1 1 1 0.75 3 4 0.66 2 3 0.6 3 5 0.5 1 2 0.4 2 5] {
            if {$zoom >= $least} {
                return [list $up $down]
            }
        }
        return [list 1 [expr {round(1.0 / $zoom)}]]
    }

    # ---- marks ----

    method Mark {tag kind coordinates text words} {
        set facts [::sorma::options::parse {-colour {any #f5c211}} $words]
        foreach n $coordinates {
            if {![string is double -strict $n]} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "$kind $tag: expected a number of pixels, got \"$n\""
            }
        }
        dict set marks $tag [list $kind $coordinates $text [dict get $facts -colour]]
        $self DrawMarks
    }
    method DrawMarks {} {
        $canvas delete mark
        set f [$self Factor]
        set arm [::sorma::style pixels 5]
        dict for {tag mark} $marks {
            lassign $mark kind coordinates text colour
            # Pixels are squares: their middle is meant.
            set at [lmap n $coordinates {expr {($n + 0.5) * $f}}]
            lassign $at x y
            switch -- $kind {
                point {
                    $canvas create line [expr {$x - $arm}] $y [expr {$x + $arm}] $y -fill $colour -tags [list mark mark-$tag]
                    $canvas create line $x [expr {$y - $arm}] $x [expr {$y + $arm}] -fill $colour -tags [list mark mark-$tag]
                }
                box { $canvas create rectangle $at -outline $colour -tags [list mark mark-$tag] }
                text { $canvas create text $at -text $text -fill $colour -anchor w -font [::sorma::style font small] -tags [list mark mark-$tag] }
            }
        }
    }
    # The pixel under the pointer.
    method Under {x y} {
        set f [$self Factor]
        set px [expr {int([$canvas canvasx $x] / $f)}]
        set py [expr {int([$canvas canvasy $y] / $f)}]
        if {$px < 0 || $py < 0 || $px >= [::image width $photo] || $py >= [::image height $photo]} {
            return [$win.below configure -text {}]
        }
        $win.below configure -text "$px, $py: [$photo get $px $py]" -foreground [ttk::style lookup . -foreground {} black]
    }
}
