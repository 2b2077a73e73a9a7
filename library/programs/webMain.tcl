# webMain.tcl -- the program sorma-web: the bus in any browser, and as REST.

package require sorma
package require sorma::commandLine
package require sorma::webTls
package require sorma::world
package provide sorma::webMain 1.0

namespace eval ::sorma::webMain {
    variable Options {-port {{whole 0 65535} 8090} -host {word 127.0.0.1} -tls {{choice no yes} no} -certificate {{word {a name}}} -connections {{whole 4 1000} 64} -sessions {{whole 1 1000} 16} -body {{whole 1024 1000000000} 1048576}
        -rate {{whole 1 1000000} 100} -users {{word {a file}}} -dashboard {{collect {a file}}}
        -idle {{whole 1 {}} 28800} -longest {{whole 1 {}} 86400} -open {{choice auto always never} auto}}
    variable End            ;# set by a signal
}

# ::sorma::webMain::main WORDS -- run the program: the exit code.
proc ::sorma::webMain::main words {
    variable Options
    return [::sorma::commandLine::run sorma-web $Options $words ::sorma::webMain::Run -check ::sorma::webMain::Check -complete ::sorma::webMain::Complete]
}
proc ::sorma::webMain::Check {settings daemons} {
    if {[dict get $settings -tls] eq "yes"} return
    if {![::sorma::webTls::here [dict get $settings -host]]} {
        error "-host [dict get $settings -host] is reached from other hosts, and needs -tls yes: in clear, others read what you do and who you are"
    }
    if {[dict get $settings -certificate] ne {}} {
        error "-certificate needs -tls yes"
    }
}
proc ::sorma::webMain::Run {settings daemons} {
    if {[catch {package require sorma::webServer} message]} {
        error "GNU libmicrohttpd is not there (Debian: apt install libmicrohttpd12, or libmicrohttpd12t64 from Debian 13 on), or\
            SORMA was built without libmicrohttpd-dev: $message"
    }
    set tls [expr {[dict get $settings -tls] eq "yes"}]
    ::sorma::atSignal {set ::sorma::webMain::End signal}
    package require sorma::webRest
    package require sorma::webPages
    package require sorma::webImage
    package require sorma::webDashboard
    package require sorma::webGraph
    package require sorma::webOpen
    package require sorma::webStop
    foreach daemon $daemons {
        ::sorma::world add $daemon
    }
    ::sorma::world watch *@* -command {apply {args {}}}
    ::sorma::webRest::begin
    ::sorma::webPages::begin
    ::sorma::webImage::begin
    ::sorma::webStop::begin
    ::sorma::webGraph::begin
    ::sorma::webDashboard::begin [dict get $settings -dashboard]
    if {[dict get $settings -users] ne {} || $tls} {
        package require sorma::webUsers
        ::sorma::webUsers::begin [dict get $settings -users]
    }
    set facts [::sorma::web::start $settings [if {$tls} {::sorma::webTls::keys [dict get $settings -certificate]}]]
    puts "ready [dict get $facts link]\nrest [dict get $facts rest]"
    flush stdout
    if {[::sorma::webOpen::wanted [dict get $settings -open]] && [catch {::sorma::webOpen::open [dict get $facts link]} message]} {
        puts stderr "sorma-web: $message"
    }
    if {![info exists ::sorma::webMain::End]} {
        vwait ::sorma::webMain::End
    }
    ::sorma::webGuard::finish
    ::sorma::web::stop
    ::sorma::webOpen::finish
}

proc ::sorma::webMain::Complete words {
    variable Options
    return [concat [dict keys $Options] --help [::sorma::world names]]
}
