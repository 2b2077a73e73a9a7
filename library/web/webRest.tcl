# webRest.tcl -- the bus as REST, for sorma-web: requests with JSON, as --json of scott gives it.
#
#     GET  /api                          daemons, and objects of each that one may see
#     GET  /api/NAME@DAEMON              values of its options
#     GET  /api/NAME@DAEMON/table        the table of its class
#     GET  /api/NAME@DAEMON/openapi      the same as a description of OpenAPI
#     POST /api/NAME@DAEMON/exec         text floats ints any words > the reply
#     POST /api/NAME@DAEMON/ctrl, dbx    words > the reply; ctrl?page=ID: see webGuard.tcl
#
# Each is asked in the name of who is logged in. A client that hangs up has given its request up. A large reply becomes JSON piece by piece, at
# the pace of the client, and others are served meanwhile.

package require json
package require sorma::json
package require sorma::options
package require sorma::table
package require sorma::web
package require sorma::webGuard
package require sorma::world
package provide sorma::webRest 1.0

namespace eval ::sorma::webRest {
    variable Longest 600        ;# s that a request may take
    variable Largest 4000000    ;# characters of a table: others wait while it becomes JSON
    variable Piecemeal 10000    ;# characters or numbers of a reply: one with more is sent piece by piece
    variable Most 50000000      ;# characters and numbers of all such replies together; one alone may have more
    variable Sending {}         ;# dict: NUMBER -> its characters and numbers
    # Error codes of the bus as a status of HTTP; the first that fits.
    variable Statuses {
        {SORMA COMM DENIED *} 403 {SORMA COMM TIMEOUT *} 504 {SORMA COMM TOO_BIG *} 413 {SORMA COMM LIMIT *} 429 {SORMA COMM CANCELLED *} 499
        {SORMA COMM *} 503 {SORMA NAME UNKNOWN*} 404 {SORMA SERVICE GONE *} 404 {SORMA NAME *} 400 {SORMA REQUEST *} 400 {SORMA OPTION *} 400
        {SORMA WEB PAGE *} 409 {SORMA WEB PLACE *} 404 {SORMA WEB TYPE *} 415 {SORMA WEB *} 400 * 500
    }
}

# ::sorma::webRest::begin -- serve its routes.
proc ::sorma::webRest::begin {} {
    ::sorma::web::route GET {^/api$} ::sorma::webRest::List
    ::sorma::web::route GET {^/api/([^/]+)$} ::sorma::webRest::Values
    ::sorma::web::route GET {^/api/([^/]+)/(table|openapi)$} ::sorma::webRest::Table
    ::sorma::web::route POST {^/api/([^/]+)/(exec|ctrl|dbx)$} ::sorma::webRest::Post
}

# ::sorma::webRest::place NAME -- of foo.a@robot: foo.a robot. Only a daemon that the model knows: a browser leads this process nowhere else.
proc ::sorma::webRest::place name {
    if {![regexp {^([^@\s]+)@([^@\s]+)$} $name -> object daemon]} {
        return -code error -errorcode [list SORMA WEB PLACE $name] "a name is OBJECT@DAEMON, such as foo.a@robot; got \"[string range $name 0 100]\""
    }
    if {$daemon eq "self" || $daemon ni [::sorma::world keys]} {
        return -code error -errorcode [list SORMA WEB PLACE $name] "no daemon \"[string range $daemon 0 100]\" is known here; GET /api lists those that are"
    }
    return [list $object $daemon]
}

# ::sorma::webRest::ask LOGIN NUMBER DAEMON REQUEST PREFIX ?SECONDS? -- in the name of LOGIN. When the client of NUMBER goes, the request is cancelled.
proc ::sorma::webRest::ask {login number daemon request prefix {seconds 25}} {
    set id [::sorma::world ask $daemon $request -as "web $login" -timeout [expr {round(1000 * $seconds)}] -command $prefix]
    if {$id ne {}} {
        ::sorma::web::onEnd $number [list ::sorma::world cancel $daemon $id]
    }
}

# ::sorma::webRest::failed NUMBER CODE MESSAGE ?TRAIL?
proc ::sorma::webRest::failed {number code message {trail {}}} {
    variable Statuses
    dict for {pattern status} $Statuses {
        if {[string match $pattern "$code "]} {
            return [::sorma::web::fail $number $status $message $code $trail]
        }
    }
}

proc ::sorma::webRest::List {number request args} {
    set daemons [lmap key [::sorma::world keys] {
        if {$key eq "self"} continue
        set facts [::sorma::world get $key]
        ::sorma::json::object [list name [::sorma::json::text $key] state [::sorma::json::text [dict get $facts state]]]
    }]
    ::sorma::web::json $number 200 [::sorma::json::object [list daemons [::sorma::json::array $daemons]]]
}

# Its table; the answer is made by COMMAND.
proc ::sorma::webRest::Describe {number request name command} {
    try {
        lassign [place $name] object daemon
    } on error {message how} {
        return [failed $number [dict get $how -errorcode] $message]
    }
    ask [dict get $request login] $number $daemon [list sorm DBX -describe $object] [list ::sorma::webRest::Described $number $name $command]
}
proc ::sorma::webRest::Described {number name command status value} {
    if {$status ne "ok"} {
        return [failed $number [lindex $value 1] [lindex $value 0] [lindex $value 2]]
    }
    variable Largest
    set table [dict get $value text]
    set size [string length $table]
    if {$size > $Largest} {
        return [failed $number [list SORMA COMM TOO_BIG $name] "$name: its table has $size characters; at most $Largest are read"]
    }
    if {![dict get $table exists] && $command eq "::sorma::webRest::ValuesOf"} {
        return [failed $number [list SORMA SERVICE GONE $name] "$name: there is no such object"]
    }
    ::sorma::web::json $number 200 [{*}$command $name $table]
}

proc ::sorma::webRest::Values {number request name args} {
    Describe $number $request $name ::sorma::webRest::ValuesOf
}
proc ::sorma::webRest::ValuesOf {name table} {
    return [::sorma::json::object [concat {*}[lmap option [dict get $table options] {
        lassign $option word type unit range default value
        list $word [::sorma::json::typed $type $value]
    }]]]
}
proc ::sorma::webRest::Table {number request name what} {
    Describe $number $request $name [dict get {table ::sorma::webRest::tableOf openapi ::sorma::webRest::OpenApi} $what]
}

# A range as a list: choices, or the two ends of what has two.
proc ::sorma::webRest::Range {type range} {
    if {$type eq "enum"} {
        return $range
    }
    set limits [::sorma::table::limits $type $range]
    return [if {{} ni $limits} {set limits}]
}

# ::sorma::webRest::tableOf NAME TABLE -- the table of a class, as JSON; with the values of the object, when it is there.
proc ::sorma::webRest::tableOf {name table} {
    set options [lmap option [dict get $table options] {
        lassign $option word type unit range default value help
        set parts [list name [::sorma::json::text $word] type [::sorma::json::text $type] unit [::sorma::json::text $unit]]
        lappend parts range [::sorma::json::array [lmap item [Range $type $range] {if {$type eq "enum"} {::sorma::json::text $item} else {::sorma::json::number $item}}]]
        lappend parts limits [::sorma::json::text [expr {$type eq "enum" ? {} : $range}]]
        lappend parts default [::sorma::json::typed $type $default] help [::sorma::json::text $help]
        lappend parts fixed [expr {$word in [dict get $table fixed]}]
        if {[dict get $table exists]} {
            lappend parts value [::sorma::json::typed $type $value]
        }
        ::sorma::json::object $parts
    }]
    set actions [lmap action [dict get $table actions] {
        set word [lindex $action 0]
        set danger [if {[dict exists $table danger $word]} {dict get $table danger $word}]
        ::sorma::json::object [list name [::sorma::json::text $word] arguments [::sorma::json::text [lindex $action 1]] \
            help [::sorma::json::text [lindex $action 2]] danger [::sorma::json::text $danger]]
    }]
    set parts [list name [::sorma::json::text $name] exists [dict get $table exists]]
    foreach key {class purpose signature example help} {
        lappend parts $key [::sorma::json::text [dict get $table $key]]
    }
    lappend parts writes [::sorma::json::texts [lmap part [dict get $table writes] {lindex $part 0}]]
    return [::sorma::json::object [concat $parts [list options [::sorma::json::array $options] actions [::sorma::json::array $actions]]]]
}

# ---- requests ----

proc ::sorma::webRest::Post {number request name method} {
    try {
        lassign [place $name] object daemon
        set words [list $object [string toupper $method] {*}[words $request $method]]
        set seconds [Seconds $request]
        set page [if {$method eq "ctrl"} {::sorma::webGuard::page $request $name}]
        set begun [if {$page ne {}} {::sorma::webGuard::begin $page $name [lrange $words 2 end]}]
    } on error {message how} {
        return [failed $number [dict get $how -errorcode] $message]
    }
    ask [dict get $request login] $number $daemon $words [list ::sorma::webRest::Replied $number $request $begun] $seconds
}
proc ::sorma::webRest::Replied {number request begun status value} {
    if {$begun ne {}} {
        ::sorma::webGuard::heard $begun $status $value
    }
    if {$status ne "ok"} {
        return [failed $number [lindex $value 1] [lindex $value 0] [lindex $value 2]]
    }
    variable Piecemeal
    set size [Size $value]
    if {$size <= $Piecemeal} {
        ::sorma::web::json $number 200 [::sorma::json::reply $value]
    } else {
        SendLarge $number $request $size $value
    }
}
# Characters and numbers of a reply.
proc ::sorma::webRest::Size reply {
    return [::tcl::mathop::+ {*}[lmap {field length} {text {string length} any {string length} floats llength ints llength} {
        if {![dict exists $reply $field]} continue
        {*}$length [dict get $reply $field]
    }]]
}
proc ::sorma::webRest::SendLarge {number request size reply} {
    variable Most
    variable Sending
    set all [expr {$size + [::tcl::mathop::+ {*}[dict values $Sending]]}]
    if {$all > $Most && [dict size $Sending] > 0} {
        return [failed $number {SORMA COMM LIMIT replies} "clients have yet to take replies of [expr {$all - $size}] characters and numbers, and this has $size: try again later"]
    }
    dict set Sending $number $size
    set sender ::sorma::webRest::sender$number
    ::sorma::web::stream $number $request [list ::sorma::webRest::Go $sender] [list ::sorma::webRest::Sent $number] "application/json; charset=utf-8"
    coroutine $sender ::sorma::webRest::Send $number $reply
}
# A coroutine, which goes on when the client has taken a piece. Between two of them others have their turn.
proc ::sorma::webRest::Send {number reply} {
    ::sorma::json::pieces $reply [list ::sorma::webRest::Piece $number]
    Piece $number \n
    Sent $number
    ::sorma::web::finish $number
}
proc ::sorma::webRest::Piece {number piece} {
    ::sorma::web::write $number $piece
    yield
}
proc ::sorma::webRest::Go sender {
    if {[info commands $sender] ne {}} {
        $sender
    }
}
proc ::sorma::webRest::Sent number {
    variable Sending
    dict unset Sending $number
    set sender ::sorma::webRest::sender$number
    if {[info commands $sender] ne {} && [info coroutine] ne $sender} {
        rename $sender {}
    }
}

proc ::sorma::webRest::Seconds request {
    variable Longest
    if {![dict exists $request query timeout]} {
        return 25
    }
    return [::sorma::options::check timeout [list seconds 0.001 $Longest] [dict get $request query timeout]]
}

# ::sorma::webRest::words REQUEST METHOD -- the words that its body has, which is JSON: those of exec, ctrl or dbx.
proc ::sorma::webRest::words {request method} {
    set type [if {[dict exists $request headers content-type]} {dict get $request headers content-type}]
    if {![regexp -nocase {^application/json\s*(?:;|$)} $type]} {
        return -code error -errorcode {SORMA WEB TYPE} "the body is JSON: send the header Content-Type: application/json"
    }
    return [Words $method [dict get $request body]]
}
# Wrong JSON is told to whoever sent it.
proc ::sorma::webRest::Words {method body} {
    set known [if {$method eq "exec"} {list text floats ints any words} else {list words}]
    if {[string trim $body] eq {}} {
        return
    }
    if {![regexp {^\s*\{} $body] || [catch {::json::json2dict $body} members] || [catch {dict size $members}]} {
        Wrong "the body is no JSON object"
    }
    dict for {key value} $members {
        if {$key ni $known} {
            Wrong "unknown member \"[string range $key 0 100]\"; expected [::sorma::options::oneOf $known]"
        }
        if {$key ni {text any} && [catch {llength $value}]} {
            Wrong "$key is a list"
        }
    }
    set out {}
    foreach {key word kind} {text TMSG {} floats FMSG double ints IMSG wideinteger any AMSG {}} {
        if {![dict exists $members $key]} continue
        set value [dict get $members $key]
        if {$kind eq {}} {
            lappend out $word $value
            continue
        }
        foreach item $value {
            if {![string is $kind -strict $item]} {
                Wrong "$key has numbers; got \"[string range $item 0 100]\""
            }
        }
        lappend out $word [llength $value] {*}$value
    }
    return [concat $out [if {[dict exists $members words]} {dict get $members words}]]
}
proc ::sorma::webRest::Wrong text {
    return -level 2 -code error -errorcode {SORMA WEB JSON} "$text: send such as {\"words\":\[\"-tempo\",\"presto\"\]}"
}

# ---- OpenAPI ----

proc ::sorma::webRest::OpenApi {name table} {
    set properties [lmap option [dict get $table options] {
        lassign $option word type unit range default value help
        set schema [switch -- $type {
            flag { string cat {"type":"integer","enum":[0,1]} }
            int { string cat {"type":"integer"} }
            double { string cat {"type":"number"} }
            vector { string cat {"type":"array","items":{"type":"number"}} }
            default { string cat {"type":"string"} }
        }]
        if {$type eq "enum"} {
            append schema ",\"enum\":\[[join [lmap item [Range enum $range] {::sorma::json::text $item}] ,]\]"
        } elseif {$type in {int double}} {
            foreach key {minimum maximum} bound [Range $type $range] {
                if {[string is double -strict $bound] && abs($bound) < 1e300} {
                    append schema ",\"$key\":[::sorma::json::number $bound]"
                }
            }
        }
        string cat [::sorma::json::text $word] ":{" $schema ",\"description\":" [::sorma::json::text [string trim "$help[expr {$unit eq {} ? {} : " \[$unit\]"}]"]] "}"
    }]
    set path /api/[Escaped $name]
    set reply {{"type":"object","properties":{"code":{"type":"integer"},"text":{"type":"string"},"floats":{"type":"array","items":{"type":"number"}},"ints":{"type":"array","items":{"type":"integer"}},"any":{"type":"string","contentEncoding":"base64"},"trail":{"type":"array","items":{"type":"object"}}},"required":["code"]}}
    set wrong {{"type":"object","properties":{"error":{"type":"object","properties":{"message":{"type":"string"},"code":{"type":"array","items":{"type":"string"}},"trail":{"type":"array","items":{"type":"object"}}}}}}}
    set words {"words":{"type":"array","items":{"type":"string"}}}
    set message {"text":{"type":"string"},"floats":{"type":"array","items":{"type":"number"}},"ints":{"type":"array","items":{"type":"integer"}},"any":{"type":"string","contentEncoding":"base64"}}
    set paths [list "[::sorma::json::text $path]:{\"get\":[Operation "the values of the options" {} {{"$ref":"#/components/schemas/Options"}}]}"]
    foreach {method what members} [list exec [dict get $table purpose] "$message,$words" ctrl "set options and act" $words dbx "look inside" $words] {
        lappend paths "[::sorma::json::text $path/$method]:{\"post\":[Operation $what "{\"type\":\"object\",\"properties\":{$members},\"additionalProperties\":false}" {{"$ref":"#/components/schemas/Reply"}}]}"
    }
    return "{\"openapi\":\"3.1.0\",\"info\":{\"title\":[::sorma::json::text $name],\"version\":[::sorma::json::text [dict get $table version]],\"description\":[::sorma::json::text [dict get $table help]]},\
\"security\":\[{\"key\":\[\]}\],\"paths\":{[join $paths ,]},\"components\":{\"securitySchemes\":{\"key\":{\"type\":\"http\",\"scheme\":\"bearer\"}},\
\"schemas\":{\"Options\":{\"type\":\"object\",\"properties\":{[join $properties ,]}},\"Reply\":$reply,\"Error\":$wrong}}}"
}
proc ::sorma::webRest::Operation {summary body reply} {
    set parts [list "\"summary\":[::sorma::json::text $summary]"]
    if {$body ne {}} {
        lappend parts "\"requestBody\":{\"content\":{\"application/json\":{\"schema\":$body}}}"
    }
    lappend parts "\"responses\":{\"200\":{\"description\":\"done\",\"content\":{\"application/json\":{\"schema\":$reply}}},\"default\":{\"description\":\"an error\",\"content\":{\"application/json\":{\"schema\":{\"\$ref\":\"#/components/schemas/Error\"}}}}}"
    return "{[join $parts ,]}"
}
# A text as a part of a path.
proc ::sorma::webRest::Escaped text {
    set out {}
    foreach c [split [encoding convertto utf-8 $text] {}] {
        append out [if {[regexp {[A-Za-z0-9._~@:-]} $c]} {set c} else {format %%%02X [scan $c %c]}]
    }
    return $out
}
