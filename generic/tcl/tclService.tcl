# tclService.tcl -- service classes in Tcl: what does not need C++. The build puts it into the module, since a safe interpreter can
# read no file; all commands are Tcl's own, whatever the namespace of who loads it.

namespace eval ::sorma::tcloo {}
namespace eval ::sorma::co {}

# Root of all service classes written in Tcl. Each method but exec may be left as it is.
#       exec message    do the job. message: dict of text floats ints any words. Returns a dict of what it answers among
#                       text floats ints any code; what is missing is empty
#       born            the recipe has been applied and the name is known
#       changed options these options have new values; an error refuses them all
#       settle options  A request has set these options: make the world follow. May wait as an action does. There is none at first
#       selftest        an error, or a verdict in clear text
#       dump            further state, a line for each: name value
::oo::class create ::sorma::Service {
    method exec {message} {error "[info object class [self]] has no method exec {message}"}
    method born {} {}
    method changed {options} {}
    method selftest {} {return ok}
    method dump {} {}
}

# A class that declares nothing becomes a service class when it has been made; others do with their first declaration. Nothing
# tells of a new subclass, so the maker of classes is watched: what it makes stays as it was made.
proc ::sorma::tcloo::Made {command code class op} {
    if {$code == 0 && [::llength [Lineage $class]]} {Adopt $class}
}
::trace add execution ::oo::class leave ::sorma::tcloo::Made

# All service classes, as commands.
proc ::sorma::tcloo::Classes {{from ::sorma::Service}} {
    set all {}
    foreach class [::info class subclasses $from] {
        ::lappend all $class {*}[Classes $class]
    }
    ::lsort -unique $all
}

# Body of the coroutine that an EXEC runs in.
proc ::sorma::tcloo::Run {my message} {
    ::set coroutine [::info coroutine]
    ::catch {$my exec $message} result options
    Done $coroutine $result $options
}

# The same of an action.
proc ::sorma::tcloo::RunMethod {args} {
    ::set coroutine [::info coroutine]
    ::catch $args result options
    Done $coroutine $result $options
}

# A service class behind those it derives from; empty when it is none.
proc ::sorma::tcloo::Lineage {class} {
    if {![::info object isa class $class] || $class eq "::sorma::Service"} {return {}}
    foreach super [::info class superclasses $class] {
        if {$super eq "::sorma::Service"} {return [::list $class]}
        set above [Lineage $super]
        if {[::llength $above]} {return [::lappend above $class]}
    }
    return {}
}

# In exec, when its reply is read as a stream: give a piece, a dict as exec returns, and wait until the reader wants another one.
proc ::sorma::piece {piece} {
    tcloo::Give $piece
    ::while {![tcloo::Wanted]} {::yield}
}

# Write all pieces of a stream to a channel: text and bytes as they are, numbers one a line. Returns how many bytes of both there
# were. No more is read than the channel takes.
proc ::sorma::tcloo::StreamTo {stream channel} {
    ::set written 0
    ::try {
        ::while {[$stream next piece]} {
            ::foreach {part value} $piece {
                ::switch -- $part {
                    text {::set value [::encoding convertto utf-8 $value]}
                    floats - ints {::set value [::join $value \n]\n}
                    any {}
                    default continue
                }
                ::if {![::info exists before]} {
                    ::foreach option {-encoding -translation} {
                        ::lappend before $option [::chan configure $channel $option]
                    }
                    ::chan configure $channel -translation binary
                }
                ::puts -nonewline $channel $value
                ::incr written [::string length $value]
            }
            Drain $channel
        }
    } finally {
        $stream close
        ::if {[::info exists before]} {::chan configure $channel {*}$before}
    }
    ::return $written
}

# Wait until a channel that does not block has taken what was written.
proc ::sorma::tcloo::Drain {channel} {
    ::if {[::chan configure $channel -blocking]} {::return}
    ::if {[::info coroutine] eq {}} {
        ::chan configure $channel -blocking 1
        ::flush $channel
        ::chan configure $channel -blocking 0
        ::return
    }
    ::flush $channel
    ::set before [::chan event $channel writable]
    ::try {
        ::while {[::chan pending output $channel] > 0} {
            ::chan event $channel writable [::info coroutine]
            ::yield
        }
    } finally {
        ::chan event $channel writable $before
    }
}
