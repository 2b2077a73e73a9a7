# driver.tcl -- a driver of a device, whatever its language is: a table of options, settings for the device, and readings. It knows no bus and no line.
#
#     oo::class create sorma::service::scpi {superclass sorma::driver::Device sorma::Service; ...}
#
# An option of the device has a method Row-NAME, which returns its row: a dict that has at least type and unit. A class of the language has these
# methods, and those of sorma::Service:
#
#     language            the word in the codes of its errors: {SORMA SCPI DEVICE ...} says that the device has refused something
#     settings OPTIONS    those of the options that go to the device
#     asked OPTIONS       those of them that it can be asked for
#     askable             what these are called in an error: options with a question
#     put VALUES          send a dict, option -> value, to the device; returns what it has taken
#     fetch OPTIONS       ask for these, then `learn`
#     State               of the line, for people
#     pollNow             begin an EXEC read, with `sorma::driver::polled` behind it
#     Fault SYMBOL TEXT ?DETAIL ...?      fail
#
# It calls `begin` when it is born, `end` when it ends, and `poll` when its option -poll has changed.

package provide sorma::driver 1.0

namespace eval ::sorma::driver {}

# ::sorma::driver::polled NEXT FUTURE -- a poll has ended: the next one, if the object is still there.
proc ::sorma::driver::polled {next future} {
    catch {$future take}
    catch $next
}

oo::class create ::sorma::driver::Device {
    variable Table              ;# dict: option -> its row
    variable Known              ;# dict: option -> what the device has, as far as we know; that of the recipe before we know it
    variable Heard              ;# dict: option -> 1: the device has told it, or taken it
    variable Timer              ;# of -poll

    method begin {} {
        set Known [set Heard [set Timer {}]]
        foreach option [my settings [dict keys [my table]]] {
            dict set Known $option [my cget $option]
        }
        my poll
    }
    # Also of an object whose recipe was refused: it has not begun.
    method end {} {
        if {[info exists Timer]} {
            after cancel $Timer
        }
    }

    method table {} {
        if {![info exists Table]} {
            set Table {}
            foreach method [lsort [info object methods [self] -all -private]] {
                if {[string match Row-* $method]} {
                    dict set Table [string range $method 3 end] [my $method]
                }
            }
        }
        return $Table
    }
    method readings {} {
        set options [dict keys [my table]]
        set settings [my settings $options]
        return [lmap option [my asked $options] {if {$option in $settings} continue; set option}]
    }

    # The device takes the values of these options. When it does not, they are again what it has.
    method give options {
        set given {}
        foreach option [my settings $options] {
            dict set given $option [my cget $option]
        }
        if {$given eq {}} return
        set ours [list SORMA [my language]]
        try {
            set taken [my put $given]
        } trap [list {*}$ours DEVICE] {why how} {
            # It may have done a part.
            try {
                my fetch [dict keys $given]
            } trap $ours {} {
                my recall $given
            }
            return -options $how $why
        } trap $ours {why how} {
            my recall $given
            return -options $how $why
        }
        my learn $taken
    }
    # The device may have a value that the option may not have.
    method learn values {
        try {
            my store {*}$values
        } trap {SORMA OPTION RANGE} {why how} {
            set option [lindex [dict get $how -errorcode] 4]
            set unit [dict get [my table] $option unit]
            my Fault OUTSIDE "the device has $option [join [list [dict get $values $option] {*}$unit]], [regsub {^.* is (outside .*)$} $why {\1}]" $option
        }
        set Known [dict merge $Known $values]
        set Heard [dict merge $Heard [dict map {option value} $values {string cat 1}]]
        return
    }
    # Name the options that the device has not told yet: they show a default, or the recipe.
    method dump {} {
        set unknown [lmap option [my asked [dict keys [my table]]] {
            if {[dict exists $Heard $option]} continue
            set option
        }]
        return "line [my State][if {$unknown ne {}} {string cat "\nnot asked for yet: " [join $unknown {, }]}]"
    }
    method recall options {
        my store {*}[dict filter $Known script {option value} {dict exists $options $option}]
    }

    # Fresh values: numbers are the floats, others lines of the text. Without names: all readings.
    method read names {
        set options [lmap name $names {string cat - [string trimleft $name -]}]
        if {$options eq {}} {
            set options [my readings]
        }
        if {$options eq {} || [my asked $options] ne $options} {
            my Fault OPTION "expected [my askable]: [join [my asked [dict keys [my table]]] {, }], got \"[join $names]\"" {*}$names
        }
        my fetch $options
        set numbers [set lines {}]
        foreach option $options {
            if {[dict get [my table] $option type] in {string enum}} {
                lappend lines "$option [my cget $option]"
            } else {
                lappend numbers {*}[my cget $option]
            }
        }
        return [dict create floats $numbers text [join $lines \n]]
    }
    # A poll is a request of its own: it takes its turn, and failures stand in the trail.
    method poll {} {
        after cancel $Timer
        if {[my cget -poll] > 0 && [my readings] ne {}} {
            set Timer [after [expr {max(10, round(1000 * [my cget -poll]))}] [namespace code {my pollNow}]]
        }
    }
}
