# webUsers.tcl -- users of sorma-web with passwords: each acts as web NAME.
#
# A file has a line NAME:HASH for each, as crypt(3) takes it; `openssl passwd -6` makes a HASH. It is read at each login, so changes act at
# once. Wrong passwords are as rare as wrong keys may be. Logins that last already stay.

package require json
package require sorma::web
package require sorma::webPages
package provide sorma::webUsers 1.0

namespace eval ::sorma::webUsers {
    variable File
    # For a name that is not there the same work is done, so that nobody learns names by the time it takes.
    variable Nobody {$6$nobodynobody$}
}

# ::sorma::webUsers::begin FILE -- let those of the file log in. Fails when others may read or write it.
proc ::sorma::webUsers::begin file {
    variable File [file normalize $file]
    Users
    ::sorma::web::open GET {^/$} {::sorma::webPages::send login.html}
    ::sorma::web::open GET {^/page/(style\.css|login\.js|dom\.js|bus\.js|icon\.svg)$} ::sorma::webPages::named
    ::sorma::web::open POST {^/login$} ::sorma::webUsers::LogIn
}

# A dict: NAME -> HASH.
proc ::sorma::webUsers::Users {} {
    variable File
    file stat $File facts
    if {$facts(type) ne "file" || ($facts(mode) & 0o077) != 0} {
        return -code error -errorcode [list SORMA WEB USERS $File] "$File: others may read or write it, or it is no file; chmod go= it"
    }
    set in [open $File]
    try {
        set lines [split [read $in] \n]
    } finally {
        close $in
    }
    set users {}
    set n 0
    foreach line $lines {
        incr n
        if {[string trim $line] eq {} || [string match #* $line]} continue
        if {![regexp {^([A-Za-z0-9._-]{1,32}):(\$\S+)$} $line -> name hash]} {
            return -code error -errorcode [list SORMA WEB USERS $File] "$File, line $n: expected NAME:HASH, with a HASH as openssl passwd -6 makes it"
        }
        dict set users $name $hash
    }
    return $users
}

proc ::sorma::webUsers::LogIn {number request args} {
    variable Nobody
    if {[::sorma::web::nowhere $number $request]} return
    if {[catch {
        set given [::json::json2dict [dict get $request body]]
        set name [dict get $given name]
        set password [encoding convertto utf-8 [dict get $given password]]
    }]} {
        return [::sorma::web::fail $number 400 "name and password are expected, as JSON" {SORMA WEB JSON}]
    }
    if {![::sorma::web::mayTry]} {
        return [::sorma::web::fail $number 429 "too many wrong passwords have come: wait some seconds" {SORMA WEB LIMIT}]
    }
    set users [Users]
    set hash [expr {[dict exists $users $name] ? [dict get $users $name] : $Nobody}]
    if {[::sorma::WebServer crypt $password $hash] ne $hash} {
        ::sorma::web::failedTry
        return [::sorma::web::fail $number 403 "the name or the password is wrong" {SORMA WEB PASSWORD}]
    }
    ::sorma::web::json $number 200 {{}} [::sorma::web::logIn $name]
}
