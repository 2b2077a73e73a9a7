# mutants.tcl -- do the suites notice when generic/ is changed? See `make mutants` in CONTRIBUTING.md.
#
# mutants.tcl SOURCE BUILD FOLDER ?-n 40? ?-seed 1? ?-files PATTERNS? ?-suites NAMES? ?-line PATTERN? ?-jobs 1?
#
# FOLDER becomes a copy of SOURCE. Its own build/ is configured as BUILD is, but to be quick: -O1 at most, ccache where there is one, no
# pictures. A mutant is one change in this copy: another operator, a condition that is negated, or a statement that is left out.
# The suites that concern the file run first, and then the others, until one fails. The file tests/mutants.list names the suites for each
# file, and the mutants that may live. Without -suites it is those of the list that run, for "all" every one.
# Only mutants are made whose line, as it is printed, fits -line, a pattern of `string match`: so one that lived is tried again.
# A mutant is not counted when it does not compile or gives the same object. -jobs is for make; suites run one after the other.
# Exit code 1: another one lives. The same seed gives the same mutants of the same sources.

namespace eval mutants {
    # Operators between spaces, and their replacements.
    variable operators {
        == != != == < <= <= < > >= >= > && || || && + - - + * / / * % * & | | & ^ & << >> >> << += -= -= += |= &= &= |=
    }
    variable slack 5        ;# a suite may take so many times as long as without a mutant,
    variable least 20       ;# and at least so many seconds
    variable jobs 1         ;# of make
    variable compiled {}    ;# dict of file to what its objects hold without a mutant
}

# ---- places in a text: no files, no processes ----

# A text of C++ with blanks for all characters of comments, strings and lines of the preprocessor. Lines and columns stay; so do quotes.
proc mutants::masked text {
    set out {}
    set from 0
    set start {\n[ \t]*#|//|/\*|\m(?:u8|[uUL])?R"|["']|\m[0-9](?:'?[\w.])*}
    set text "\n$text"
    while {[regexp -indices -start $from $start $text found]} {
        lassign $found first last
        set end [endOfToken $text $first $last]
        append out [string range $text $from $first-1] [blank [string range $text $first $end]]
        set from [expr {$end + 1}]
    }
    append out [string range $text $from end]
    return [string range $out 1 end]
}
proc mutants::blank token {
    set inside [regsub -all {[^\n]} $token { }]
    if {[regexp {^[0-9]|^.$} $token]} {
        return $token
    } elseif {[regexp {^(?:u8|[uUL])?R?(["'])} $token -> quote]} {
        return $quote[string range $inside 1 end-1]$quote
    }
    return $inside
}
# The index of the last character of the token that begins at FIRST, and whose first part ends at LAST.
proc mutants::endOfToken {text first last} {
    set begin [string trimleft [string range $text $first $last] "\n\t "]
    switch -glob -- $begin {
        "#" { set pattern {\A(?:\\\n|[^\n])*} }
        "//" { set pattern {\A[^\n]*} }
        "/\\*" { return [endOf $text [string first */ $text $last+1] 1] }
        "*R\"" {
            regexp -start $last+1 {\A[^(]*} $text delimiter
            return [endOf $text [string first ")$delimiter\"" $text $last] [expr {[string length $delimiter] + 1}]]
        }
        "\"" { set pattern {\A(?:\\.|[^\\"])*"} }
        "'" { set pattern {\A(?:\\.|[^\\'])*'} }
        default { return $last }
    }
    if {![regexp -indices -start [expr {$last + 1}] $pattern $text rest]} {
        return $last
    }
    return [lindex $rest 1]
}
proc mutants::endOf {text at more} {
    return [expr {$at < 0 ? [string length $text] - 1 : $at + $more}]
}

# All places of a text: a list of {KIND FIRST LAST NEW}, in the order of the text. FIRST to LAST are the characters that NEW replaces.
proc mutants::places text {
    set mask [masked $text]
    return [lsort -integer -index 1 [concat [operatorsIn $mask] [conditionsIn $text $mask] [statementsIn $mask]]]
}
proc mutants::operatorsIn mask {
    variable operators
    set found {}
    foreach {whole at} [regexp -all -indices -inline { ([-=!<>&|+*/%^]{1,2})(?= |\n)} $mask] {
        set old [string range $mask {*}$at]
        if {[dict exists $operators $old]} {
            lappend found [list operator {*}$at [dict get $operators $old]]
        }
    }
    foreach at [regexp -all -indices -inline {\m(?:true|false)\M} $mask] {
        lappend found [list operator {*}$at [expr {[string range $mask {*}$at] eq "true" ? "false" : "true"}]]
    }
    foreach {whole at} [regexp -all -indices -inline {(?:\w|[ ()])(\+\+|--)(?=[\w); ])} $mask] {
        lappend found [list operator {*}$at [expr {[string range $mask {*}$at] eq "++" ? "--" : "++"}]]
    }
    return $found
}
# The condition of each `if` and `while`, negated. An initializer before a semicolon stays.
proc mutants::conditionsIn {text mask} {
    set found {}
    foreach at [regexp -all -indices -inline {\m(?:if|while) \(} $mask] {
        set first [expr {[lindex $at 1] + 1}]
        set last [closing $mask $first]
        set semicolon [string last \; $mask $last]
        if {$semicolon > $first} {
            set first [expr {$semicolon + 2}]
        }
        if {$last >= $first} {
            lappend found [list condition $first $last "!([string range $text $first $last])"]
        }
    }
    return $found
}
# The last character inside of a parenthesis, whose first one is at FROM; less than FROM when nothing closes it.
proc mutants::closing {mask from} {
    set depth 1
    set at $from
    while {[regexp -indices -start $at {[()]} $mask found]} {
        set at [lindex $found 0]
        incr depth [expr {[string index $mask $at] eq "(" ? 1 : -1}]
        if {$depth == 0} {
            return [expr {$at - 1}]
        }
        incr at
    }
    return -1
}
# Statements that fill a line: calls, assignments, throw, break, continue and a return of nothing.
proc mutants::statementsIn mask {
    set found {}
    set at 0
    set before \{
    foreach line [split $mask \n] {
        set statement [string trim $line]
        if {$before in {; \{ \} ) : else} && [isStatement $statement]} {
            set first [expr {$at + [string first $statement $line]}]
            lappend found [list statement $first [expr {$first + [string length $statement] - 1}] \;]
        }
        if {$statement ne {}} {
            set before [expr {[regexp {\melse$} $statement] ? "else" : [string index $statement end]}]
        }
        incr at [expr {[string length $line] + 1}]
    }
    return $found
}
proc mutants::isStatement line {
    set call {[\w:.>\[\]*-]+\(.*\)}
    set assignment {[\w:.>\[\]*-]+(?:\([^()]*\))? [-+|&]?= .*}
    return [expr {[regexp "^(?:$call|$assignment|(?:\\+\\+|--)\[\\w.>-\]+|throw .*|break|continue|return);\$" $line]
        && [regexp -all {[(]} $line] == [regexp -all {[)]} $line]
        && ![regexp {^static_assert|^(?:if|for|while|switch|return)\M.+\)} $line]}]
}

# The number of a character's line, and that line as it is with a change.
proc mutants::lineAt {text at} {
    return [expr {[regexp -all \n [string range $text 0 $at-1]] + 1}]
}
proc mutants::changed {text place} {
    lassign $place kind first last new
    return [string replace $text $first $last $new]
}
# A mutant's name within its file: the changed line, or the statement that is left out.
proc mutants::changedLine {text place} {
    lassign $place kind first last
    if {$kind eq "statement"} {
        return "without [string range $text $first $last]"
    }
    return [string trim [lindex [split [changed $text $place] \n] [lineAt $text $first]-1]]
}

# A list in an order that only a seed decides.
proc mutants::shuffled {list seed} {
    set state [expr {($seed * 2654435761 + 12345) % 2147483647}]
    for {set i [expr {[llength $list] - 1}]} {$i > 0} {incr i -1} {
        set state [expr {(($state ? $state : 1) * 48271) % 2147483647}]
        set j [expr {$state % ($i + 1)}]
        set item [lindex $list $i]
        lset list $i [lindex $list $j]
        lset list $j $item
    }
    return $list
}

# tests/mutants.list: {suites PATTERN-NAMES may FILE-LINES}. `suites PATTERN NAME ...` in a line; `may FILE`, the changed line and the reason
# stand in three lines.
proc mutants::readList text {
    set suites {}
    set may {}
    set lines [lsearch -all -inline -not -regexp [split $text \n] {^\s*(#.*)?$}]
    while {$lines ne {}} {
        set lines [lassign $lines line]
        if {[regexp {^suites (\S+) (\S.*)$} $line -> pattern names]} {
            lappend suites $pattern [split $names]
        } elseif {[regexp {^may (\S+)$} $line -> file] && [regexp {^\s+\S} [lindex $lines 0]] && [regexp {^\s+because \S} [lindex $lines 1]]} {
            dict set may [list $file [string trim [lindex $lines 0]]] [string trim [lindex $lines 1]]
            set lines [lrange $lines 2 end]
        } else {
            error "tests/mutants.list: expected \"suites PATTERN NAME ...\" or \"may FILE\" with two lines that are indented: the changed one\
                and \"because REASON\", got \"$line\""
        }
    }
    return [dict create suites $suites may $may]
}
# All suites: the one with the file's name, those that the list has for it, and the others, the quickest first. TIMES: dict of suite to seconds.
proc mutants::order {file times suites} {
    set names [list [file rootname [file tail $file]]]
    foreach {pattern more} $suites {
        if {[string match $pattern $file]} {
            lappend names {*}$more
        }
    }
    lappend names {*}[lmap {name seconds} [lsort -stride 2 -index 1 -real $times] {set name}]
    set ordered {}
    foreach name $names {
        if {[dict exists $times $name] && $name ni $ordered} {
            lappend ordered $name
        }
    }
    return $ordered
}

# ---- files ----

proc mutants::read file {
    set f [open $file]
    fconfigure $f -encoding utf-8 -translation lf
    try {
        return [::read $f]
    } finally {
        close $f
    }
}
proc mutants::write {file text} {
    set f [open $file w]
    fconfigure $f -encoding utf-8 -translation lf
    puts -nonewline $f $text
    close $f
}
# Makes TO the same as FROM, without build folders. A file that differed gets the present time, so that make sees it.
proc mutants::mirror {from to} {
    file mkdir $to
    set names [glob -nocomplain -tails -directory $from * .clang-format]
    foreach extra [glob -nocomplain -tails -directory $to *] {
        if {$extra ni $names && ![file exists [file join $to $extra config.status]]} {
            file delete -force [file join $to $extra]
        }
    }
    foreach name $names {
        set source [file join $from $name]
        set target [file join $to $name]
        if {[file isdirectory $source] && [file type $source] ne "link"} {
            if {![file exists [file join $source config.status]] && $name ne "autom4te.cache"} {
                mirror $source $target
            }
        } elseif {![file exists $target]} {
            file copy $source $target
        } elseif {[catch {exec cmp -s $source $target}]} {
            file copy -force $source $target
            file mtime $target [clock seconds]
        }
    }
}
proc mutants::allPlaces {top patterns} {
    set all {}
    foreach file [lsort -unique [glob -nocomplain -tails -directory $top -- {*}$patterns]] {
        set text [read [file join $top $file]]
        foreach place [places $text] {
            lappend all [list $file $place [changedLine $text $place]]
        }
    }
    if {$all eq {}} {
        error "no place to change in \"$patterns\": expected patterns of files in $top, as \"generic/bus/*.cpp\""
    }
    return $all
}

# ---- builds and runs ----

# 1 when a command ends well within so many seconds. Output and errors go to outputVar.
proc mutants::run {seconds outputVar args} {
    upvar 1 $outputVar output
    # A mutant may ask for memory without end.
    set failed [catch {exec -ignorestderr timeout -k 10 $seconds sh -c {ulimit -v 16000000; exec "$@" 2>&1} sh {*}$args < /dev/null} output]
    return [expr {!$failed}]
}
# Makes a target. Pictures of the manual are left out: they take longer than all the rest.
proc mutants::build {folder target outputVar} {
    upvar 1 $outputVar output
    variable jobs
    # Words of a make around this one, such as -n, are not for this one.
    return [run 3600 output env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -C $folder/build -j$jobs --no-print-directory PICTURES=no $target]
}
# The target that a change of a file needs: a shared library is enough, but for what others include or link statically.
proc mutants::targetOf file {
    switch -glob -- $file {
        generic/comm/*.cpp { return libsorma.la }
        generic/tcl/*.cpp - generic/edit/*.cpp - generic/web/*.cpp { return build-modules }
    }
    return build-code
}
# The bytes of a file's objects. Empty for a header.
proc mutants::objects {folder file} {
    if {[file extension $file] eq ".h"} {
        return
    }
    set stem [file rootname [file tail $file]]
    return [lmap object [lsort [glob -nocomplain -directory $folder/build/[file dirname $file] "{.libs/,}{*-,}$stem.o"]] {
        stripped $object $folder/build/stripped.o
    }]
}
# The bytes of an object, but for those that debuggers need.
proc mutants::stripped {object copy} {
    exec strip -g -o $copy $object
    set f [open $copy rb]
    try {
        return [::read $f]
    } finally {
        close $f
    }
}
# Runs a suite, or only one test of it. Returns the first test that fails, or what ended the suite; empty: it passes.
proc mutants::trial {folder suite seconds {only *}} {
    if {[run [expr {$seconds + 60}] output env -u SORMA_REQUIRE "TCLTEST_OPTIONS=-match $only" $folder/build/env [info nameofexecutable]\
            $folder/tests/all.tcl -jobs 1 -bound $seconds $suite]} {
        return
    } elseif {[regexp {still running after} $output]} {
        return "$suite: not done after $seconds s"
    } elseif {[regexp -line {^==== (\S+) .*FAILED$} $output -> test]} {
        return $test
    } elseif {[regexp -line "^==== $suite: (.*)\$" $output -> why]} {
        return "$suite: $why"
    }
    return "$suite: it failed"
}
proc mutants::limit seconds {
    variable slack
    variable least
    return [expr {max($least, int(ceil($seconds * $slack)))}]
}
# The suites that pass without a mutant: dict of suite to seconds. One that fails runs once more, since the machine may be busy.
proc mutants::baseline {folder suites} {
    set times {}
    foreach suite $suites {
        foreach next {"it runs once more" "it is left out"} {
            set begin [clock milliseconds]
            set why [trial $folder $suite 600]
            if {$why eq {}} {
                dict set times $suite [expr {([clock milliseconds] - $begin) / 1000.0}]
                report "without a mutant: $suite, [format %.0f [dict get $times $suite]] s"
                break
            }
            report "fails without a mutant: $suite ($why): $next"
        }
    }
    return $times
}
# The test that notices; empty: none does. A test that fails runs a second time: chance is not noticing. When it passes alone, all run again.
proc mutants::noticed {folder file times suites} {
    foreach suite [order $file $times $suites] {
        set seconds [limit [dict get $times $suite]]
        set why [trial $folder $suite $seconds]
        if {$why eq {}} continue
        if {[string match "*not done after*" $why] || (![string match "$suite: *" $why] && [trial $folder $suite $seconds $why] ne {})
                || [trial $folder $suite $seconds] ne {}} {
            return $why
        }
    }
}
# One mutant from its change to its end: noticed, lives, permitted, broken (it does not compile) or same (its object is), and what noticed it.
proc mutants::judge {folder file place times known} {
    variable compiled
    set path [file join $folder $file]
    set original [read $path]
    if {![dict exists $compiled $file]} {
        dict set compiled $file [objects $folder $file]
    }
    try {
        write $path [changed $original $place]
        if {![build $folder [targetOf $file] output]} {
            return broken
        } elseif {[dict get $compiled $file] ne {} && [objects $folder $file] eq [dict get $compiled $file]} {
            return same
        }
        set why [noticed $folder $file $times [dict get $known suites]]
    } finally {
        write $path $original
    }
    set key [list $file [changedLine $original $place]]
    return [expr {$why ne {} ? [list noticed $why] : [dict exists $known may $key] ? [list permitted [dict get $known may $key]] : "lives"}]
}
proc mutants::prepare {built folder} {
    file mkdir $folder/build
    if {![file exists $folder/build/config.status]} {
        report "configuring as $built is"
        set script {
            cd "$1/build"
            words=$("$2/config.status" --config)
            value() { sed -n "s/^S\[\"$2\"\]=\"\(.*\)\"\$/\1/p" "$1/config.status"; }
            cxx=$(value "$2" CXX)
            case $cxx in *ccache*) ;; *) ! command -v ccache > /dev/null || words="$words CXX='ccache $cxx'" ;; esac
            case $(value "$2" CXXFLAGS) in *-O[01]*) ;; *) words="$words CXXFLAGS=-O1 CFLAGS=-O1" ;; esac
            eval "../configure --quiet $words"
        }
        if {![run 600 output sh -c $script sh $folder $built]} {
            error "configure failed:\n$output"
        }
    }
    report "building without a mutant"
    if {![build $folder all output] || ![build $folder build-code output]} {
        error "the sources do not compile without a mutant:\n[string range $output end-2000 end]"
    }
}
# One line for each file, and their sum. COUNTS: dict of file to dict of verdict to number.
proc mutants::table counts {
    set verdicts {noticed permitted lives same broken}
    set lines [list [format "%-36s%10s%10s%10s%10s%10s" file {*}$verdicts]]
    set sum {}
    dict for {file count} $counts {
        dict for {verdict n} $count {
            dict incr sum $verdict $n
        }
    }
    foreach {file count} [list {*}[lsort -stride 2 $counts] all $sum] {
        lappend lines [format "%-36s%10d%10d%10d%10d%10d" $file {*}[lmap verdict $verdicts {
            expr {[dict exists $count $verdict] ? [dict get $count $verdict] : 0}
        }]]
    }
    return [join $lines \n]
}
# A dict of all options, checked.
proc mutants::options words {
    set given {-n 40 -seed 1 -files generic/*/*.cpp -suites {} -line * -jobs 1}
    foreach {word value} $words {
        if {![dict exists $given $word]} {
            error "unknown option \"$word\": expected [join [dict keys $given] {, }]"
        } elseif {$word in {-n -seed -jobs} && (![string is wideinteger -strict $value] || $value < ($word eq "-jobs"))} {
            error "$word expects a whole number of [expr {$word eq "-jobs"}] or more, got \"$value\""
        }
        dict set given $word $value
    }
    return $given
}
# The suites that run: the wanted ones, or else those of the list for these files. "all": each that runs anything of generic/.
proc mutants::suitesOf {source wanted files known} {
    set there [lmap suite [lsort [glob -tails -directory $source/tests *.test]] {file rootname $suite}]
    if {$wanted eq "all"} {
        return [lsearch -all -inline -not -regexp $there {^(doc|format|html|install|manual|mutants|readme|tidy|tutorials)$}]
    }
    foreach suite $wanted {
        if {$suite ni $there} {
            error "no suite \"$suite\"; there are: $there"
        }
    }
    if {$wanted ne {}} {
        return $wanted
    }
    set there [dict merge {*}[lmap suite $there {list $suite 1}]]
    set listed {}
    foreach file $files {
        foreach {pattern names} [dict get $known suites] {
            if {[string match $pattern $file]} {
                lappend listed {*}$names
            }
        }
        lappend listed [file rootname [file tail $file]]
    }
    return [lmap suite [lsort -unique $listed] {expr {[dict exists $there $suite] ? $suite : [continue]}}]
}
proc mutants::report line {
    puts $line
    flush stdout
}
proc mutants::main {source built folder args} {
    variable jobs
    set given [options $args]
    set jobs [dict get $given -jobs]
    mirror $source $folder      ;# SOURCE may change meanwhile
    set queue [shuffled [allPlaces $folder [dict get $given -files]] [dict get $given -seed]]
    set queue [lsearch -all -inline -index 2 $queue [dict get $given -line]]
    set known [readList [read $folder/tests/mutants.list]]
    set suites [suitesOf $folder [dict get $given -suites] [lsort -unique [lmap item $queue {lindex $item 0}]] $known]
    report "[llength $queue] places in [dict get $given -files], seed [dict get $given -seed], suites $suites"
    prepare $built $folder
    set times [baseline $folder $suites]
    if {$times eq {}} {
        error "no suite passes without a mutant: mend these first"
    }
    set counts {}
    set alive 0
    for {set number 1} {$number <= [dict get $given -n] && $queue ne {}} {} {
        set queue [lassign $queue item]
        lassign $item file place line
        set text [read $folder/$file]
        report "$number of [dict get $given -n]. $file:[lineAt $text [lindex $place 1]], [lindex $place 0]: $line"
        set begin [clock seconds]
        lassign [judge $folder $file $place $times $known] verdict why
        report "    $verdict[expr {$why eq {} ? {} : ", $why"}] ([expr {[clock seconds] - $begin}] s)"
        dict set counts $file [dict merge {noticed 0} [expr {[dict exists $counts $file] ? [dict get $counts $file] : {}}]]
        dict update counts $file count {
            dict incr count $verdict
        }
        incr number [expr {$verdict ni {broken same}}]
        incr alive [expr {$verdict eq "lives"}]
    }
    puts \n[table $counts]
    return $alive
}

if {[info exists argv0] && [file tail $argv0] eq "mutants.tcl"} {
    if {$argc < 3 || $argc % 2 == 0} {
        puts stderr "usage: mutants.tcl SOURCE BUILD FOLDER ?-n NUMBER? ?-seed NUMBER? ?-files PATTERNS? ?-suites NAMES? ?-line PATTERN? ?-jobs NUMBER?"
        exit 2
    }
    if {[catch {mutants::main {*}$argv} alive]} {
        puts stderr $alive
        exit 2
    }
    exit [expr {$alive > 0}]
}
