# webDashboard.tcl -- dashboards as pages of sorma-web: the files of sorma::dashboard, with their parts live.
#
#     GET /dashboards                 the names of their files, without what stands after the last dot
#     GET /live/dashboard?name=NAME   one of them, as webLive.tcl sends it
#
# A file is read when its page is opened. All that a page shows and does is asked in the name of its login: values, what objects answer, and buttons.
# Items: about, all that does not change; and for each part, by its number, what it shows: a dict of state, why, and
#
#     display text unit    meter text unit part    led text    reading text    status text    stripchart values    button nothing more

package require sorma::boardFile
package require sorma::boardGrid
package require sorma::json
package require sorma::message
package require sorma::shown
package require sorma::text
package require sorma::timer
package require sorma::webLive
package require sorma::world
package provide sorma::webDashboard 1.0

namespace eval ::sorma::webDashboard {
    variable Files {}           ;# dict: NAME -> file
    variable Added {}           ;# daemons that a file names
    variable Least 100          ;# ms between two requests of the same kind
    variable Most 400           ;# parts of a dashboard
    variable Asked 2000         ;# ms after which a right is asked for again
}

# ::sorma::webDashboard::begin FILES -- serve these dashboards. Fails when one cannot be read.
proc ::sorma::webDashboard::begin files {
    variable Files
    foreach file $files {
        set name [file rootname [file tail $file]]
        if {[dict exists $Files $name]} {
            Fail $file "[dict get $Files $name] is called $name, too: rename one of them"
        }
        dict set Files $name [file normalize $file]
        Read $file
    }
    ::sorma::web::route GET {^/dashboards$} ::sorma::webDashboard::List
    ::sorma::webLive::kind dashboard
}
proc ::sorma::webDashboard::Fail {file message} {
    return -code error -errorcode [list SORMA WEB DASHBOARD $file] "$file: $message"
}

proc ::sorma::webDashboard::List {number request args} {
    variable Files
    ::sorma::web::json $number 200 [::sorma::json::object [list dashboards [::sorma::json::texts [dict keys $Files]]]]
}

# The parts of a file. Its daemons are known from then on.
proc ::sorma::webDashboard::Read file {
    variable Added
    variable Most
    lassign [::sorma::boardFile::parse [::sorma::text::readFile $file] $file] parts wrong
    if {$wrong ne {}} {
        return -code error -errorcode [list SORMA WEB DASHBOARD $file] [join $wrong \n]
    }
    if {[llength $parts] > $Most} {
        Fail $file "[llength $parts] parts, more than $Most: make two dashboards of it"
    }
    foreach part $parts {
        lassign $part kind settings
        foreach name [Objects $kind $settings] {
            if {[regexp {^[^@\s]+@([^@\s]+)$} $name -> daemon] && $daemon ne "self" && $daemon ni $Added && ![catch {::sorma::world add $daemon}]} {
                lappend Added $daemon
            }
        }
    }
    return $parts
}
# The objects that a part is about.
proc ::sorma::webDashboard::Objects {kind settings} {
    return [switch -- $kind {
        stripchart { lsort -unique [lmap plot [::sorma::shown::setting $settings -plot] {lindex $plot 0}] }
        text { list }
        default { list [dict get $settings -name] }
    }]
}
# A request as METHOD and words.
proc ::sorma::webDashboard::Request text {
    if {[catch {lassign $text method} message] || $method ni {EXEC CTRL DBX}} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "-request expects EXEC, CTRL or DBX, and words; got \"$text\""
    }
    return $text
}

# ---- the view ----

# A view belongs to the parts of the file as they were read. When the file has changed, a page that is opened anew gets another view.
oo::class create ::sorma::webLive::dashboard {
    superclass ::sorma::webLive::view
    variable login name items
    variable parts              ;# list of {KIND SETTINGS}; the index is the number of a part
    variable uses               ;# dict: object -> numbers of parts that show an option of it, or have a button for it
    variable watches            ;# dict: object -> what watches it
    variable seen               ;# dict: object -> {STATE WHY TABLE}; the table stays when it is old
    variable asks               ;# dict: {object request} -> {ms, numbers of parts}
    variable replies            ;# dict: {object request} -> dict of state why value
    variable rights             ;# dict: {object right} -> {when it was asked for, ms; why not, empty: it is allowed}

    self method of request {
        set which [::sorma::shown::setting [dict get $request query] name]
        set files $::sorma::webDashboard::Files
        if {![dict exists $files $which]} {
            return -code error -errorcode [list SORMA WEB PLACE $which] "there is no dashboard \"[string range $which 0 100]\"; GET /dashboards lists those that are"
        }
        if {[catch {::sorma::webDashboard::Read [dict get $files $which]} list]} {
            return [list [list $which {} $list] {}]
        }
        # A page may move what it has a button for.
        return [list [list $which $list {}] [lsort -unique [concat {*}[lmap part $list {
            if {[lindex $part 0] ne "button"} continue
            ::sorma::webDashboard::Objects {*}$part
        }]]]]
    }
    method Begin {} {
        set uses [set watches [set seen [set asks [set replies [set rights {}]]]]]
        lassign $name which parts wrong
        set places [::sorma::boardFile::places $parts]
        set list {}
        set n -1
        foreach part $parts {
            incr n
            lassign $part kind settings
            set facts [list kind [::sorma::json::text $kind] title [::sorma::json::text [::sorma::boardFile::title $kind $settings]] \
                at [::sorma::json::array [dict get $places $n]]]
            try {
                lappend facts {*}[my Take $n $kind $settings]
            } on error message {
                lset parts $n {wrong {}}
                lappend facts error [::sorma::json::text $message]
            }
            lappend list [::sorma::json::object $facts]
        }
        my Put about [::sorma::json::object [list title [::sorma::json::text $which] error [::sorma::json::text $wrong] rows [::sorma::boardGrid::rows $places] \
            columns $::sorma::boardGrid::columns parts [::sorma::json::array $list]]]
        dict for {what facts} $asks {
            my AskFor $what
        }
    }
    method End {} {
        foreach watch [dict values $watches] {
            $watch destroy
        }
    }
    # Note what a part needs. Returns what a page must know of it besides.
    method Take {n kind settings} {
        switch -- $kind {
            display - meter - led { my Use [dict get $settings -name] $n }
            reading { my Needs [dict get $settings -name] [::sorma::shown::setting $settings -request EXEC] [::sorma::shown::setting $settings -every 1000] $n }
            button {
                set words [lassign [::sorma::webDashboard::Request [dict get $settings -request]] method]
                my Use [dict get $settings -name] $n
                return [list name [::sorma::json::text [dict get $settings -name]] method [::sorma::json::text [string tolower $method]] words [::sorma::json::texts $words]]
            }
            image {
                ::sorma::webRest::place [dict get $settings -name]
                set words [lassign [::sorma::webDashboard::Request [::sorma::shown::setting $settings -request EXEC]] method]
                if {$method ne "EXEC"} {
                    return -code error "a picture is asked for by EXEC"
                }
                return [list name [::sorma::json::text [dict get $settings -name]] words [::sorma::json::texts $words] \
                    every [::sorma::json::number [::sorma::shown::setting $settings -every 1000]]]
            }
            stripchart {
                set traces {}
                foreach plot [::sorma::shown::setting $settings -plot] {
                    set more [lassign $plot object what]
                    if {[string match -* $what]} {
                        my Use $object $n
                    } else {
                        my Needs $object $what [::sorma::shown::setting $more -every 1000] $n
                    }
                    lappend traces [::sorma::json::text [::sorma::shown::setting $more -text "$object [string trimleft $what -]"]]
                }
                return [concat [list traces [::sorma::json::array $traces]] [concat {*}[lmap option {-span -low -high} {
                    set value [::sorma::shown::setting $settings $option]
                    if {![string is double -strict $value]} continue
                    list [string range $option 1 end] [::sorma::json::number $value]
                }]]]
            }
        }
    }
    method Use {object n} {
        dict lappend uses $object $n
        return
    }
    method Needs {object request every n} {
        ::sorma::webDashboard::Request $request
        set what [list $object $request]
        lassign [if {[dict exists $asks $what]} {dict get $asks $what}] ms numbers
        set every [expr {max($::sorma::webDashboard::Least, [string is integer -strict $every] ? $every : 1000)}]
        dict set asks $what [list [expr {$ms eq {} ? $every : min($ms, $every)}] [concat $numbers $n]]
        dict set replies $what {state asking why {} value {}}
        return
    }

    # ---- options ----

    method Look {} {
        foreach object [dict keys $uses] {
            if {![dict exists $watches $object]} {
                # Its daemon may be known in a moment.
                if {[catch {::sorma::webLive::watch new $login $object [list ::sorma::webLive::call [self] Seen $object]} watch]} {
                    my Seen $object stale $watch {}
                    continue
                }
                dict set watches $object $watch
            }
            [dict get $watches $object] look
        }
        set n -1
        foreach part $parts {
            incr n
            lassign $part kind settings
            if {$kind eq "status"} {
                my Show $n
            } elseif {$kind eq "button"} {
                my AskRights {*}$settings
            }
        }
    }
    method Seen {object state why table} {
        if {$table eq {} && $state ne "denied" && [dict exists $seen $object]} {
            set table [lindex [dict get $seen $object] 2]
        }
        dict set seen $object [list $state $why $table]
        foreach n [lsort -unique [dict get $uses $object]] {
            my Show $n
        }
    }
    method Told {object option} {
        lassign [if {[dict exists $seen $object]} {dict get $seen $object} else {list asking {} {}}] state why table
        set known [dict create state [expr {$state eq "denied" ? "refused" : $state}] why $why value {} unit {} low {} high {} hints {}]
        if {$table eq {}} {
            return $known
        }
        set row [lsearch -inline -index 0 -exact [dict get $table options] $option]
        if {$row eq {}} {
            return [dict merge $known [list state refused why "there is no option $option; there are [join [lmap row [dict get $table options] {lindex $row 0}] {, }]"]]
        }
        lassign $row - type unit range default value
        lassign [::sorma::table::limits $type $range] low high
        set hints [if {[dict exists $table hints $option]} {dict get $table hints $option}]
        return [dict merge $known [list value [expr {$state eq "gone" ? {} : $value}] unit $unit low $low high $high hints $hints]]
    }

    # ---- what objects answer ----

    method AskFor what {
        lassign $what object request
        if {[catch {::sorma::webRest::place $object} place]} {
            return [my Replied $what error [list $place {}]]
        }
        my Ask [lindex $place 1] [concat [lindex $place 0] $request] Replied $what
    }
    method Replied {what status value} {
        lassign [dict get $asks $what] ms numbers
        if {$status eq "ok"} {
            dict set replies $what [dict create state live why {} value $value]
        } else {
            lassign $value message code
            set state [expr {[string match "SORMA COMM*" $code] && ![string match "SORMA COMM DENIED*" $code] || $code eq {} ? "stale" : "refused"}]
            dict set replies $what [dict create state $state why $message \
                value [expr {$state eq "stale" ? [dict get $replies $what value] : {}}]]
            set ms [expr {max($ms, $::sorma::webLive::patience)}]
        }
        foreach n [lsort -unique $numbers] {
            my Show $n
        }
        ::sorma::timer::once "[self].ask $what" $ms [self] AskFor $what
    }

    # ---- buttons ----

    # The rights that the request of a button needs, as far as the table tells. The daemon judges the request itself.
    method Needed {table request} {
        set words [lassign $request method]
        set kinds [if {$method eq "EXEC"} {my DangerOfExec $table $words} else {
            lmap word $words {if {[dict exists $table danger $word]} {dict get $table danger $word} else continue}
        }]
        set out [if {"move" in $kinds || "power" in $kinds || "fire" in $kinds} {list operate}]
        if {$method eq "EXEC" || "stop" in $kinds} {
            lappend out call
        }
        foreach row [dict get $table options] {
            if {$method eq "CTRL" && [lindex $row 0] in $words} {
                lappend out configure
            }
        }
        return [lsort -unique $out]
    }
    # That of the first beginning that fits; the empty one fits always.
    method DangerOfExec {table words} {
        dict for {start danger} [dict get $table danger] {
            if {[string match -* $start]} continue
            if {[lrange $words 0 [llength $start]-1] eq [lrange $start 0 end]} {
                return [list $danger]
            }
        }
    }
    method AskRights args {
        set object [dict get $args -name]
        set table [if {[dict exists $seen $object]} {lindex [dict get $seen $object] 2}]
        if {$table eq {} || [catch {::sorma::webRest::place $object} place]} return
        set now [clock milliseconds]
        foreach right [my Needed $table [dict get $args -request]] {
            lassign [if {[dict exists $rights [list $object $right]]} {dict get $rights [list $object $right]} else {list 0 {}}] asked why
            if {$now - $asked < $::sorma::webDashboard::Asked} continue
            dict set rights [list $object $right] [list $now $why]
            my Ask [lindex $place 1] [list sorm CTRL -may [list web $login] $right [lindex $place 0]] Judged $object $right
        }
    }
    method Judged {object right status value} {
        if {$status ne "ok"} return
        set text [::sorma::shown::setting $value text]
        dict set rights [list $object $right] [list [clock milliseconds] [if {[string match no* $text]} {string cat "$login may not $right: $text"}]]
        foreach n [lsort -unique [dict get $uses $object]] {
            my Show $n
        }
    }
    method button settings {
        set object [dict get $settings -name]
        lassign [if {[dict exists $seen $object]} {dict get $seen $object} else {list asking {} {}}] state why table
        if {$state in {live gone} && $table ne {}} {
            foreach right [my Needed $table [dict get $settings -request]] {
                if {[dict exists $rights [list $object $right]] && [lindex [dict get $rights [list $object $right]] 1] ne {}} {
                    return [dict create state refused why [lindex [dict get $rights [list $object $right]] 1]]
                }
            }
            return {state live why {}}
        }
        return [dict create state [expr {$state eq "denied" ? "refused" : $state}] why $why]
    }
    # For webGuard.tcl.
    method dangers object {
        set table [if {[dict exists $seen $object]} {lindex [dict get $seen $object] 2}]
        if {$table eq {}} {
            return -code error -errorcode [list SORMA WEB PAGE $object] "$object: its table is not known yet: wait until the button is live"
        }
        return [dict get $table danger]
    }

    # ---- items ----

    method Show n {
        lassign [lindex $parts $n] kind settings
        set object [::sorma::shown::setting $settings -name]
        switch -- $kind {
            display - meter - led { set shown [::sorma::shown::$kind $settings [my Told $object [dict get $settings -option]]] }
            reading { set shown [::sorma::shown::reading $settings [dict get $replies [list $object [::sorma::shown::setting $settings -request EXEC]]]] }
            status {
                set shown [::sorma::shown::status $settings [::sorma::world get [lindex [split $object @] end]]]
            }
            button { set shown [my button $settings] }
            stripchart { return [my Put $n [my Chart $settings]] }
            default return
        }
        set part [if {[dict exists $shown part]} {list part [format %.4f [dict get $shown part]]}]
        my Put $n [::sorma::json::object [concat $part [dict map {key text} [dict remove $shown part] {::sorma::json::text [::sorma::webLive::short $text]}]]]
    }
    # The newest number of each line, null where none is known.
    method Chart settings {
        set states {}
        set values {}
        foreach plot [dict get $settings -plot] {
            set more [lassign $plot object what]
            set index [::sorma::shown::setting $more -index]
            if {[string match -* $what]} {
                set known [my Told $object $what]
                set list [regexp -all -inline {\S+} [dict get $known value]]
                set value [lindex $list [expr {$index eq {} ? 0 : $index}]]
            } else {
                set known [dict get $replies [list $object $what]]
                set value [lindex [lindex [::sorma::message::part [dict get $known value] [::sorma::shown::setting $more -part] $index] 1] 0]
            }
            lappend states [dict get $known state] [dict get $known why]
            lappend values [expr {[dict get $known state] eq "live" && [string is double -strict $value] ? [::sorma::json::number $value] : "null"}]
        }
        set worst [lsearch -inline -not -exact [dict keys $states] live]
        return [::sorma::json::object [list state [::sorma::json::text [expr {$worst eq {} ? "live" : $worst}]] \
            why [::sorma::json::text [expr {$worst eq {} ? {} : [dict get $states $worst]}]] values [::sorma::json::array $values]]]
    }
    export Seen AskFor Replied Judged
}
