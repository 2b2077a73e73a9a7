# webImage.tcl -- pictures that objects hand out in `any`, for the pages of sorma-web.
#
#     POST /api/NAME@DAEMON/image        words > the picture of the reply to EXEC with these words
#
# PNG and JPEG go as they are, so do PGM and PPM. A raw picture, as camera has it, gets the head of PGM or PPM: its width and height are the
# floats 1 and 2. A client asks for the next one when it has shown the last one, so nothing queues. Those who ask the same in the name of the
# same login, while it is under way, share one request.

package require sorma::web
package require sorma::webRest
package require sorma::world
package provide sorma::webImage 1.0

namespace eval ::sorma::webImage {
    variable Asked {}           ;# dict: {login daemon request} -> {id of the request, numbers that wait for it}
}

# ::sorma::webImage::begin -- serve its route.
proc ::sorma::webImage::begin {} {
    ::sorma::web::route POST {^/api/([^/]+)/image$} ::sorma::webImage::Post
}

proc ::sorma::webImage::Post {number request name args} {
    variable Asked
    try {
        lassign [::sorma::webRest::place $name] object daemon
        set words [list $object EXEC {*}[::sorma::webRest::words $request ctrl]]
    } on error {message how} {
        return [::sorma::webRest::failed $number [dict get $how -errorcode] $message]
    }
    set what [list [dict get $request login] $daemon $words]
    ::sorma::web::onEnd $number [list ::sorma::webImage::Left $what $number]
    if {[dict exists $Asked $what]} {
        dict set Asked $what [linsert [dict get $Asked $what] end $number]
        return
    }
    dict set Asked $what [list {} $number]
    set id [::sorma::world ask $daemon $words -as "web [dict get $request login]" -timeout 25000 -command [list ::sorma::webImage::Answered $what]]
    if {[dict exists $Asked $what]} {
        dict set Asked $what [lreplace [dict get $Asked $what] 0 0 $id]
    }
}

# A client has gone. The last one of them has given the request up.
proc ::sorma::webImage::Left {what number} {
    variable Asked
    if {![dict exists $Asked $what]} return
    set numbers [lassign [dict get $Asked $what] id]
    set numbers [lsearch -all -inline -not -exact $numbers $number]
    if {$numbers ne {}} {
        dict set Asked $what [list $id {*}$numbers]
        return
    }
    dict unset Asked $what
    if {$id ne {}} {
        ::sorma::world cancel [lindex $what 1] $id
    }
}

proc ::sorma::webImage::Answered {what status value} {
    variable Asked
    if {![dict exists $Asked $what]} return
    set numbers [lrange [dict get $Asked $what] 1 end]
    dict unset Asked $what
    if {$status eq "ok"} {
        try {
            lassign [picture $value] type bytes
        } on error {message how} {
            set status error
            set value [list "[lindex $what 2 0]@[lindex $what 1]: $message" [dict get $how -errorcode] {}]
        }
    }
    foreach number $numbers {
        if {$status eq "ok"} {
            ::sorma::web::bytes $number $type $bytes
        } else {
            ::sorma::webRest::failed $number [lindex $value 1] [lindex $value 0] [lindex $value 2]
        }
    }
}

# ::sorma::webImage::picture REPLY -- of what a reply has: its type and its bytes. Error IMAGE FORMAT.
proc ::sorma::webImage::picture reply {
    set bytes [if {[dict exists $reply any]} {dict get $reply any}]
    foreach {head type} {P5 image/x-portable-anymap P6 image/x-portable-anymap \x89PNG image/png \xff\xd8\xff image/jpeg} {
        if {[string equal -length [string length $head] $head $bytes]} {
            return [list $type $bytes]
        }
    }
    set length [string length $bytes]
    lassign [if {[dict exists $reply floats]} {dict get $reply floats}] - width height
    if {[string is double -strict $width] && [string is double -strict $height] && $width >= 1 && $height >= 1 && $width * $height <= $length} {
        set pixels [expr {int($width) * int($height)}]
        foreach {channels head} {1 P5 3 P6} {
            if {$length == $channels * $pixels} {
                return [list image/x-portable-anymap "$head\n[expr {int($width)}] [expr {int($height)}]\n255\n$bytes"]
            }
        }
    }
    return -code error -errorcode {SORMA IMAGE FORMAT} "the reply has no picture: PNG, JPEG, PPM, PGM, or raw pixels with width and height as the floats 1 and 2 are expected\
        in its part any; it has [expr {$length == 0 ? "nothing there" : "$length other bytes"}]"
}
