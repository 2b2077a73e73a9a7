# web.tcl -- the server of sorma-web: who may come in, by which address, and where a request goes.
#
# The link opens one browser: its key is exchanged once for a cookie. Programs show a key of their own, as Authorization: Bearer. Each
# request is made in the name of who is logged in (web NAME), never in that of this process: the daemons judge it. With TLS a program may
# show a certificate instead. A browser shows its own to each page that asks, whoever has made that page: so it logs in by a button (webUsers.tcl).
#
# A route leads from METHOD and path (a pattern of regexp) to a command. The command is called with NUMBER, a dict (login session by method path
# query headers body from certificate) and two parts that the pattern has found. It answers by answer, json or stream. Nothing here waits.

package require sorma
package require sorma::json
package require sorma::timer
package require sorma::webServer
package provide sorma::web 1.0

namespace eval ::sorma::web {
    variable Port 0
    variable Tls {}             ;# as webTls gives it; empty: in clear
    variable Hosts {}           ;# names by which a browser may call: with the port, unless it is that of the scheme
    variable Login {}           ;# NAME of web NAME: who has started this
    variable Routes {}          ;# list of {METHOD pattern command}
    variable Open {}            ;# the same, for those that need no login
    variable Keys {}            ;# dict: key of a link -> {when it ends, ms; 0: never, and NAME}
    variable RestKey {}
    variable Sessions {}        ;# dict: what its cookie has -> {login certificate since seen}; certificate: by which it was begun, or empty
    variable Ends {}            ;# dict: NUMBER -> command, for a client that goes before it has its answer
    variable Drains {}          ;# dict: NUMBER of a stream -> command, called when its client has taken all
    variable Owners {}          ;# dict: NUMBER of a stream -> {session certificate}; one of them is empty, or both
    variable Tries {}           ;# dict: address -> wrong keys that may still come from there; one that is not in it: Most
    variable Most 10
    variable Strangers 1000     ;# addresses in Tries
    variable Settings {}        ;# as of start
    # Headers of every answer: nothing is loaded from elsewhere, nothing inline, nothing framed, nothing kept.
    variable Always {
        Content-Security-Policy {default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'}
        X-Content-Type-Options nosniff
        Referrer-Policy no-referrer
        Cross-Origin-Resource-Policy same-origin
        Cross-Origin-Opener-Policy same-origin
        Cache-Control no-store
    }
}

# ::sorma::web::start SETTINGS TLS -- listen, with the settings of sorma-web. TLS: as webTls gives it; empty: in clear. Returns a dict: port link rest.
proc ::sorma::web::start {settings tls} {
    variable Settings $settings
    variable Tls $tls
    variable Port
    variable Hosts
    variable Login [file attributes /proc/self -owner]
    variable RestKey [secret]
    set host [dict get $settings -host]
    set connections [dict get $settings -connections]
    # From elsewhere, nobody takes all connections.
    set words [if {$tls ne {}} {list -keys [dict get $tls keys] -authority [dict get $tls authority] -each [expr {($connections + 1) / 2}]}]
    set Port [::sorma::WebServer open -port [dict get $settings -port] -host $host -command ::sorma::web::Heard -connections $connections \
        -body [dict get $settings -body] -rate [dict get $settings -rate] {*}$words]
    set names [expr {$tls ne {} ? [dict get $tls hosts] : [list [expr {[string match *:* $host] ? "\[$host\]" : $host}] localhost]}]
    set Hosts [lmap name $names {string cat $name [expr {$Port == ($tls eq {} ? 80 : 443) ? {} : ":$Port"}]}]
    Each
    return [dict create port $Port link [link 0] rest $RestKey]
}

# ::sorma::web::stop -- end: all connections are closed.
proc ::sorma::web::stop {} {
    ::sorma::timer::cancel web.*
    ::sorma::WebServer close
}

# ::sorma::web::route METHOD PATTERN COMMAND -- from now on; for any METHOD: *.
proc ::sorma::web::route {method pattern command} {
    variable Routes
    lappend Routes [list $method $pattern $command]
}

# ::sorma::web::open METHOD PATTERN COMMAND -- the same for whoever is not logged in.
proc ::sorma::web::open {method pattern command} {
    variable Open
    lappend Open [list $method $pattern $command]
}

# ::sorma::web::link SECONDS ?NAME? -- a new link, which holds so long and for one exchange, and logs NAME in; 0: until it is used. Default: who
# has started this.
proc ::sorma::web::link {seconds {name {}}} {
    variable Keys
    variable Hosts
    set key [secret]
    dict set Keys $key [list [expr {$seconds == 0 ? 0 : [clock milliseconds] + 1000 * $seconds}] [expr {$name eq {} ? $::sorma::web::Login : $name}]]
    return "[Scheme]://[lindex $Hosts 0]/?key=$key"
}

# ::sorma::web::secret -- 32 bytes that nobody can guess, in hexadecimal digits.
proc ::sorma::web::secret {} {
    set source [::open /dev/urandom rb]
    try {
        return [binary encode hex [read $source 32]]
    } finally {
        close $source
    }
}

# ---- answers ----

# ::sorma::web::answer NUMBER STATUS TYPE BODY ?HEADERS? -- the body is text.
proc ::sorma::web::answer {number status type body {headers {}}} {
    variable Always
    variable Ends
    dict unset Ends $number
    return [::sorma::WebServer answer $number $status [concat $Always [list Content-Type "$type; charset=utf-8"] $headers] [encoding convertto utf-8 $body]]
}
# ::sorma::web::bytes NUMBER TYPE BODY -- the same for bytes, with status 200.
proc ::sorma::web::bytes {number type body} {
    variable Always
    variable Ends
    dict unset Ends $number
    return [::sorma::WebServer answer $number 200 [concat $Always [list Content-Type $type]] $body]
}
# ::sorma::web::json NUMBER STATUS TEXT ?HEADERS?
proc ::sorma::web::json {number status text {headers {}}} {
    answer $number $status application/json $text\n $headers
}
# ::sorma::web::fail NUMBER STATUS MESSAGE ?CODE? ?TRAIL? -- an error as JSON.
proc ::sorma::web::fail {number status message {code {SORMA WEB REFUSED}} {trail {}}} {
    json $number $status [::sorma::json::error $message $code $trail]
}

# ::sorma::web::onEnd NUMBER COMMAND -- call it, once, if the client goes before it has its answer.
proc ::sorma::web::onEnd {number command} {
    variable Ends
    dict set Ends $number $command
}

# ::sorma::web::stream NUMBER REQUEST DRAINED ENDED ?TYPE? -- answer piece by piece: with events, by send; or with what TYPE says, by write and
# finish. DRAINED is called each time the client has taken all, ENDED once, after the last one, unless finish was called.
proc ::sorma::web::stream {number request drained ended {type text/event-stream}} {
    variable Always
    variable Drains
    variable Owners
    dict set Drains $number $drained
    dict set Owners $number [list [dict get $request session] [expr {[dict get $request by] eq "certificate" ? [dict get $request certificate] : {}}]]
    onEnd $number $ended
    ::sorma::WebServer stream $number 200 [concat $Always [list Content-Type $type X-Accel-Buffering no]]
}
# ::sorma::web::send NUMBER EVENT JSON -- one event. waiting NUMBER -- bytes that the client has not taken.
proc ::sorma::web::send {number event json} {
    ::sorma::WebServer write $number "event: $event\ndata: $json\n\n"
}
proc ::sorma::web::waiting number {
    return [::sorma::WebServer waiting $number]
}
# ::sorma::web::write NUMBER TEXT -- a piece of another stream, ASCII. finish NUMBER -- that was all of it.
proc ::sorma::web::write {number text} {
    ::sorma::WebServer write $number $text
}
proc ::sorma::web::finish number {
    variable Ends
    dict unset Ends $number
    End $number
}

# ---- requests ----

proc ::sorma::web::Heard {what number {request {}}} {
    variable Drains
    variable Ends
    switch -- $what {
        request { Take $number $request }
        drained { if {[dict exists $Drains $number]} {uplevel #0 [dict get $Drains $number]} }
        ended { Forget $number }
    }
}
proc ::sorma::web::Forget number {
    variable Drains
    variable Ends
    variable Owners
    dict unset Drains $number
    dict unset Owners $number
    if {[dict exists $Ends $number]} {
        set command [dict get $Ends $number]
        dict unset Ends $number
        uplevel #0 $command
    }
}

# A request is refused as early as can be.
proc ::sorma::web::Take {number request} {
    variable Routes
    variable Open
    set headers [dict get $request headers]
    set wrong [Strange $headers]
    if {$wrong ne {}} {
        return [fail $number {*}$wrong]
    }
    try {
        foreach part {path body} {
            dict set request $part [encoding convertfrom utf-8 [dict get $request $part]]
        }
        dict set request query [dict map {name value} [dict get $request query] {encoding convertfrom utf-8 $value}]
    } on error {} {
        return [fail $number 400 "the request is not UTF-8" {SORMA WEB SYNTAX}]
    }
    set method [dict get $request method]
    if {$method eq "GET" && [dict get $request path] eq "/" && [dict exists $request query key]} {
        return [Exchange $number [dict get $request query key] $request]
    }
    set request [dict merge $request [Who $request]]
    if {[dict get $request by] eq "cookie" && $method ne "GET" && [nowhere $number $request]} return
    set others {}
    foreach route [if {[dict get $request login] eq {}} {concat $Open $Routes} else {set Routes}] {
        lassign $route itsMethod pattern command
        if {![regexp $pattern [dict get $request path] -> {*}[lmap n {a b c} {string cat part$n}]]} continue
        if {$itsMethod ni [list $method *]} {
            lappend others $itsMethod
            continue
        }
        if {[dict get $request login] eq {} && $route ni $Open} {
            return [Closed $number $request]
        }
        return [{*}$command $number $request $parta $partb]
    }
    if {[dict get $request login] eq {}} {
        Closed $number $request
    } elseif {$others ne {}} {
        json $number 405 [::sorma::json::error "$method is not answered there: only [join [lsort -unique $others] { or }] is" {SORMA WEB METHOD} {}] \
            [list Allow [join [lsort -unique $others] {, }]]
    } else {
        fail $number 404 "nothing is at [string range [dict get $request path] 0 200]" {SORMA WEB PATH}
    }
}

# An error, as fail takes it, for a request from another place; empty: it is from here. A page of another site may reach this port by a name of its own;
# the browser tells that name, and the site of the page.
proc ::sorma::web::Strange headers {
    variable Hosts
    if {[llength [lsearch -all -exact [lmap {name value} $headers {set name}] host]] != 1} {
        return [list 400 "one header Host is expected" {SORMA WEB HOST}]
    }
    set host [dict get $headers host]
    if {[string tolower $host] ni $Hosts} {
        return [list 421 "ask for [join $Hosts { or }]: this is not the host that the request names" {SORMA WEB HOST}]
    }
    if {[dict exists $headers origin] && [dict get $headers origin] ne "[Scheme]://$host"} {
        return [list 403 "a page of another origin may not ask" {SORMA WEB ORIGIN}]
    }
}

# ::sorma::web::nowhere NUMBER REQUEST -- does it not say from which origin it comes? Then it is refused here.
proc ::sorma::web::nowhere {number request} {
    if {[dict exists $request headers origin]} {
        return 0
    }
    return [fail $number 403 "a page says where it comes from: the header Origin is missing" {SORMA WEB ORIGIN}]
}

proc ::sorma::web::Scheme {} {
    variable Tls
    return [expr {$Tls eq {} ? "http" : "https"}]
}

# The one who asks: login (empty: nobody), session, and by: cookie, key, certificate or nothing. why: what is wrong with the certificate.
proc ::sorma::web::Who request {
    variable Login
    variable RestKey
    variable Sessions
    set headers [dict get $request headers]
    if {[dict exists $headers authorization]} {
        set known [expr {[dict get $headers authorization] eq "Bearer $RestKey"}]
        return [dict create login [expr {$known ? $Login : {}}] session {} by key]
    }
    if {[dict exists $headers cookie] && [regexp "(?:^|; ?)[Cookie]=(\[0-9a-f\]{64})(?:;|$)" [dict get $headers cookie] -> session]} {
        if {[dict exists $Sessions $session]} {
            dict set Sessions $session seen [clock milliseconds]
            return [dict create login [dict get $Sessions $session login] session $session by cookie]
        }
    }
    # A program. Each browser of today says where a request comes from.
    if {[dict get $request certificate] ne {} && ![dict exists $headers sec-fetch-site] && ![dict exists $headers origin]} {
        if {![catch {::sorma::Visitor [dict get $request certificate]} name]} {
            return [dict create login $name session {} by certificate]
        }
        return [dict create login {} session {} by nothing why $name]
    }
    return {login {} session {} by nothing}
}
# Cookies belong to a host, whatever the port: another server of this host has another name for its own.
proc ::sorma::web::Cookie {} {
    variable Port
    return sorma$Port
}

proc ::sorma::web::Closed {number request} {
    if {[dict exists $request why]} {
        return [fail $number 401 [dict get $request why] {SORMA WEB CERTIFICATE}]
    }
    if {[string match /api* [dict get $request path]]} {
        return [json $number 401 [::sorma::json::error "the key is missing or wrong: send the header Authorization: Bearer KEY; sorma-web prints the key" {SORMA WEB KEY} {}] \
            {WWW-Authenticate Bearer}]
    }
    answer $number 401 text/plain "You are not logged in, or no longer. Open the link that sorma-web prints, or one that a page of yours makes.\n"
}

# ---- logins ----

# The key of a link for a cookie. A page or a file elsewhere may have led here. Then a browser does not send the cookie after a redirection,
# and a page of ours makes the next request.
proc ::sorma::web::Exchange {number key request} {
    variable Keys
    set headers [dict get $request headers]
    if {![mayTry $request]} {
        return [answer $number 429 text/plain "Too many wrong keys have come: wait some seconds.\n" {Retry-After 10}]
    }
    lassign [if {[dict exists $Keys $key]} {dict get $Keys $key}] end name
    if {$end eq {} || $end != 0 && $end < [clock milliseconds]} {
        failedTry $request
        return [answer $number 403 text/plain "This link is used, too old, or was never made. Each link opens one browser; a page of yours makes another one.\n"]
    }
    dict unset Keys $key
    if {[dict exists $headers sec-fetch-site] && [dict get $headers sec-fetch-site] ni {none same-origin}} {
        return [answer $number 200 text/html "<!DOCTYPE html><title>SORMA</title><a href=\"/\">To the pages of SORMA</a>\n" [concat {Refresh 0;url=/} [logIn $name]]]
    }
    answer $number 303 text/plain "\n" [concat {Location /} [logIn $name]]
}

# ::sorma::web::mayTry REQUEST -- may a key or a password be tried from there now?   failedTry REQUEST -- it was wrong.
proc ::sorma::web::mayTry request {
    variable Tries
    variable Strangers
    set from [dict get $request from]
    return [expr {[dict exists $Tries $from] ? [dict get $Tries $from] >= 1 : [dict size $Tries] < $Strangers}]
}
proc ::sorma::web::failedTry request {
    variable Tries
    variable Most
    set from [dict get $request from]
    dict set Tries $from [expr {([dict exists $Tries $from] ? [dict get $Tries $from] : $Most) - 1}]
}

# ::sorma::web::logIn NAME ?CERTIFICATE? -- a session of that login; it ends when its certificate holds no longer. Returns the header that gives its cookie
# to the browser.
proc ::sorma::web::logIn {name {certificate {}}} {
    variable Sessions
    set session [secret]
    set now [clock milliseconds]
    # The one that was seen longest ago makes room.
    while {[dict size $Sessions] >= [dict get $::sorma::web::Settings -sessions]} {
        logOut [lindex [lsort -stride 2 -integer -index 1 [concat {*}[lmap {id facts} $Sessions {list $id [dict get $facts seen]}]]] 0]
    }
    dict set Sessions $session [dict create login $name certificate $certificate since $now seen $now]
    return [SetCookie $session]
}
proc ::sorma::web::SetCookie {session {more {}}} {
    return [list Set-Cookie "[Cookie]=$session; Path=/; HttpOnly; SameSite=Strict[expr {[Scheme] eq "https" ? {; Secure} : {}}]$more"]
}

# ::sorma::web::logOut SESSION -- its cookie opens nothing any more, and its streams end.
proc ::sorma::web::logOut session {
    variable Sessions
    variable Owners
    dict unset Sessions $session
    dict for {number owner} $Owners {
        if {[lindex $owner 0] eq $session} {
            End $number
        }
    }
}
proc ::sorma::web::End number {
    ::sorma::WebServer end $number
    Forget $number
}

# Does a certificate hold no longer? The files of keys are read when they have changed.
proc ::sorma::web::Void certificate {
    return [expr {$certificate ne {} && [catch {::sorma::Visitor $certificate}]}]
}

# Once a second: a wrong key more may come from each address. Old sessions and links end, and what a certificate has begun that holds no longer.
proc ::sorma::web::Each {} {
    variable Tries
    variable Most
    variable Sessions
    variable Settings
    variable Owners
    variable Keys
    ::sorma::timer::once web.each 1000 ::sorma::web::Each
    set Tries [dict filter [dict map {from left} $Tries {incr left}] script {from left} {expr {$left < $Most}}]
    set now [clock milliseconds]
    set open [lmap owner [dict values $Owners] {lindex $owner 0}]
    dict for {session facts} $Sessions {
        if {$now - [dict get $facts seen] > 1000 * [dict get $Settings -idle] && $session ni $open \
            || $now - [dict get $facts since] > 1000 * [dict get $Settings -longest] || [Void [dict get $facts certificate]]} {
            logOut $session
        }
    }
    dict for {number owner} $Owners {
        if {[Void [lindex $owner 1]]} {
            End $number
        }
    }
    set Keys [dict filter $Keys script {key facts} {expr {[lindex $facts 0] == 0 || [lindex $facts 0] >= $now}}]
}

# ---- the session of a browser ----

proc ::sorma::web::LogOut {number request args} {
    logOut [dict get $request session]
    json $number 200 {{}} [SetCookie {} {; Max-Age=0}]
}
proc ::sorma::web::NewLink {number request args} {
    json $number 200 "{\"link\":[::sorma::json::text [link 300 [dict get $request login]]]}"
}
::sorma::web::route POST {^/logout$} ::sorma::web::LogOut
::sorma::web::route POST {^/link$} ::sorma::web::NewLink
