# execform.tcl -- sorma::execform, EXEC of any service object as a form: an entry for each part of its signature, and its reply.

package require sorma::message
package require sorma::parts
package require sorma::reply
package provide sorma::execform 1.0

# ::sorma::execform .w -name NAME ?-state normal|disabled? --
#       What the class reads, with names, units and lengths, filled in as in its example. A class that declares nothing has one entry for words
#       as they are typed behind EXEC.
# Methods:
#       execute; cancel, when it runs; running: does it; words: of the request; answer: what came of it last, ok and the reply, or error and a
#       message
# Event <<SormaReplied>> comes after each answer. Progress that a class publishes is shown while it runs.
snit::widget ::sorma::execform {
    ::sorma::parts -name 0
    ::sorma::runParts
    ::sorma::checkedOption -state normal SetState
    variable parts {}           ;# list: field least most, of each entry, in their order
    variable answer {}

    constructor args {
        set pad [::sorma::style pixels 8]
        ttk::frame $win.in
        ttk::button $win.go -text [::msgcat::mc Execute] -command [mymethod execute] -underline 0
        ttk::button $win.cancel -text [::msgcat::mc Cancel] -command [mymethod cancel] -state disabled
        ttk::label $win.lamp -width 2
        ttk::progressbar $win.part -maximum 1.0 -length [::sorma::style pixels 120]
        ttk::label $win.time -font [::sorma::style font small]
        ttk::frame $win.out
        text $win.reply -height 4 -width 40 -wrap word -state disabled -font [::sorma::style font fixed] -relief flat -borderwidth 0 \
            -highlightthickness 0 -takefocus 0 \
            -yscrollcommand [list ::sorma::parts::scrolled $win.bar]
        grid $win.in - - - - -sticky ew
        grid $win.go $win.cancel $win.lamp $win.part $win.time -sticky w -pady [list $pad 0]
        grid configure $win.cancel -padx $pad
        grid configure $win.part -padx [list 0 $pad]
        grid $win.out - - - - -sticky nsew -pady [list $pad 0]
        ::sorma::parts::withBar $win.out $win.reply $win.bar
        grid remove $win.out $win.part
        grid columnconfigure $win 4 -weight 1
        foreach part {go cancel} {
            bind $win.$part <Escape> [mymethod cancel]
        }
        $self configurelist $args
        $self Begin
    }
    method SetState {option value} {
        set options($option) $value
        $self Enable
    }
    # A request that runs can be cancelled, also where none can be begun.
    method Enable {} {
        $win.go state [expr {$options(-state) eq "normal" && $running eq {} ? "!disabled" : "disabled"}]
        $win.cancel state [expr {$running ne {} ? "!disabled" : "disabled"}]
    }
    method Build {} {
        set table [$subject table]
        destroy {*}[winfo children $win.in]
        set parts [lmap part [dict get $table reads] {lrange $part 0 2}]
        set rows [lmap part [dict get $table reads] {
            lassign $part field low high unit help
            set length [expr {$low eq $high ? $low : $high eq {} ? "$low or more" : "$low to $high"}]
            list $field [string trim [string cat [if {$field in {floats ints}} {string cat "$length "}] $unit]] [string cat $help [if {$field eq {any}} {string cat " (a file: its bytes are sent)"}]]
        }]
        if {[dict get $table words] ne {}} {
            lappend parts {words 0 {}}
            lappend rows [list words {} [dict get $table words]]
        } elseif {[dict get $table signature] eq {}} {
            lappend parts {words 0 {}}
            lappend rows [list request {} "words as they stand behind EXEC; the class does not say which it takes"]
        }
        set pad [::sorma::style pixels 8]
        set n 0
        foreach row $rows value [$self Example $table] {
            if {[incr n] > [llength $rows]} break
            lassign $row title length help
            if {$help ne {} && [string length $help] < 16 && $title in {floats ints text any}} {
                lassign [list $help {}] title help
            }
            ttk::label $win.in.title$n -text $title
            ttk::entry $win.in.entry$n
            ttk::label $win.in.length$n -text $length -style Unit.TLabel
            ttk::label $win.in.help$n -text $help -font [::sorma::style font small] -foreground [::sorma::style colour asking] \
                -wraplength [::sorma::style pixels 380] -justify left
            bind $win.in.entry$n <Return> [mymethod execute]
            bind $win.in.entry$n <Escape> [mymethod cancel]
            $win.in.entry$n insert 0 $value
            if {[lindex $row 0] eq "any"} {
                destroy $win.in.length$n
                ttk::button $win.in.length$n -text [::msgcat::mc "File \u2026"] -command [mymethod Browse $win.in.entry$n]
            }
            grid $win.in.title$n $win.in.entry$n -sticky ew -padx [list 0 $pad] -pady [list [expr {$n > 1 ? $pad / 2 : 0}] 0]
            if {[winfo class $win.in.length$n] ne "TLabel" || $length ne {}} {
                grid $win.in.length$n -row [dict get [grid info $win.in.entry$n] -row] -column 2 -sticky ew
            } else {
                grid configure $win.in.entry$n -columnspan 2 -padx 0
            }
            if {$help ne {}} {
                grid x $win.in.help$n - -sticky w
            }
        }
        grid columnconfigure $win.in 1 -weight 1
        bind $win.in <Configure> [mymethod Wrap]
        $self Wrap
    }
    # Help is as wide as there is room.
    method Wrap {} {
        set width [expr {[winfo width $win.in] - [lindex [grid bbox $win.in 1 0] 0]}]
        foreach child [winfo children $win.in] {
            if {[string match $win.in.help* $child] && $width > [::sorma::style pixels 100]} {
                $child configure -wraplength [expr {$width - [::sorma::style pixels 8]}]
            }
        }
    }
    method Show {} {
        $win.reply configure -background [ttk::style lookup . -background] -foreground [ttk::style lookup . -foreground]
    }

    # The example of the class, for each entry; there is none for other methods.
    method Example table {
        set words [if {[lindex [dict get $table example] 1] eq "EXEC"} {lrange [dict get $table example] 2 end}]
        set from [lsearch -regexp $words {^[TFIA]MSG$}]
        set from [expr {$from < 0 ? [llength $words] : $from}]
        if {[catch {::sorma::message::fromList [list RET 0 {*}[lrange $words $from end]]} said]} {
            set said {}
        }
        dict set said words [lrange $words 0 $from-1]
        set last {}
        set n 0
        foreach part $parts {
            dict set last [lindex $part 0] [incr n]
        }
        set n 0
        return [lmap part $parts {
            incr n
            lassign $part field low high
            set known [if {$field ne "any" && [dict exists $said $field]} {dict get $said $field}]
            if {$field in {floats ints} && [dict get $last $field] != $n} {
                dict set said $field [lrange $known $low end]
                set known [lrange $known 0 $low-1]
            }
            set known
        }]
    }

    # ---- what programs say ----

    method answer {} {
        return $answer
    }
    # The request: a list of EXEC, words, and parts.
    method words {} {
        set values {}
        set words {}
        set n 0
        foreach part $parts {
            set field [lindex $part 0]
            set text [$win.in.entry[incr n] get]
            if {$field eq "text"} {
                dict set values text $text
            } elseif {$field eq "any"} {
                dict set values any [if {$text ne {}} {$self Bytes $text}]
            } elseif {[catch {llength $text} length]} {
                return -code error -errorcode {SORMA REQUEST SYNTAX} "$field: expected a list, got \"$text\": $length"
            } elseif {$field eq "words"} {
                lappend words {*}$text
            } else {
                dict lappend values $field {*}$text
            }
        }
        dict for {field value} $values {
            if {$value eq {}} continue
            lappend words [dict get {floats FMSG ints IMSG text TMSG any AMSG} $field]
            if {$field in {floats ints}} {
                lappend words [llength $value] {*}$value
            } else {
                lappend words $value
            }
        }
        return [list EXEC {*}$words]
    }
    # The content of a file, as a request has it.
    method Bytes file {
        set channel [open $file rb]
        try {
            return [binary encode base64 [read $channel]]
        } finally {
            close $channel
        }
    }
    method execute {} {
        if {$options(-state) ne "normal" || $running ne {} || $subject eq {}} return
        if {[catch {$self words} words]} {
            set began [clock milliseconds]
            return [$self Ran error [list $words {}]]
        }
        $self Light sending
        $self Run $words
        $self Enable
    }
    method Browse entry {
        set file [tk_getOpenFile -parent $win]
        if {$file ne {}} {
            $entry delete 0 end
            $entry insert 0 $file
        }
    }
    # How long it takes already, and how far it is.
    method Runs {part text} {
        set seconds [expr {int([$self Seconds])}]
        $win.time configure -text [join [concat [if {$seconds > 0} {list "$seconds s"}] [if {$text ne {}} {list $text}]] ", "]
        if {$part ne {}} {
            $win.part configure -value $part
            grid $win.part
        }
    }
    method Ran {status value} {
        $self Enable
        grid remove $win.part
        if {$status eq "ok"} {
            $self Light [expr {[dict get $value code] > 0 ? "warn" : "good"}]
            set text [::sorma::show $value -as dict -colour 0 -width 0 -writes [dict get [$subject table] writes]]
            set answer [list ok $value]
        } else {
            $self Light refused
            set text [lindex $value 0]
            set answer [list error $text]
        }
        $win.time configure -text "[expr {[clock milliseconds] - $began}] ms"
        grid $win.out
        $win.reply configure -state normal
        $win.reply replace 1.0 end $text
        set lines [tcl::mathop::+ {*}[lmap line [split $text \n] {expr {1 + [string length $line] / 50}}]]
        $win.reply configure -state disabled -height [expr {min(12, $lines)}]
        event generate $win <<SormaReplied>>
    }
    method Light state {
        $win.lamp configure -text [::sorma::style mark $state] -foreground [::sorma::style colour $state]
    }
}
