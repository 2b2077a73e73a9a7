# replay.tcl -- the program sorma-replay: a recording of sorma-record: read, searched, exported, done again.

package require csv
package require sorma
package require sorma::commandLine
package require sorma::line
package require sorma::mcap
package require sorma::moment
package require sorma::recorded
package require sorma::recording
package require sorma::replaySuite
package require sorma::text
package provide sorma::replay 1.0

namespace eval ::sorma::replay {
    variable Options {-list flag -typed flag -about flag -window flag -play flag -csv {{word {the name of a folder}}} -values {{word {the name of an object}}} -mcap {{word {the name of a file}}}
        -as-test {{word {the name of a file}}} -start any -tolerance any -at rest -search any -name {any *} -failed flag -slower {{seconds 0 1000000000}} -from any -until any
        -daemon any -rename words -speed {{number 0 1000} 1}}
    variable Ways {-list -typed -about -window -csv -values -mcap -play -as-test -at}       ;# what to do with it
    variable Searched {-search -name -failed -slower -from -until}                          ;# which records
    variable Belongs {-start -as-test -tolerance -as-test -daemon -play -rename -play -speed -play}    ;# options of one way alone
    variable Turn           ;# set when it has waited
    variable Second {}      ;# {SECONDS TEXT} that was formatted last
    variable Found 0        ;# records that a search has found
    variable Total {}       ;# records of the recording, while a person waits for files to be written
    variable Every 1000     ;# ms from one word of that to the next
    variable Told 0         ;# ms, of the last one
    variable Heads {
        requests.csv {time source object method caller request code seconds reply}
        events.csv {time source object event number content}
        losses.csv {time source records seconds reason}
        buffers.csv {time source key number content}
        notes.csv {time source note text}
    }
}

# ::sorma::replay::main WORDS -- run the program: the exit code.
proc ::sorma::replay::main words {
    variable Options
    return [::sorma::commandLine::run sorma-replay $Options $words ::sorma::replay::Run -check ::sorma::replay::Check \
        -complete [list ::sorma::recording::complete $Options -daemon]]
}
proc ::sorma::replay::Run {settings files} {
    lassign $files file
    ::sorma::create recorder.replay -file $file
    try {
        set about [lindex [recorder.replay EXEC about] 3]
        foreach damage [dict get $about damages] {
            puts stderr "sorma-replay: $file: $damage"
        }
        return [Do $settings $file $about]
    } trap {POSIX EPIPE} {} {
        # The reader of the output has ended, as head does.
        return 0
    } on error {message how} {
        return -options $how [::sorma::recording::plain $message]
    }
}
# What the options say. The exit code.
proc ::sorma::replay::Do {settings file about} {
    variable Found
    dict with settings {}
    if {${-window}} {
        return [Window $file]
    } elseif {${-at} ne {}} {
        puts [::sorma::text::clean [::sorma::at -recorder recorder.replay {*}${-at}]]
        return 0
    } elseif {${-about}} {
        About $about
        return 0
    }
    variable Told [clock milliseconds]
    variable Total [if {[::sorma::text::isTerminal stderr] && (${-csv} ne {} || ${-mcap} ne {})} {dict get $about records}]
    set search [Search $settings]
    set code 0
    if {${-csv} ne {}} {
        Export ${-csv} $search
    } elseif {${-values} ne {}} {
        Values ${-values} $search
    } elseif {${-mcap} ne {}} {
        set out [::sorma::mcap::begin ${-mcap}]
        Each record $search {
            ::sorma::mcap::add $out $record
        }
        ::sorma::mcap::finish $out
    } elseif {${-play}} {
        Warn [expr {[dict get $about last] - [dict get $about first]}] ${-speed}
        set code [Play $settings $search]
    } elseif {${-as-test} ne {}} {
        set steps {}
        EachStep step $search {
            lappend steps $step
        }
        lassign [::sorma::replaySuite::make $file ${-as-test} $steps ${-start} ${-tolerance}] tests open
        puts "${-as-test}: [::sorma::text::counted $tests test tests], [::sorma::text::counted $open leaves leave] something open"
    } else {
        Each record $search {
            puts [if {${-typed}} {Typed $record} else {Line $record}]
        }
    }
    # Only to a person: to a program an empty answer is one.
    if {$Found == 0 && [::sorma::text::isTerminal stderr]} {
        puts stderr "sorma-replay: no record fits; the recording has [Extent $about]"
    } elseif {$Total ne {}} {
        puts stderr "sorma-replay: $Found of $Total records"
    }
    return $code
}

# Errors of the command line.
proc ::sorma::replay::Check {settings files} {
    variable Options
    set usual [::sorma::options::defaults $Options]
    dict with settings {}
    if {[llength $files] != 1} {
        error "expected the name of one recording, got [llength $files]"
    }
    foreach option {-mcap -as-test} {
        if {[file normalize [dict get $settings $option]] eq [file normalize [lindex $files 0]]} {
            error "$option would replace the recording itself"
        }
    }
    if {[llength ${-rename}] % 2} {
        error "-rename expects names in pairs, old and new, got [llength ${-rename}]"
    }
    if {[catch {dict size ${-start}}]} {
        error "-start expects a list of daemons, and words for each of them, got \"${-start}\""
    }
    if {![string is list ${-tolerance}] || [llength ${-tolerance}] % 2 || [lsearch -not -regexp [dict values ${-tolerance}] {^(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$}] >= 0} {
        error "-tolerance expects units, and for each how far its numbers may be off, as \"V 0.01 relative 1e-4\", got \"${-tolerance}\""
    }
    if {${-at} ne {}} {
        if {[llength ${-at}] < 2} {
            error "-at expects a time and a request, as -at 12:03 foo.a cget -tempo, got \"[lindex ${-at} 0]\""
        }
        ::sorma::moment::parse -at [lindex ${-at} 0]
    }
    set search [Search $settings]
    if {${-from} ne {} && ${-until} ne {} && [dict get $search -from] > [dict get $search -until]} {
        error "-from ${-from} is later than -until ${-until}, so no record is between them"
    }
    variable Ways
    variable Searched
    variable Belongs
    set given [dict keys [dict filter $usual script {option value} {expr {$value ne [dict get $settings $option]}}]]
    set ways [lmap way $Ways {if {$way ni $given} continue; set way}]
    if {[llength $ways] > 1} {
        error "expected one of [join $Ways {, }], got [join $ways { and }]"
    }
    foreach {option way} $Belongs {
        if {$option in $given && $ways ne [list $way]} {
            error "$option has an effect with $way alone"
        }
    }
    foreach option $Searched {
        if {$option in $given && $ways in {-about -at -window}} {
            error "$option has no effect with $ways, which takes no options of a search"
        }
    }
}

# The words of `records` for the options of a search.
proc ::sorma::replay::Search settings {
    dict with settings {}
    # The bus tells of options of all objects.
    set words [list -name [expr {${-values} eq {} ? ${-name} : {sorm}}]]
    foreach {option value} [list -text ${-search} -slower ${-slower}] {
        if {$value ne {}} {
            lappend words $option $value
        }
    }
    foreach option {-from -until} {
        if {[dict get $settings $option] ne {}} {
            lappend words $option [::sorma::moment::parse $option [dict get $settings $option]]
        }
    }
    return [expr {${-failed} ? [list {*}$words -failed] : $words}]
}

# Run a script for each record that a search finds.
proc ::sorma::replay::Each {recordVar search script} {
    variable Found
    upvar 1 $recordVar record
    set stream [::sorma::stream [list recorder.replay EXEC records {*}$search]]
    try {
        while {[$stream next piece]} {
            incr Found [llength [dict get $piece text]]
            Progress
            foreach record [dict get $piece text] {
                uplevel 1 $script
            }
        }
    } finally {
        $stream close
    }
}

# Records that are printed are word enough. Behind \r, so that it has one line.
proc ::sorma::replay::Progress {} {
    variable Found
    variable Total
    variable Every
    variable Told
    if {$Total ne {} && [clock milliseconds] - $Told >= $Every} {
        set Told [clock milliseconds]
        puts -nonewline stderr "sorma-replay: $Found of $Total records\r"
    }
}

# Run a script for each request from outside that a search finds with its reply: a dict of source, object, time, request and reply.
proc ::sorma::replay::EachStep {stepVar search script} {
    upvar 1 $stepVar step
    set times {}
    # A reply stands behind its request in the file.
    Each record $search {
        set key [list [dict get $record source] [dict get $record number]]
        if {[dict get $record kind] eq "request" && [dict get $record code] == 0} {
            dict set times $key [dict get $record time]
        } elseif {[dict get $record kind] eq "reply" && [dict exists $times $key]} {
            set step [dict create source [dict get $record source] object [dict get $record object] time [dict get $times $key] \
                request [dict get $record request] reply [dict get $record text]]
            dict unset times $key
            uplevel 1 $script
        }
    }
}

# The time line, until its window is closed. The exit code.
proc ::sorma::replay::Window file {
    try {
        package require sorma::graphical
    } trap {TCL PACKAGE UNFOUND} message {
        puts stderr "sorma-replay: $message; Debian has windows in the package sorma-tk"
        return 1
    }
    set code [::sorma::graphical::display sorma-replay {} "there is no display to open a window on (%s); set DISPLAY, or leave -window out"]
    if {$code ne {}} {
        return $code
    }
    package require sorma::window
    wm withdraw .
    tkwait window [::sorma::window timeline $file]
    return 0
}

# ---- for people ----

# All digits: so it can be typed behind -at, -from and -until, and is that of the record.
proc ::sorma::replay::Clock seconds {
    variable Second
    regexp {^(-?\d+)(\.\d+)} $seconds -> whole fraction
    # Most records are of the same second as the one before, and this is most of the time that a line takes.
    if {[lindex $Second 0] ne $whole} {
        set Second [list $whole [clock format $whole -format {%Y-%m-%d %H:%M:%S}]]
    }
    return [lindex $Second 1]$fraction
}
proc ::sorma::replay::Took seconds {
    return [format {%.3f ms} [expr {1000.0 * $seconds}]]
}

# How far the clock of a host is ahead [s], and the largest error of that [ns].
proc ::sorma::replay::Ahead {seconds bound} {
    return "its clock is $seconds s ahead, to [format %.6f [expr {$bound / 1e9}]] s"
}

# A record in one line, without control characters.
proc ::sorma::replay::Line record {
    dict with record {}
    switch $kind {
        request { set what "$text  ($word)" }
        reply { set what "$text  ([Took $span][expr {[dict exists $record request] ? {} : {, its request is not here}}])" }
        sample { set what "$object record $number $text" }
        event { set what "$object $word $text" }
        loss { set what "$number records are missing here, of [format %.3f $span] s: $word" }
        source { set what [Ahead $span $number] }
        default { set what "$word: $text" }
    }
    return [::sorma::text::clean "[Clock $time] $source $kind $what"]
}

# As it can be typed at a prompt. What is no request is a comment.
proc ::sorma::replay::Typed record {
    if {[dict get $record kind] eq "request"} {
        return [::sorma::text::clean [dict get $record text]]
    }
    return "# [Line $record]"
}

proc ::sorma::replay::About about {
    puts "began   [Clock [dict get $about began]]"
    puts "records [Extent $about]"
    puts "bytes   [dict get $about bytes][expr {[dict get $about closed] ? {} : {; it was not closed}}]"
    foreach name [dict get $about names] {
        puts "name    [::sorma::text::clean $name]"
    }
    if {[dict get $about names] eq {} && ![dict get $about closed]} {
        puts "names   are not listed, because it was not closed"
    }
}
proc ::sorma::replay::Extent about {
    return "[dict get $about records][expr {[dict get $about records] > 0 ? ", from [Clock [dict get $about first]] to [Clock [dict get $about last]]" : {}}]"
}

# ---- tables ----

proc ::sorma::replay::Export {folder search} {
    variable Heads
    file mkdir $folder
    set channels {}
    try {
        dict for {file head} $Heads {
            set channel [open [file join $folder $file] w 0600]
            fconfigure $channel -encoding utf-8
            dict set channels $file $channel
            puts $channel [::csv::join $head]
        }
        set callers {}          ;# dict: source and number of a request -> who has sent it
        Each record $search {
            dict with record {}
            switch $kind {
                request { dict set callers [list $source $number] $word }
                reply {
                    set word [if {[dict exists $callers [list $source $number]]} {dict get $callers [list $source $number]}]
                    dict unset callers [list $source $number]
                    set request [expr {[dict exists $record request] ? [dict get $record request] : {}}]
                    puts [dict get $channels requests.csv] [::csv::join [list $time $source $object $method $word $request $code $span $text]]
                }
                event { puts [dict get $channels events.csv] [::csv::join [list $time $source $object $word $number $text]] }
                sample { puts [dict get $channels buffers.csv] [::csv::join [list $time $source $object $number $text]] }
                loss { puts [dict get $channels losses.csv] [::csv::join [list $time $source $number $span $word]] }
                note { puts [dict get $channels notes.csv] [::csv::join [list $time $source $word $text]] }
                source { puts [dict get $channels notes.csv] [::csv::join [list $time $source clock [Ahead $span $number]]] }
            }
        }
    } finally {
        foreach channel [dict values $channels] {
            close $channel
        }
    }
}

# One object's options as they have changed: a column for each, a line for each change. A value stays until it is told again.
# NAME@SOURCE: of that source alone.
proc ::sorma::replay::Values {name search} {
    lassign [split $name @] object only
    set columns {}
    Each record $search {
        if {$only ni [list {} [dict get $record source]]} continue
        set columns [dict merge $columns [dict map {option value} [Changed $record $object] {string cat {}}]]
    }
    if {$columns eq {}} {
        return -code error "the recording has no change of an option of $name; -about lists its names"
    }
    puts [::csv::join [list time source {*}[dict keys $columns]]]
    set known {}        ;# dict: source -> its columns
    Each record $search {
        set changed [Changed $record $object]
        set source [dict get $record source]
        if {$changed eq {} || $only ni [list {} $source]} continue
        dict set known $source [dict merge [expr {[dict exists $known $source] ? [dict get $known $source] : $columns}] $changed]
        puts [::sorma::text::clean [::csv::join [list [dict get $record time] $source {*}[dict values [dict get $known $source]]]]]
    }
}

# The options of an object that an event tells, with their values.
proc ::sorma::replay::Changed {record object} {
    set text [dict get $record text]
    if {[dict get $record kind] ne "event" || [dict get $record word] ne "object.changed" || ![string is list $text] || [lindex $text 1] ne $object} {
        return
    }
    return [lrange $text 3 end-1]
}

# ---- again ----

# A person who waits is told for how long.
proc ::sorma::replay::Warn {seconds speed} {
    variable Every
    if {$speed > 0 && 1000 * $seconds / $speed >= $Every && [::sorma::text::isTerminal stderr]} {
        puts stderr [format "sorma-replay: it may take %.0f s; -speed 0 does not wait" [expr {$seconds / $speed}]]
    }
}

# Do again what came from outside, one request after the other, and say where the reply is another one. The exit code.
proc ::sorma::replay::Play {settings search} {
    set begun {}
    set different 0
    set done 0
    EachStep step $search {
        dict with step {}
        if {[::sorma::recorded::isOfBus $request]} continue
        Pace $time [dict get $settings -speed] begun
        incr done
        set answer [Again $request $source $settings]
        set words [::sorma::recorded::fields $answer]
        if {$words ne [::sorma::recorded::fields $reply]} {
            # Where no daemon is, all other requests would say the same.
            if {[lindex $words end] in {{ADDRESS UNRESOLVED} {COMM REFUSED}}} {
                error [lindex $answer end 2]
            }
            incr different
            puts [::sorma::text::clean "different: $request"]
            puts [::sorma::text::clean "    then: $reply"]
            puts [::sorma::text::clean "    now:  $answer"]
        }
    }
    puts "$done requests, $different with another reply"
    return [expr {$different > 0}]
}

# Wait until it is time for a request.
proc ::sorma::replay::Pace {time speed begunVar} {
    upvar 1 $begunVar begun
    if {$speed == 0} {
        return
    }
    set now [clock microseconds]
    if {$begun eq {}} {
        set begun [list $time $now]
    }
    lassign $begun first start
    set wait [expr {round(1000 * ($time - $first) / $speed - ($now - $start) / 1000.0)}]
    if {$wait > 0} {
        after $wait {set ::sorma::replay::Turn 1}
        vwait ::sorma::replay::Turn
    }
}

# Send a recorded request to the object that stands for the one of then. The answer as text.
proc ::sorma::replay::Again {request source settings} {
    lassign [::sorma::line::head $request] object
    set rest [string range $request [string length $object] end]
    set daemon [expr {[dict get $settings -daemon] ne {} ? [dict get $settings -daemon] : $source}]
    set names [dict get $settings -rename]
    if {[dict exists $names $object]} {
        set object [dict get $names $object]
    }
    if {[string first @ $object] < 0 && $daemon ne "here"} {
        append object @$daemon
    }
    return [::sorma::dispatch $object$rest]
}
