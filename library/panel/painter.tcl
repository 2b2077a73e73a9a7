# painter.tcl -- sorma::painter, a table of colours trained by painting. The user says which pixels of a picture are of a colour. The table learns
# from them, and a second picture shows what it takes each pixel for.

package require sorma::options
package require sorma::parts
package provide sorma::painter 1.0

# ::sorma::painter .w -name SO -picture SO ?-request WORDS? ?-brush PIXELS? ?-file FILE? --
# Options:
#       -name SO         an hsvtable
#       -picture SO      an object that replies to -request with pictures: PPM, or RGB with floats time, width, height
#       -request WORDS   default EXEC
#       -brush PIXELS    its radius
#       -file FILE       where Save writes the table
# Methods:
#       take            a new picture; those before, with what was painted on them, are kept
#       show PPM        this one
#       paint COLOUR X Y ?X Y ...?      a stroke of the brush through these pixels; COLOUR: a number of the table, or unknown
#       undo            the last stroke
#       learn           the table forgets what it learned, learns from all that is painted, and says what it takes the picture for
#       save            write the table to -file
#       painted         how many pixels of each colour are painted: a dict
#       said            what has come of the last thing done
snit::widget ::sorma::painter {
    hulltype ttk::frame
    option -name -default {} -readonly 1
    option -picture -default {} -readonly 1
    option -request -default EXEC -readonly 1
    option -brush -default 6 -configuremethod SetBrush
    option -file -default {}
    # colour of the table: what it is called, and how it is shown
    typevariable Colours {0 {background #77767b} 1 {red #e01b24} 2 {yellow #f6d32d} 3 {violet #9141ac}}
    typevariable Unknown 255
    component left
    component right
    variable table {}           ;# the subject of -name
    variable source {}          ;# that of -picture
    variable photo {}           ;# as it is shown: painted, and zoomed on a display of many dots per inch
    variable base {}            ;# as it came
    variable seen {}            ;# what the table takes the picture for
    variable kept {}            ;# {size pixels labels} of each picture before
    variable toLearn {}         ;# of those, what has not been sent yet
    variable size {0 0}
    variable pixels {}          ;# RGB of the picture
    variable labels {}          ;# a byte string for each row
    variable before {}          ;# labels as they were before each stroke
    variable colour 1           ;# of the brush
    variable last {0 0}         ;# pixel where the stroke is
    variable over {}            ;# where the pointer is
    variable busy 0             ;# a request is under way
    variable said {}

    constructor args {
        foreach name {photo base seen} {
            set $name [::image create photo]
        }
        $self configurelist $args
        foreach option {-name -picture} {
            if {$options($option) eq {}} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "$type: -name and -picture must say what it is for"
            }
        }
        $self Tools
        foreach {side picture text} [list left $photo "Paint" right $seen "What the table takes it for"] {
            ttk::labelframe $win.$side -text $text
            canvas $win.$side.canvas -highlightthickness 0 -borderwidth 0 -background [ttk::style lookup . -background] \
                -width [::sorma::style pixels 320] -height [::sorma::style pixels 320] -takefocus 1
            $win.$side.canvas create image 0 0 -anchor nw -image $picture
            pack $win.$side.canvas -fill both -expand 1
        }
        set left $win.left.canvas
        set right $win.right.canvas
        ttk::label $win.said -textvariable [myvar said] -anchor w -justify left
        bind $win.said <Configure> {%W configure -wraplength %w}
        grid $win.tools - -sticky ew -padx [::sorma::style pixels 6] -pady [::sorma::style pixels 6]
        grid $win.left $win.right -sticky nsew -padx [::sorma::style pixels 6]
        grid $win.said - -sticky ew -padx [::sorma::style pixels 6] -pady [::sorma::style pixels 6]
        grid rowconfigure $win 1 -weight 1
        grid columnconfigure $win {0 1} -weight 1 -uniform picture
        bind $left <ButtonPress-1> [mymethod Begin %x %y]
        bind $left <B1-Motion> [mymethod Move %x %y]
        bind $left <Motion> [mymethod Over %x %y]
        bind $left <Leave> [list $left delete brush]
        dict for {n -} $Colours {
            bind $left <Key-$n> [mymethod Choose $n]
        }
        foreach {key words} [list u "Choose $Unknown" bracketleft "Wider -1" bracketright "Wider 1" Control-z undo] {
            bind $left <$key> [mymethod {*}$words]
        }
        # Keys act wherever the focus is within, and not in what stands beside it.
        foreach {key words} {n take z undo l learn s save} {
            bind SormaPainter$win <Alt-$key> "[mymethod $words]; break"
        }
        ::sorma::style::tag $win SormaPainter$win
        bind $win <Destroy> +[list ::sorma::parts::ended $win [mymethod Ended %W]]
        set table [::sorma::subject of $options(-name)]
        set source [::sorma::subject of $options(-picture)]
        $self take
    }
    method Ended window {
        if {$window ne $win || $table eq {}} return
        ::sorma::style untag SormaPainter$win
        $table release
        $source release
        set table {}
        ::image delete $photo $base $seen
    }
    method Tools {} {
        set pad [::sorma::style pixels 6]
        set tools [ttk::frame $win.tools]
        set all {}
        dict for {n item} $Colours {
            lassign $item name shown
            frame $tools.swatch$n -width [::sorma::style pixels 14] -height [::sorma::style pixels 14] -background $shown
            ttk::radiobutton $tools.colour$n -style [::sorma::style own TRadiobutton] -text "$n $name" -underline 0 -variable [myvar colour] -value $n
            lappend all $tools.swatch$n $tools.colour$n
        }
        ttk::radiobutton $tools.unknown -style [::sorma::style own TRadiobutton] -text [::msgcat::mc "unknown"] -underline 0 -variable [myvar colour] -value $Unknown
        ttk::label $tools.brushText -text [::msgcat::mc "Brush \[ \]"]
        ttk::label $tools.brush -textvariable [myvar options(-brush)] -width 3
        lappend all $tools.unknown $tools.brushText $tools.brush
        foreach {name text underline} {take "New picture" 0 undo "Undo (Ctrl-Z)" 11 learn Learn 0 save Save 0} {
            ttk::button $tools.$name -text $text -underline $underline -command [mymethod $name]
            lappend all $tools.$name
        }
        set column -1
        foreach w $all {
            grid $w -row 0 -column [incr column] -padx [list 0 $pad]
        }
        ttk::label $tools.fileText -text [::msgcat::mc "File"]
        ttk::entry $tools.file -textvariable [myvar options(-file)]
        grid $tools.fileText -row 1 -column 0 -columnspan 2 -sticky w -pady [list $pad 0]
        grid $tools.file -row 1 -column 2 -columnspan [expr {$column - 1}] -sticky ew -pady [list $pad 0]
        grid columnconfigure $tools $column -weight 1
    }

    # ---- what programs say ----

    method said {} {
        return $said
    }
    method painted {} {
        set out {}
        dict for {n -} $Colours {
            dict set out $n [expr {[regexp -all [format %c $n] [join $labels {}]]}]
        }
        return $out
    }
    method take {} {
        $self Ask $source "taking a picture" $options(-request) Taken
    }
    method show bytes {
        if {![regexp {^P6\s+(\d+)\s+(\d+)\s+255\s} $bytes head width height]} {
            return -code error -errorcode {SORMA IMAGE FORMAT} \
                "not a picture: it must be PPM (P6) with 255 levels; this begins with \"[string range $bytes 0 1]\""
        }
        set rgb [string range $bytes [string length $head] end]
        if {[string length $rgb] != 3 * $width * $height} {
            return -code error -errorcode {SORMA IMAGE FORMAT} \
                "a picture of ${width}x$height has [expr {3 * $width * $height}] bytes, this has [string length $rgb]"
        }
        if {[tcl::mathop::+ {*}[dict values [$self painted]]] > 0} {
            lappend kept [list $size $pixels [join $labels {}]]
        }
        set size [list $width $height]
        set pixels $rgb
        set labels [lrepeat $height [string repeat [format %c $Unknown] $width]]
        set before {}
        $base configure -format ppm -data $bytes
        foreach w [list $left $right] {
            $w configure -width [expr {$width * [Factor]}] -height [expr {$height * [Factor]}]
        }
        $seen blank
        $self Draw 0 $height
    }
    method paint {stroke args} {
        set colour [if {$stroke eq "unknown"} {set Unknown} else {set stroke}]
        lassign $args x y
        $self Stroke $x $y
        foreach {x y} $args {
            $self Line $x $y
        }
    }
    method undo {} {
        if {[llength $before] > 0} {
            set labels [lindex $before end]
            set before [lrange $before 0 end-1]
            $self Draw 0 [lindex $size 1]
        }
    }
    method learn {} {
        set all $kept
        lappend all [list $size $pixels [join $labels {}]]
        set colours [lmap {n -} $Colours {if {![regexp [format %c $n] [join [lmap item $all {lindex $item 2}]]]} continue; string cat $n}]
        if {[llength $colours] < 2} {
            set said "Paint at least two colours first: the keys 0 to 3 choose one."
            return
        }
        set toLearn $all
        $self Ask $table "forgetting" {CTRL -unlearn} Trained
    }
    method save {} {
        if {$options(-file) eq {}} {
            set said "Save needs the name of a file, at the host of $options(-name)."
            focus $win.tools.file
            return
        }
        $self Ask $table "saving" [list CTRL -save $options(-file)] Saved
    }

    # ---- requests: one at a time ----

    proc Request {word size bytes} {
        return [list EXEC $word FMSG 3 0 {*}$size AMSG [binary encode base64 $bytes]]
    }
    method Ask {subject what words then} {
        if {$busy} return
        set busy 1
        set said "[$subject name]: $what \u2026"
        foreach name {take learn save} {
            $win.tools.$name state disabled
        }
        $subject ask $words [list ::sorma::parts::answer [mymethod Answered] $then]
    }
    method Answered {then status value} {
        set busy 0
        foreach name {take learn save} {
            $win.tools.$name state !disabled
        }
        $win.said configure -foreground [if {$status eq "ok"} {::ttk::style lookup . -foreground {} black} else {::sorma::style colour refused}]
        if {$status ne "ok"} {
            set said [lindex $value 0]
        } elseif {[catch {$self {*}$then $value} message]} {
            set said $message
            $win.said configure -foreground [::sorma::style colour refused]
        }
        event generate $win <<SormaShown>>
    }
    method Taken reply {
        set bytes [if {[dict exists $reply any]} {dict get $reply any}]
        lassign [if {[dict exists $reply floats]} {dict get $reply floats}] - width height
        if {$height ne {} && [string length $bytes] == 3 * $width * $height} {
            set bytes "P6\n[expr {int($width)}] [expr {int($height)}]\n255\n$bytes"
        }
        $self show $bytes
        $self See "Paint with the left button where you are sure; the border between two things need not be exact."
    }
    method Trained - {
        if {$toLearn eq {}} {
            return [$self Ask $table "making its table" {CTRL -learn} Learned]
        }
        set toLearn [lassign $toLearn next]
        lassign $next dimensions rgb painted
        $self Ask $table "learning" [Request train $dimensions $rgb$painted] Trained
    }
    method Learned reply {
        $self See "Learned: [dict get $reply text]. Paint what is still wrong, or take another picture."
    }
    method See next {
        $self Ask $table "classifying" [Request classify $size $pixels] [list Seen $next]
    }
    method Seen {next reply} {
        set shown [list]
        dict for {n item} $Colours {
            scan [lindex $item 1] "#%2x%2x%2x" r g b
            lappend shown [format %c $n] [format %c%c%c $r $g $b]
        }
        $seen blank
        set flat [::image create photo -format ppm -data "P6\n$size\n255\n[string map $shown [dict get $reply any]]"]
        $seen copy $flat -zoom [Factor]
        ::image delete $flat
        set said $next
    }
    method Saved - {
        set said "Saved as $options(-file)."
    }

    # ---- the brush ----

    method SetBrush {option value} {
        if {![string is integer -strict $value] || $value < 1 || $value > 100} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "-brush expects a radius from 1 to 100 pixels, got \"$value\""
        }
        set options($option) $value
    }
    method Wider step {
        set options(-brush) [expr {max(1, min(100, $options(-brush) + $step))}]
        if {$over ne {}} {
            $self Over {*}$over
        }
    }
    method Choose n {
        set colour $n
    }
    method Begin {x y} {
        focus $left
        $self Stroke {*}[$self Pixel $x $y]
    }
    method Move {x y} {
        $self Line {*}[$self Pixel $x $y]
        $self Over $x $y
    }
    # Where the brush would paint.
    method Over {x y} {
        set over [list $x $y]
        set r [expr {$options(-brush) * [Factor]}]
        $left delete brush
        $left create oval [expr {$x - $r}] [expr {$y - $r}] [expr {$x + $r}] [expr {$y + $r}] -outline white -tags brush
    }
    method Pixel {x y} {
        return [list [expr {int([$left canvasx $x]) / [Factor]}] [expr {int([$left canvasy $y]) / [Factor]}]]
    }
    method Stroke {x y} {
        set before [lrange [linsert $before end $labels] end-99 end]
        set last [list $x $y]
        $self Line $x $y
    }
    # From the pixel where the brush was to this one.
    method Line {x y} {
        lassign $last x1 y1
        set r $options(-brush)
        set steps [expr {max(1, int(ceil(max(abs($x - $x1), abs($y - $y1)) / (0.5 * $r))))}]
        for {set i 0} {$i <= $steps} {incr i} {
            $self Stamp [expr {$x1 + ($x - $x1) * $i / $steps}] [expr {$y1 + ($y - $y1) * $i / $steps}]
        }
        set last [list $x $y]
        $self Draw [expr {min($y, $y1) - $r}] [expr {max($y, $y1) + $r + 1}]
    }
    method Stamp {x y} {
        set r $options(-brush)
        lassign $size width height
        for {set row [expr {max(0, $y - $r)}]} {$row <= min($height - 1, $y + $r)} {incr row} {
            set half [expr {int(sqrt($r ** 2 - ($row - $y) ** 2))}]
            set from [expr {max(0, $x - $half)}]
            set to [expr {min($width - 1, $x + $half)}]
            if {$from <= $to} {
                lset labels $row [string replace [lindex $labels $row] $from $to [string repeat [format %c $colour] [expr {$to - $from + 1}]]]
            }
        }
    }

    # ---- drawing ----

    proc Factor {} {
        return [expr {max(1, round([::sorma::style pixels 100] / 100.0))}]
    }
    # Rows of the picture; of what is painted every second one shows its colour, so that the picture is still seen.
    method Draw {from to} {
        lassign $size width height
        set from [expr {max(0, $from)}]
        set to [expr {min($height, $to)}]
        if {$from >= $to} return
        set f [Factor]
        $photo copy $base -from 0 $from $width $to -to 0 [expr {$from * $f}] -zoom $f
        for {set row [expr {$from + ($from & 1)}]} {$row < $to} {incr row 2} {
            set line [lindex $labels $row]
            foreach span [regexp -all -inline -indices {\u0000+|\u0001+|\u0002+|\u0003+} $line] {
                lassign $span first end
                scan [string index $line $first] %c n
                $photo put [lindex [dict get $Colours $n] 1] -to [expr {$first * $f}] [expr {$row * $f}] [expr {($end + 1) * $f}] [expr {($row + 1) * $f}]
            }
        }
    }
}
