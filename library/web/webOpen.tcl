# webOpen.tcl -- the link of sorma-web opens in the user's browser, by xdg-open.
#
# All users of a host can read command lines. So the key of the link stands in a file that only this user may read, and xdg-open gets its name.

package require sorma::text
package provide sorma::webOpen 1.0

namespace eval ::sorma::webOpen {
    variable File {}            ;# that leads to the link
}

# ::sorma::webOpen::wanted WHEN -- is a browser to be opened? WHEN: always, never, or auto: when there is a display, and a person has typed the command.
proc ::sorma::webOpen::wanted when {
    if {$when ne "auto"} {
        return [expr {$when eq "always"}]
    }
    foreach name {WAYLAND_DISPLAY DISPLAY} {
        if {[info exists ::env($name)] && $::env($name) ne {}} {
            return [::sorma::text::isTerminal stdout]
        }
    }
    return 0
}

# ::sorma::webOpen::open LINK -- error WEB BROWSER when there is no xdg-open. It waits for nothing.
proc ::sorma::webOpen::open link {
    variable File
    if {[auto_execok xdg-open] eq {}} {
        return -code error -errorcode {SORMA WEB BROWSER} "no browser is opened: xdg-open is not there (Debian: xdg-utils); open the link yourself"
    }
    set channel [file tempfile File sorma-web.html]                    ;# for its owner alone
    puts $channel "<!DOCTYPE html><meta charset=\"utf-8\"><title>SORMA</title><meta http-equiv=\"refresh\" content=\"0;url=$link\"><a href=\"$link\">To the pages of SORMA</a>"
    close $channel
    # A session of its own: Ctrl-C at this terminal does not end the browser.
    exec setsid --fork xdg-open $File < /dev/null > /dev/null 2> /dev/null &
}

# ::sorma::webOpen::finish -- the file goes.
proc ::sorma::webOpen::finish {} {
    variable File
    if {$File ne {}} {
        file delete $File
        set File {}
    }
}
