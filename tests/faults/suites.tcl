# suites.tcl ?NUMBER? ?SEED? ?KEEP? -- suites that sorma-replay makes of recordings of the demos' daemons: do they hold, and do they notice faults?
#
# By turns the daemons of lab, checkers and tracker are started from a copy of their folder, and a random session of requests is recorded. As a panel
# does, it first reads options of each object. A suite is made of the recording, and is run twice on the same tree: a test that fails is a false
# failure. Then one fault is planted: a default in a dictionary, or a line in the source of a class that was asked. A source in C++ is compiled into a
# module of its own. The suite must fail now, in a test of the object that has the fault. Sessions and faults stand in suites.list; a session does not
# know the fault.
#
# A fault is hidden when it changes no reply of its object in the session, such as a limit that no value has reached. No suite of this session can
# notice it. It is counted as hidden, and another one is planted. The script decides this itself, without the suite and its tolerances. It sends the
# session once more to the good tree and once to the faulty one. Words of a raw reply that differ between the two runs of the good tree are left out.
# All others must be the same to the letter.
#
# Laboratories are paused: lab time passes by requests. The draughts have no arm (dry.dict) and no person, who would play by himself. SIGTERM ends it
# after the present suite. KEEP: a folder for the suites that have failed falsely or noticed nothing.

source [file join [file dirname [file normalize [info script]]] faults.tcl]
source [file join $supportFolder contents.tcl]
source [file join $supportFolder demoDaemons.tcl]
package require sorma::recorded

set Source [file dirname [file dirname $supportFolder]]
set Launch {lab {lab/lab.launch} checkers {checkers/checkers.launch lab voice player judge} tracker {tracker/tracker.launch}}
set Sessions {}         ;# dict: demo -> list of {weight request}
set Faults {}           ;# dict: demo -> list of {kind object file {from to}}
set Modules {}          ;# dict: fault -> the module that was compiled with it
proc session {demo requests} {
    dict set ::Sessions $demo $requests
}
proc fault {demo args} {
    dict lappend ::Faults $demo $args
}

# ---- texts ----

proc writeAll {file text} {
    set f [open $file w]
    fconfigure $f -encoding utf-8
    puts -nonewline $f $text
    close $f
}
proc pick list {
    return [lindex $list [expr {int(rand() * [llength $list])}]]
}
# One of a list of {WEIGHT VALUE}.
proc weighed list {
    set at [expr {rand() * [tcl::mathop::+ {*}[lmap item $list {lindex $item 0}]]}]
    foreach item $list {
        set at [expr {$at - [lindex $item 0]}]
        if {$at < 0} break
    }
    return [lindex $item 1]
}
proc filled template {
    while {[regexp -indices {%([rio]) ([^%]*)%} $template whole - words]} {
        set words [string range $template {*}$words]
        lassign $words low high
        set value [switch [string index $template [lindex $whole 0]+1] {
            r { format %.4g [expr {$low + rand() * ($high - $low)}] }
            i { expr {$low + int(rand() * ($high - $low + 1))} }
            o { pick $words }
        }]
        set template [string replace $template {*}$whole $value]
    }
    return $template
}

# ---- a trial: its folder has demos/, pkg/, and what daemons write ----

proc prepare folder {
    file delete -force $folder
    file mkdir $folder/run
    exec cp -rL $::Source/demos $folder/demos
    exec cp -r -P $::env(SORMA_BUILD)/pkg $folder/pkg
    # Buffers have names of their own, and laboratories stand still.
    foreach dict [glob $folder/demos/*/*.dict] {
        set text [regsub -all { (tracker|demo|checkers)\.(?=\S+\.\S|\s)} [contents $dict] " s[pid].\\1."]
        writeAll $dict [regsub -line {^simlab } $text {simlab -paused 1 }]
    }
    set ::demoDaemons::Demos $folder/demos
    set ::env(TCLLIBPATH) [list $folder/pkg {*}$::libraries]
    cd $folder/run
}
proc daemonsOf {demo folder} {
    set daemons [demoDaemons of {*}[dict get $::Launch $demo]]
    if {$demo eq "checkers"} {
        set daemons [dict map {name words} $daemons {concat $words [list -dict $folder/demos/checkers/dry.dict]}]
    }
    return $daemons
}
# Files of daemons are the same for each run.
proc clean folder {
    file delete -force $folder/run
    file mkdir $folder/run
    cd $folder/run
}
# Send requests, and return their replies or errors. A daemon that has died of a fault is not waited for.
proc sent requests {
    return [lmap request $requests {
        regexp {^\S+@(\S+)} $request -> daemon
        if {[::sorma::recorded::ended $daemon]} {
            set said ended
        } else {
            catch {uplevel #0 [sorma::line::translate $request]} said
        }
        set said
    }]
}

# Record a session: {READ REQUESTS REPLIES}. READ: the options that were read, a list of {OBJECT ROW VALUE}.
proc recorded {demo folder daemons} {
    set read [set requests [set replies {}]]
    ::sorma::recorded::begin $daemons
    set pipe {}
    try {
        set objects [lsort -unique [concat [lmap item [dict get $::Sessions $demo] {lindex $item 1 0}]]]
        # Tables are asked for before, as windows have them already.
        set rows [concat {*}[lmap object $objects {
            lmap row [dict values [demoDaemons options $object]] {list $object $row}
        }]]
        set pipe [open [list | sorma-record -o $folder/run.rec -daemon {*}[dict keys $daemons] -events {} 2>@stderr] r]
        gets $pipe
        foreach object $objects {
            foreach item [lrange [lsort -index 0 -real [lmap item [lsearch -all -inline -index 0 -exact $rows $object] {list [expr {rand()}] $item}]] 0 7] {
                lassign [lindex $item 1] object row
                lappend requests "$object DBX -get [lindex $row 0]"
                lappend replies {*}[sent [lrange $requests end end]]
                if {[string match "RET *" [lindex $replies end]]} {
                    lappend read [list $object $row [lindex $replies end 3]]
                }
            }
        }
        # Each request once, and then by weight.
        foreach item [lsort -index 0 -real [lmap item [dict get $::Sessions $demo] {list [expr {rand()}] [lindex $item 1]}]] {
            lappend more [filled [lindex $item 1]]
        }
        for {set n 0} {$n < 60} {incr n} {
            lappend more [filled [weighed [dict get $::Sessions $demo]]]
        }
        lappend requests {*}$more
        lappend replies {*}[sent $more]
        exec kill -INT [pid $pipe]
        read $pipe
    } finally {
        catch {close $pipe}
        ::sorma::recorded::end
    }
    return [list $read $requests $replies]
}
# The replies of new daemons.
proc replied {folder daemons requests} {
    clean $folder
    ::sorma::recorded::begin $daemons
    try {
        return [sent $requests]
    } finally {
        ::sorma::recorded::end
    }
}
# Do replies of this object differ from those of the good tree, which are there twice? The first difference is enough: the daemon may have died, and
# each further request would wait for it.
proc shows {object folder daemons requests good again} {
    clean $folder
    ::sorma::recorded::begin $daemons
    try {
        foreach request $requests one $good two $again {
            lassign [sent [list $request]] is
            if {[lindex [split $request] 0] eq $object && [differs [split $one] [split $two] [split $is]]} {
                return 1
            }
        }
    } finally {
        ::sorma::recorded::end
    }
    return 0
}
# A reply whose length varies by itself shows nothing.
proc differs {one two is} {
    if {[llength $one] != [llength $two]} {
        return 0
    }
    foreach a $one b $two c $is {
        if {$a eq $b && $c ne $a} {
            return 1
        }
    }
    return [expr {[llength $is] != [llength $one]}]
}

# Run a suite: the titles of tests that fail.
proc ran {folder suite} {
    clean $folder
    catch {exec timeout 300 [info nameofexecutable] $suite 2>@1} said
    set titles [lmap {- title} [regexp -all -inline -line {^==== \S+ (.*) FAILED$} $said] {set title}]
    # A daemon that dies of a fault may hold up the suite for longer.
    return [expr {[regexp {Total\s+(\d+)\s+Passed} $said] ? $titles : [concat $titles [list "it has not ended: [string range $said end-200 end]"]]}]
}

# ---- faults ----

# One that this session may notice: {KIND OBJECT WHAT}, planted in the folder.
proc plant {demo folder daemons read} {
    if {rand() < 0.3} {
        return [plantDefault $demo $folder $daemons $read]
    }
    lassign [pick [dict get $::Faults $demo]] kind object file change
    lassign $change from to
    if {[string match demos/* $file]} {
        set target $folder/$file
        set text [contents $target]
    } else {
        set text [contents $::Source/$file]
        set target $folder/pkg/sorma1.0/services/[file tail $file]
    }
    if {[string first $from $text] < 0} {
        error "suites.list: $file does not have \"$from\""
    }
    set changed [string replace $text [string first $from $text] [expr {[string first $from $text] + [string length $from] - 1}] $to]
    if {[file extension $file] eq ".tcl"} {
        file delete $target
        writeAll $target $changed
    } else {
        set module [file tail [file dirname $file]][info sharedlibextension]
        file delete $folder/pkg/sorma1.0/services/$module
        file copy [compiled $file $changed] $folder/pkg/sorma1.0/services/$module
    }
    return [list $kind $object "$from -> $to"]
}
# Another default, by the recipe of an object that has none for this option. It is one whose value was read and was not set before.
proc plantDefault {demo folder daemons read} {
    while 1 {
        lassign [pick $read] object row value
        lassign $row option type - rule
        lassign [split $object @] name daemon
        # The recipe that holds stands in the last file that has one.
        set files [lreverse [lmap {word file} [dict get $daemons $daemon] {if {$word ne "-dict"} continue; set file}]]
        set dict [lindex [concat [lsearch -all -inline -regexp [lmap file $files {list $file [regexp -line "^[string map {. \\.} $name]\\s" [contents $file]]}] { 1$}] [list [lrange $files 0 0]]] 0 0]
        set text [contents $dict]
        # Values of the recipe, or of its class, stay; what makes a simulation another one concerns all.
        if {[regexp -line "^[string map {. \\.} $name]\\s.*$option\\M" $text] || [regexp -line {^simlab} $name]} continue
        if {![regexp -line "^[string map {. \\.} $name]\\s" $text] && [regexp -line "^[lindex [split $name .] 0]\\s" $text] && [string first . $name] >= 0} continue
        set other [switch $type {
            int - double {
                if {![regexp {^(\S+) \.\. (\S+)$} $rule -> low high] || ![string is double -strict $value]} continue
                expr {$value + 1 <= $high ? $value + 1 : $value - 1 >= $low ? $value - 1 : $type eq "int" ? [continue] : ($value + $low) / 2.0}
            }
            enum { pick [lsearch -all -inline -not -exact $rule $value] }
            default { continue }
        }]
        if {$other eq {} || $other == $value || ($type eq "double" && $other eq $value)} continue
        if {![regsub -line "^[string map {. \\.} $name]\\s" $text "$name $option $other " changed]} {
            set changed "$text\n$name $option $other\n"
        }
        writeAll $dict $changed
        return [list default $object "$option $value -> $other"]
    }
}
# The module of a source in C++ that is TEXT now.
proc compiled {file text} {
    if {[dict exists $::Modules $text]} {
        return [dict get $::Modules $text]
    }
    set name [file tail [file dirname $file]]
    set folder $::Work/module[dict size $::Modules]
    file mkdir $folder
    writeAll $folder/[file tail $file] $text
    set before [pwd]
    cd $::env(SORMA_BUILD)
    try {
        set said [exec sh -c {make -n V=1 -W "../$1" "$2.la" 2>/dev/null || true} sh $file $name]
        regexp -line "^.*--mode=compile (.*) -MT \\S+ .* -c -o (\\S+\\.lo) .*[file tail $file].*\$" $said -> compiler object
        regexp -line "^(.*--mode=link .*) -o $name\\.la (.*)\$" $said -> link objects
        exec sh -c "./libtool --tag=CXX --mode=compile $compiler -I../services -iquote ../[file dirname $file] -c -o $folder/new.lo $folder/[file tail $file] 2>&1"
        exec sh -c "[string map {{ --tag} { --silent --tag}} $link] -o $folder/$name.la [string map [list $object $folder/new.lo] $objects] 2>&1"
    } finally {
        cd $before
    }
    dict set ::Modules $text $folder/.libs/$name[info sharedlibextension]
    return [dict get $::Modules $text]
}

# ---- trials ----

proc trial {demo folder} {
    prepare $folder
    set daemons [daemonsOf $demo $folder]
    lassign [recorded $demo $folder $daemons] read requests replies
    set again [replied $folder $daemons $requests]
    clean $folder
    regexp {: (\d+) tests?, (\d+) leaves?} [exec sorma-replay $folder/run.rec -as-test $folder/again.test -start $daemons 2>@1] -> tests open
    set failing {}
    foreach run {1 2} {
        lappend failing {*}[ran $folder $folder/again.test]
    }
    # A hidden fault is taken back, and counted. Ten of them are a miss.
    exec cp -r -P $folder/pkg $folder/demos $folder/..
    set there [set noticed {}]
    for {set hidden 0} {$hidden < 10} {incr hidden} {
        lassign [plant $demo $folder $daemons $read] kind object what
        if {[shows $object $folder $daemons $requests $replies $again]} {
            set noticed [ran $folder $folder/again.test]
            lassign [split $object @] name daemon
            set there [lsearch -all -inline -glob $noticed "$daemon: $name *"]
            break
        }
        file delete -force $folder/pkg $folder/demos
        exec cp -r -P $folder/../pkg $folder/../demos $folder
    }
    return [dict create demo $demo kind $kind object $object what $what tests $tests open $open hidden $hidden false $failing caught [expr {$there ne {}}] fails [llength $noticed] \
        elsewhere [expr {$there eq {} && $noticed ne {}}]]
}
proc add {table demo args} {
    upvar 1 $table sums
    foreach {what n} $args {
        foreach row [list $demo all] {
            dict set sums $row $what [expr {$n + ([dict exists $sums $row $what] ? [dict get $sums $row $what] : 0)}]
        }
    }
}

attack {
    lassign [concat $argv [lrange {12 1 {}} [llength $argv] end]] number seed keep
    expr {srand($seed)}
    source [file join [file dirname [file normalize [info script]]] suites.list]
    set libraries [expr {[info exists env(TCLLIBPATH)] ? $env(TCLLIBPATH) : {}}]
    set Work $env(SORMA_RUNTIME_DIR)/suites
    set folder $Work/trial
    set before [pwd]
    set sums [set kinds {}]
    sorma::atSignal {set stopped 1}
    for {set i 0} {$i < $number && ![info exists stopped]} {incr i} {
        set demo [lindex {lab checkers tracker} [expr {$i % 3}]]
        set found [trial $demo $folder]
        dict with found {}
        add sums $demo suites 1 tests $tests open $open hidden $hidden false [expr {$false ne {}}] caught $caught elsewhere $elsewhere
        add kinds $kind suites 1 caught $caught
        if {$false eq {} && $caught} {
            puts "suite [expr {$i + 1}] $demo, $kind at $object: caught by $fails of $tests"
        } else {
            puts "suite [expr {$i + 1}] $demo, $kind at $object: $what: [expr {$caught ? "caught" : "MISSED"}], false failures: [lrange $false 0 3]"
            if {$keep ne {}} {
                file mkdir $keep
                file copy -force $folder/again.test $keep/[expr {$i + 1}].test
                file copy -force $folder/run.rec $keep/[expr {$i + 1}].rec
            }
        }
        flush stdout
        update
    }
    cd $before
    file delete -force $Work
    puts [format "%-12s%8s%8s%8s%16s%10s%12s%10s" demo suites tests open "failed falsely" caught elsewhere hidden]
    foreach demo [dict keys $sums] {
        if {$demo eq "all"} continue
        puts [format "%-12s%8s%8s%8s%16s%10s%12s%10s" $demo {*}[lmap what {suites tests open false caught elsewhere hidden} {dict get $sums $demo $what}]]
    }
    puts [format "%-12s%8s%8s%8s%16s%10s%12s%10s" all {*}[lmap what {suites tests open false caught elsewhere hidden} {dict get $sums all $what}]]
    puts [join [lmap kind [lsort [dict keys $kinds]] {
        if {$kind eq "all"} continue
        string cat "$kind [dict get $kinds $kind caught] of [dict get $kinds $kind suites]"
    }] ", "]
    promise "no suite fails on the same tree" [expr {[dict get $sums all false] == 0}]
    promise "each planted fault is caught by a test of its object" [expr {[dict get $sums all caught] == $i}]
}
