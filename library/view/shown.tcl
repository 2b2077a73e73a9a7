# shown.tcl -- what is shown of a value: by widgets that are only looked at, and by parts of dashboards in a window and in a browser. It knows no
# window.
#
# SETTINGS is a dict of the part's options; an empty one was not given. TOLD is a dict of state, why and value. The state is live, or says why the value is
# not that of now. It also has unit, low, high and hints of an option, as sorma::table has them. Each command returns a dict of state, why and text; and of
#
#     display     unit            alarm and warn are states, too
#     meter       unit part       the same; part: of the bar, 0 to 1
#     led         nothing more    states are good, warn, bad and off
#     reading     nothing more    the value is a reply
#     status      nothing more    TOLD: what sorma::world knows of a daemon; states are good, asking and stale

package require sorma::message
package require sorma::table
package provide sorma::shown 1.0

namespace eval ::sorma::shown {}

# ::sorma::shown::setting SETTINGS OPTION ?DEFAULT?
proc ::sorma::shown::setting {settings option {default {}}} {
    return [if {[dict exists $settings $option] && [dict get $settings $option] ne {}} {dict get $settings $option} else {set default}]
}
proc ::sorma::shown::Number {text default} {
    return [expr {[string is double -strict $text] && abs($text) < 1e300 ? $text : $default}]
}
# A number as the format of its part has it; another value stays as it is.
proc ::sorma::shown::Digits {settings value} {
    return [if {![string is double -strict $value] || [catch {format [setting $settings -format %.6g] $value} text]} {set value} else {set text}]
}

proc ::sorma::shown::display {settings told} {
    dict with told {
        set index [setting $settings -index]
        if {$index ne {}} {
            set value [lindex [regexp -all -inline {\S+} $value] $index]
        }
        return [dict create state [expr {$state eq "live" ? [::sorma::table::zone $hints $value] : $state}] why $why text [Digits $settings $value] \
            unit [expr {$value eq {} ? {} : $unit}]]
    }
}
proc ::sorma::shown::meter {settings told} {
    foreach limits {warn alarm} {
        dict set told hints $limits [setting $settings -$limits [setting [dict get $told hints] $limits]]
    }
    dict with told {
        set low [Number [setting $settings -low] [Number $low 0.0]]
        set high [Number [setting $settings -high] [Number $high [expr {$low + 1.0}]]]
        set known [expr {[string is double -strict $value] && $value == $value && $high > $low}]
        if {$state eq "live" && ![string is double -strict $value]} {
            dict set told state asking
        }
    }
    return [dict merge [display $settings $told] [dict create part [expr {$known ? max(0.0, min(1.0, ($value - $low) / double($high - $low))) : 0}]]]
}
proc ::sorma::shown::led {settings told} {
    dict with told {
        if {$state eq "live"} {
            set limits [dict filter $hints key warn alarm]
            set zone [::sorma::table::zone $limits $value]
            set bad [setting $settings -bad]
            set good [setting $settings -good [expr {$limits eq {} ? "\[1-9]*" : "*"}]]
            set state [expr {$bad ne {} && [string match $bad $value] || $zone eq "alarm" ? "bad" : $zone eq "warn" ? "warn" : [string match $good $value] ? "good" : "off"}]
        }
        return [dict create state $state why $why text $value]
    }
}
proc ::sorma::shown::reading {settings told} {
    lassign [::sorma::message::part [dict get $told value] [setting $settings -part] [setting $settings -index]] part text
    if {$part in {floats ints words}} {
        set text [join [lmap item $text {expr {$part eq "floats" && [string is double -strict $item] ? [format %.6g $item] : $item}}]]
    }
    return [dict create state [dict get $told state] why [dict get $told why] text [string trimright "$text [expr {$text eq {} ? {} : [setting $settings -unit]}]"]]
}
proc ::sorma::shown::status {settings facts} {
    if {$facts eq {}} {
        return {state stale why {no such daemon is known} text gone}
    }
    set how [dict get $facts state]
    return [dict create state [expr {$how in {alive busy} ? "good" : $how eq "asking" ? "asking" : "stale"}] \
        why [expr {[dict get $facts why] ne {} ? [dict get $facts why] : [dict get $facts busy]}] text $how]
}
