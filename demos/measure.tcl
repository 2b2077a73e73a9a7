# measure.tcl -- a table of what is measured: each row has a name and a target, and the program's exit code says whether all were met.
#
#     proc figures given {
#         measure row "jumps of 0.1 m" -wanted "5 mm" -target {$off <= 0.005} -body {
#             set off [overshoot [dict get $given -count]]
#             format "%.1f mm" [expr {1e3 * $off}]
#         }
#     }
#     exit [measure run {-count {{whole 1 1000} 30}} {-count 2} $argv figures]
#
# README.md beside this file has the commands.

package require fileutil
package require sorma
package require sorma::await
package require sorma::json
package require sorma::options

namespace eval measure {
    namespace export run row missed tries until process renewed
    namespace ensemble create
    variable Rows {}            ;# dicts: name measured wanted met figures; met is empty where there is no target
    variable Headed 0           ;# the table has its heading
}

# measure run TABLE SHORT WORDS COMMAND -- a program that measures. TABLE has its options as sorma::options wants them, SHORT what -short
# makes of their defaults. The command gets the options' values as a dict. Returns the exit code: 0 when each row was met.
proc measure::run {table short words command} {
    set table [dict merge {-seed {{whole 0 {}} 1} -short flag -json any} $table]
    fconfigure stdout -buffering line
    set given [sorma::options::defaults $table]
    if {"-short" in $words} {
        set given [dict merge $given $short]
    }
    set given [sorma::options::take $table $given $words]
    expr {srand([dict get $given -seed])}
    puts "seed [dict get $given -seed]"
    set failed [expr {[catch {{*}$command $given} text how] == 1}]
    if {$failed} {
        puts stderr [dict get $how -errorinfo]
    }
    set missed [missed]
    if {[dict get $given -json] ne {}} {
        Json [dict get $given -json] [dict get $given -seed]
    }
    return [expr {$failed || $missed}]
}

# measure row NAME ?-body SCRIPT | -measured TEXT? ?-target EXPR? ?-wanted TEXT? ?-error PATTERN? -- a row: what was measured is the text, or
# the result of the script. Returns whether EXPR is true in the caller then; empty: there is no target. WANTED says it to people; default: EXPR.
#
# An error in the script misses the row, and goes on to the caller. With -error it does not: the error's code, without SORMA, must fit the pattern.
# An empty pattern expects no error.
proc measure::row {name args} {
    variable Rows
    variable Headed
    set row [dict merge {-measured {} -target {} -wanted {}} $args]
    set failed 0
    if {[dict exists $row -body]} {
        set failed [expr {[catch {uplevel 1 [dict get $row -body]} text how] == 1}]
        dict set row -measured $text
    }
    set met [expr {$failed ? 0 : {}}]
    if {[dict exists $row -error]} {
        set code [expr {$failed ? [lrange [dict get $how -errorcode] 1 end] : {}}]
        set met [expr {$failed == ([dict get $row -error] ne {}) && [string match [dict get $row -error] $code]}]
    }
    set figures {}
    if {!$failed && [dict get $row -target] ne {}} {
        set met [expr {$met ne 0 && [uplevel 1 [list expr [dict get $row -target]]]}]
        foreach {- figure} [regexp -all -inline {\$(\w+)\M(?!\()} [dict get $row -target]] {
            dict set figures $figure [uplevel 1 [list set $figure]]
        }
    }
    set wanted [expr {[dict get $row -wanted] ne {} ? [dict get $row -wanted] : [dict get $row -target]}]
    lappend Rows [dict create name $name measured [dict get $row -measured] wanted $wanted met $met figures $figures]
    if {!$Headed} {
        Print what measured target met
        set Headed 1
    }
    Print $name [dict get $row -measured] $wanted [dict get {{} {} 0 NO 1 yes} $met]
    if {$failed && ![dict exists $row -error]} {
        return -options $how $text
    }
    return $met
}

proc measure::Print args {
    puts [string trimright [format {%-40s %-44s %-36s %s} {*}$args]]
}

# measure missed -- say which rows have missed their target. Has any?
proc measure::missed {} {
    variable Rows
    set missed [lmap row $Rows {if {[dict get $row met] ne 0} continue; dict get $row name}]
    if {$Rows ne {}} {
        puts [expr {$missed eq {} ? "[llength $Rows] rows, all as they should be" : "missed: [join $missed {; }]"}]
    }
    return [expr {$missed ne {}}]
}

# measure tries N COMMAND ARGS... -- rows that other programs of this machine may spoil: they are measured again, up to N times. All tries
# are printed, the last one counts.
proc measure::tries {most args} {
    variable Rows
    set before $Rows
    for {set try 1} 1 {incr try} {
        uplevel 1 $args
        if {[lsearch -exact [lmap row [lrange $Rows [llength $before] end] {dict get $row met}] 0] < 0} {
            return
        }
        puts "    (try $try of $most has missed)"
        if {$try == $most} {
            return
        }
        set Rows $before
    }
}

# measure until EXPR ?-within SECONDS? ?-every MS? ?-else TEXT? -- let events come until EXPR is true in the caller, for 20 s at most. Then it fails
# with TEXT, in which variables of the caller are replaced.
proc measure::until {condition args} {
    set given [dict merge {-within 20 -every 20 -else {}} $args]
    set end [expr {[clock milliseconds] + 1000 * [dict get $given -within]}]
    while {![uplevel 1 [list expr $condition]]} {
        if {[clock milliseconds] >= $end} {
            return -code error -errorcode {MEASURE LATE} [expr {[dict get $given -else] eq {} ? "waited [dict get $given -within] s for $condition"
                : [uplevel 1 [list subst -nocommands [dict get $given -else]]]}]
        }
        sorma::await sleep [dict get $given -every]
    }
}

# measure process DAEMON -- its number, of a daemon of this host that answers; 0: there is none.
proc measure::process name {
    foreach daemon [sorma::daemons] {
        if {[dict get $daemon name] eq $name} {
            return [dict get $daemon process]
        }
    }
    return 0
}

# measure renewed DAEMON PROCESS ?SECONDS? -- is the daemon another process than that, in so many seconds?
proc measure::renewed {name process {seconds 20}} {
    return [expr {$process && ![catch {until {[process $name] ni [list 0 $process]} -within $seconds -every 50}]}]
}

proc measure::Json {file seed} {
    variable Rows
    set rows [lmap row $Rows {
        set figures [lmap {key value} [dict get $row figures] {string cat [sorma::json::text $key] : [sorma::json::value $value]}]
        string cat "\{" [join [list {*}[lmap key {name measured wanted} {string cat "\"$key\":" [sorma::json::text [dict get $row $key]]}] \
            "\"met\":[dict get {{} null 0 false 1 true} [dict get $row met]]" "\"figures\":\{[join $figures ,]\}"] ,] "\}"
    }]
    fileutil::writeFile $file "\{\"seed\":$seed,\"rows\":\[\n[join $rows ,\n]\n\]\}\n"
}
