# webPages.tcl -- the files of the pages of sorma-web, and their one style sheet: its colours are those of the Tk theme.

package require sorma::colours
package require sorma::text
package require sorma::web
package require sorma::webLive
package provide sorma::webPages 1.0

namespace eval ::sorma::webPages {
    variable Folder [file join $::sorma::library page]
    variable Types {.html text/html .js text/javascript .css text/css .svg image/svg+xml}
    variable Files {}       ;# dict: name -> content; what is not in the folder at the beginning is not served
}

# ::sorma::webPages::begin -- read the files, and serve them.
proc ::sorma::webPages::begin {} {
    variable Folder
    variable Files
    foreach name [glob -tails -directory $Folder *.html *.js *.css *.svg] {
        dict set Files $name [::sorma::text::readFile [file join $Folder $name]]
    }
    dict set Files style.css [::sorma::colours::css][dict get $Files style.css]
    ::sorma::web::route GET {^/$} {::sorma::webPages::send index.html}
    ::sorma::web::route GET {^/page/([a-zA-Z]+\.(?:js|css|svg))$} ::sorma::webPages::named
    ::sorma::webLive::begin
}

# ::sorma::webPages::send NAME NUMBER -- answer with a file.   named NUMBER REQUEST NAME -- the same, for a route.
proc ::sorma::webPages::send {name number args} {
    variable Files
    variable Types
    ::sorma::web::answer $number 200 [dict get $Types [file extension $name]] [dict get $Files $name]
}
proc ::sorma::webPages::named {number request name args} {
    variable Files
    if {![dict exists $Files $name]} {
        return [::sorma::web::fail $number 404 "there is no page $name" {SORMA WEB PATH}]
    }
    send $name $number
}
