# launchForward.tcl -- the Unix-domain socket of a daemon on another host, here.
#
# By ssh, so the operator arrives there as himself, with his own rights, and needs no TCP port. The socket lies in the
# runtime folder of this host, so NAME is an alias that works here as it does there.

package require sorma
package provide sorma::launchForward 1.0
namespace eval ::sorma::launch {}

oo::class create ::sorma::launch::Forward {
    variable Pipe
    variable Socket
    variable Said
    variable Done           ;# command prefix: called once with 1 when the socket is here, or 0 and why it is not
    variable Timer

    # ssh: client, with first arguments.   where: user@host.   remote: path of the socket there.   seconds: to wait for it.
    constructor {name ssh where remote seconds done} {
        namespace path ::sorma::launch
        set Socket [::sorma::RuntimeSocket $name]
        set Said {}
        set Done $done
        set words [list {*}$ssh -T -N -o BatchMode=yes -o ServerAliveInterval=5 -o ServerAliveCountMax=3 \
            -o ExitOnForwardFailure=yes -o StreamLocalBindUnlink=yes -L $Socket:$remote -- $where]
        # setsid: Ctrl-C reaches only the launcher. ssh -N does not look at its input, so sh ends it when that has ended.
        set script {exec 3<&0; "$@" </dev/null & child=$!; (cat <&3 >/dev/null; kill $child 2>/dev/null) & wait $child; kill $!}
        set Pipe [open [list | setsid sh -c $script sh {*}$words 2>@1] r+]
        fconfigure $Pipe -blocking 0 -encoding utf-8
        catch {fconfigure $Pipe -profile replace}
        fileevent $Pipe readable [namespace code {my Readable}]
        set Timer [after 10 [namespace code [list my Look [expr {[clock milliseconds] + round(1000 * $seconds)}]]]]
    }

    destructor {
        after cancel $Timer
        catch {::sorma::Signal -[lindex [pid $Pipe] 0] KILL}
        catch {close $Pipe}
        file delete $Socket
    }

    method Readable {} {
        append Said [string range [read $Pipe] 0 999]
        if {[eof $Pipe]} {
            fileevent $Pipe readable {}
            my Tell 0 "ssh has ended: [string trim $Said]"
        }
    }

    # ssh says nothing when the socket is there.
    method Look end {
        if {[file exists $Socket]} {
            my Tell 1
        } elseif {[clock milliseconds] > $end} {
            my Tell 0 "it did not come"
        } else {
            set Timer [after 20 [namespace code [list my Look $end]]]
        }
    }

    method Tell args {
        after cancel $Timer
        if {$Done ne {}} {
            after 0 [list {*}$Done {*}$args]
            set Done {}
        }
    }
}
