# webUsers.tcl -- users of sorma-web with passwords or certificates: each acts as web NAME.
#
# A file has a line NAME:HASH for each, as crypt(3) takes it; `openssl passwd -6` makes a HASH. It is read at each login, so changes act at
# once. Wrong passwords are as rare as wrong keys may be. Logins that last already stay.
#
# With TLS a browser may show a certificate of our own authority: NAME is the name in it. It becomes a login by a button, and ends like any other.

package require json
package require sorma::json
package require sorma::text
package require sorma::web
package require sorma::webPages
package provide sorma::webUsers 1.0

namespace eval ::sorma::webUsers {
    variable File               ;# empty: nobody has a password
    # For a name that is not there the same work is done, so that nobody learns names by the time it takes.
    variable Nobody {$6$nobodynobody$}
}

# ::sorma::webUsers::begin FILE -- let those of the file log in, and those with a certificate. FILE may be empty. Fails when others may read or write it.
proc ::sorma::webUsers::begin file {
    variable File [expr {$file eq {} ? {} : [file normalize $file]}]
    if {$File ne {}} Users
    ::sorma::web::open GET {^/$} {::sorma::webPages::send login.html}
    ::sorma::web::open GET {^/page/(style\.css|login\.js|dom\.js|bus\.js|icon\.svg)$} ::sorma::webPages::named
    ::sorma::web::open GET {^/login$} ::sorma::webUsers::Ways
    ::sorma::web::open POST {^/login$} ::sorma::webUsers::LogIn
}

# The ways in for this browser: passwords: are there any; certificate: the name in its own, or empty; why: an error of that certificate.
proc ::sorma::webUsers::Ways {number request args} {
    variable File
    lassign [Shown $request] name why
    ::sorma::web::json $number 200 [::sorma::json::object [list passwords [expr {$File eq {} ? "false" : "true"}] certificate [::sorma::json::text $name] why [::sorma::json::text $why]]]
}
# Its name, and what is wrong with it; both are empty when there is none.
proc ::sorma::webUsers::Shown request {
    set certificate [dict get $request certificate]
    if {$certificate eq {}} {
        return {{} {}}
    }
    return [if {[catch {::sorma::Visitor $certificate} name]} {list {} $name} else {list $name {}}]
}

# A dict: NAME -> HASH.
proc ::sorma::webUsers::Users {} {
    variable File
    file stat $File facts
    if {$facts(type) ne "file" || ($facts(mode) & 0o077) != 0} {
        return -code error -errorcode [list SORMA WEB USERS $File] "$File: others may read or write it, or it is no file; chmod go= it"
    }
    set users {}
    set n 0
    foreach line [split [::sorma::text::readFile $File] \n] {
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
    variable File
    if {[::sorma::web::nowhere $number $request]} return
    if {[catch {::json::json2dict [dict get $request body]} given] || [catch {dict size $given}]} {
        return [::sorma::web::fail $number 400 "JSON is expected" {SORMA WEB JSON}]
    }
    if {[dict exists $given certificate]} {
        lassign [Shown $request] name why
        if {$name eq {}} {
            return [::sorma::web::fail $number 403 [expr {$why eq {} ? "the browser has shown no certificate" : $why}] {SORMA WEB CERTIFICATE}]
        }
        return [::sorma::web::json $number 200 {{}} [::sorma::web::logIn $name [dict get $request certificate]]]
    }
    if {$File eq {} || ![dict exists $given name] || ![dict exists $given password]} {
        return [::sorma::web::fail $number 400 [expr {$File eq {} ? "nobody has a password here" : "name and password are expected"}] {SORMA WEB JSON}]
    }
    Password $number $request [dict get $given name] [encoding convertto utf-8 [dict get $given password]]
}
proc ::sorma::webUsers::Password {number request name password} {
    variable Nobody
    if {![::sorma::web::mayTry $request]} {
        return [::sorma::web::fail $number 429 "too many wrong passwords have come: wait some seconds" {SORMA WEB LIMIT}]
    }
    set users [Users]
    set hash [expr {[dict exists $users $name] ? [dict get $users $name] : $Nobody}]
    if {[::sorma::WebServer crypt $password $hash] ne $hash} {
        ::sorma::web::failedTry $request
        return [::sorma::web::fail $number 403 "the name or the password is wrong" {SORMA WEB PASSWORD}]
    }
    ::sorma::web::json $number 200 {{}} [::sorma::web::logIn $name]
}
