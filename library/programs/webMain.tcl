# webMain.tcl -- the program sorma-web: the bus in any browser, and as REST.

package require sorma
package require sorma::options
package require sorma::text
package require sorma::usage
package require sorma::webTls
package require sorma::world
package provide sorma::webMain 1.0

namespace eval ::sorma::webMain {
    variable Options {-port {{whole 0 65535} 8090} -host {word 127.0.0.1} -tls {{choice no yes} no} -certificate {{word {a name}}} -connections {{whole 4 1000} 64} -sessions {{whole 1 1000} 16} -body {{whole 1024 1000000000} 1048576}
        -rate {{whole 1 1000000} 100} -users {{word {a file}}} -dashboard {{collect {a file}}}
        -idle {{whole 1 {}} 28800} -longest {{whole 1 {}} 86400} -open {{choice auto always never} auto} -help flag --help flag -h flag}
    variable End            ;# set by a signal
}

# ::sorma::webMain::main WORDS -- run the program: the exit code.
proc ::sorma::webMain::main words {
    ::sorma::options::suggest ::sorma::DidYouMean
    variable Options
    if {[lindex $words 0] eq "--complete"} {
        puts [join [Complete [lrange $words 1 end]] \n]
        return 0
    }
    try {
        set settings [::sorma::options::parse $Options $words daemons]
        set tls [expr {[dict get $settings -tls] eq "yes"}]
        if {!$tls && ![::sorma::webTls::here [dict get $settings -host]]} {
            error "-host [dict get $settings -host] is reached from other hosts, and needs -tls yes: in clear, others read what you do and who you are"
        }
        if {!$tls && [dict get $settings -certificate] ne {}} {
            error "-certificate needs -tls yes"
        }
    } on error message {
        puts stderr "sorma-web: $message\n[::sorma::usage::program sorma-web]"
        return 2
    }
    if {[dict get $settings -help] || [dict get $settings --help] || [dict get $settings -h]} {
        puts [::sorma::usage::program sorma-web]
        return 0
    }
    if {[catch {package require sorma::webServer} message]} {
        puts stderr "sorma-web: GNU libmicrohttpd is not there (Debian: apt install libmicrohttpd12, or libmicrohttpd12t64 from Debian 13 on), or\
            SORMA was built without libmicrohttpd-dev: $message"
        return 1
    }
    ::sorma::atSignal {set ::sorma::webMain::End signal}
    try {
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
    } on error message {
        puts stderr "sorma-web: $message"
        return 1
    }
    if {![info exists ::sorma::webMain::End]} {
        vwait ::sorma::webMain::End
    }
    ::sorma::webGuard::finish
    ::sorma::web::stop
    ::sorma::webOpen::finish
    return 0
}

# Candidates for the last word of a command line: see library/scott.bash.
proc ::sorma::webMain::Complete words {
    variable Options
    set found [concat [dict keys $Options -*] [::sorma::world names]]
    return [lsort -unique [lsearch -all -inline -glob $found [::sorma::text::escape [lindex $words end]]*]]
}
