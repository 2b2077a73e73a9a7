# webDriver.tcl -- a browser for tests: Chromium without a window, told by its driver what to do (W3C WebDriver).
#
# webDriver::start ?-size {WIDTH HEIGHT}? ?-hosts RULES? ?-authority FILE? ?-certificate {FILE PASSPHRASE}?   begins. hosts: as of Chromium's
#     --host-resolver-rules. The authority is trusted (PEM), and the certificate shown wherever one is asked for (PKCS #12).
# webDriver::stop
# webDriver::go URL
# webDriver::run SCRIPT ?ARG ...?               value of a script of the page: return ...
# webDriver::click CSS;  webDriver::type CSS TEXT;  webDriver::keys TEXT (to where the focus is)
# webDriver::size WIDTH HEIGHT;  webDriver::dark BOOL
# webDriver::network MS BYTES                   a slow network: delay, and bytes in a second (-1: as many as come)
# webDriver::picture FILE                       a PNG of what can be seen

package require json
package require sorma::json
namespace eval webDriver {
    variable Pipe {}
    variable Port
    variable Session {}
    variable Folder
}

proc webDriver::start args {
    variable Pipe
    variable Port
    variable Session
    variable Folder [exec mktemp -d /tmp/sorma-browser-XXXXXX]
    set settings [dict merge {-size {1280 900} -hosts {} -authority {} -certificate {}} $args]
    # All that it keeps goes with the folder, also what it writes while it ends.
    set homes [lmap kind {CONFIG CACHE DATA STATE} {string cat XDG_${kind}_HOME= [file join $Folder [string tolower $kind]]}]
    Keys [dict get $settings -authority] [dict get $settings -certificate]
    set Pipe [open [list | env HOME=$Folder TMPDIR=$Folder {*}$homes chromedriver --port=0 2>@1] r]
    while {![regexp {started successfully on port (\d+)} [gets $Pipe] -> Port]} {
        if {[eof $Pipe]} {
            error "chromedriver does not start"
        }
    }
    # Later output is thrown away, so that the pipe does not fill.
    fconfigure $Pipe -blocking 0
    fileevent $Pipe readable [list ::webDriver::Drain $Pipe]
    set words [list --headless=new --no-sandbox --disable-gpu --disable-dev-shm-usage --hide-scrollbars --force-device-scale-factor=1 --user-data-dir=[file join $Folder profile] \
        --window-size=[join [dict get $settings -size] ,]]
    if {[dict get $settings -hosts] ne {}} {
        lappend words --host-resolver-rules=[dict get $settings -hosts]
    }
    set list [join [lmap word $words {sorma::json::text $word}] ,]
    # Nobody is asked which certificate to show.
    set prefs [expr {[dict get $settings -certificate] eq {} ? "{}" : {{"profile.managed_auto_select_certificate_for_urls":["{\"pattern\":\"*\",\"filter\":{}}"]}}}]
    set Session [dict get [Ask POST /session "{\"capabilities\":{\"alwaysMatch\":{\"goog:chromeOptions\":{\"args\":\[$list\],\"prefs\":$prefs}}}}"] sessionId]
    size {*}[dict get $settings -size]
}
# The browser's own store of keys, below its home.
proc webDriver::Keys {authority certificate} {
    variable Folder
    if {$authority eq {} && $certificate eq {}} return
    set store [file join $Folder .pki nssdb]
    file mkdir $store
    exec certutil -d sql:$store -N --empty-password 2>@1
    if {$authority ne {}} {
        exec certutil -d sql:$store -A -t C,, -n authority -i $authority 2>@1
    }
    if {$certificate ne {}} {
        lassign $certificate file passphrase
        exec pk12util -d sql:$store -i $file -W $passphrase 2>@1
    }
}
proc webDriver::stop {} {
    variable Pipe
    variable Session
    variable Folder
    if {$Session ne {}} {
        catch {Ask DELETE /session/$Session}
    }
    if {$Pipe ne {}} {
        catch {exec sh -c {kill "$@"} kill [pid $Pipe]}
        catch {close $Pipe}
    }
    set Pipe [set Session {}]
    waitFor {![catch {file delete -force $Folder}]}
}

proc webDriver::Drain pipe {
    read $pipe
    if {[eof $pipe]} {
        fileevent $pipe readable {}
    }
}

proc webDriver::Ask {method path {body {}}} {
    variable Port
    set body [encoding convertto utf-8 $body]
    set channel [socket 127.0.0.1 $Port]
    fconfigure $channel -translation binary -buffering full
    try {
        puts -nonewline $channel "$method $path HTTP/1.1\r\nHost: 127.0.0.1:$Port\r\nContent-Type: application/json\r\nContent-Length: [string length $body]\r\n\r\n$body"
        flush $channel
        # It keeps the connection.
        set status [gets $channel]
        while {[string trim [set line [gets $channel]]] ne {}} {
            regexp -nocase {^content-length: *(\d+)} $line -> length
        }
        set text [encoding convertfrom utf-8 [read $channel $length]]
    } finally {
        close $channel
    }
    set value [dict get [json::json2dict $text] value]
    if {![string match "HTTP/1.1 200*" $status]} {
        error "webdriver: $value"
    }
    return $value
}

proc webDriver::go url {
    variable Session
    Ask POST /session/$Session/url "{\"url\":[sorma::json::text $url]}"
}
proc webDriver::run {script args} {
    variable Session
    return [Ask POST /session/$Session/execute/sync "{\"script\":[sorma::json::text $script],\"args\":\[[join [lmap arg $args {sorma::json::text $arg}] ,]\]}"]
}
proc webDriver::Find css {
    variable Session
    return [lindex [Ask POST /session/$Session/element "{\"using\":\"css selector\",\"value\":[sorma::json::text $css]}"] 1]
}
proc webDriver::click css {
    variable Session
    Ask POST /session/$Session/element/[Find $css]/click {{}}
}
proc webDriver::type {css text} {
    variable Session
    Ask POST /session/$Session/element/[Find $css]/value "{\"text\":[sorma::json::text $text]}"
}
proc webDriver::size {width height} {
    variable Session
    Ask POST /session/$Session/goog/cdp/execute "{\"cmd\":\"Emulation.setDeviceMetricsOverride\",\"params\":{\"width\":$width,\"height\":$height,\"deviceScaleFactor\":1,\"mobile\":false}}"
}
proc webDriver::keys text {
    variable Session
    set list [join [lmap key [split $text {}] {string cat "{\"type\":\"keyDown\",\"value\":" [sorma::json::text $key] "},{\"type\":\"keyUp\",\"value\":" [sorma::json::text $key] "}"}] ,]
    Ask POST /session/$Session/actions "{\"actions\":\[{\"type\":\"key\",\"id\":\"keys\",\"actions\":\[$list\]}\]}"
}
proc webDriver::dark yes {
    variable Session
    Ask POST /session/$Session/goog/cdp/execute "{\"cmd\":\"Emulation.setEmulatedMedia\",\"params\":{\"features\":\[{\"name\":\"prefers-color-scheme\",\"value\":\"[expr {$yes ? "dark" : "light"}]\"}\]}}"
}
proc webDriver::network {ms bytes} {
    variable Session
    foreach {cmd params} [list Network.enable {{}} Network.emulateNetworkConditions "{\"offline\":false,\"latency\":$ms,\"downloadThroughput\":$bytes,\"uploadThroughput\":$bytes}"] {
        Ask POST /session/$Session/goog/cdp/execute "{\"cmd\":\"$cmd\",\"params\":$params}"
    }
}
proc webDriver::picture file {
    variable Session
    set out [open $file wb]
    puts -nonewline $out [binary decode base64 [Ask GET /session/$Session/screenshot]]
    close $out
}
