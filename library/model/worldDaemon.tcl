# worldDaemon.tcl -- one object for each daemon that is known: its facts and its objects. worldLine.tcl has daemons of other processes,
# worldSelf.tcl has this process. Both report by Take (an event) and TakeIn (an inventory).
#
# sorma::news tells those who watch. An observer, attached to an object of a daemon, is called at once. It has these methods:
#     objectMade   objectRemoved   objectChanged CHANGES BY    of that object
#     lineMade   daemonChanged   daemonProcess                 of its daemon: connected; it is here, gone, in another state, or all its
#                                                              objects are known; another process, or the first one, answers for it

package require sorma
package require sorma::timer
package require sorma::news
package require sorma::discovery
package provide sorma::worldDaemon 1.0

namespace eval ::sorma::worldDaemon {
    variable Slice 10           ;# ms of work before the event loop has its turn
    variable MostObjects 200000 ;# that are known of one daemon, so that a lie does not fill the memory
    # The data stays when this file is sourced again.
    variable Daemons            ;# dict: KEY -> object
    variable Observers          ;# array: NAME@KEY -> dict whose keys are those who have attached themselves to it
    variable Changes            ;# array: NAME@KEY -> dict whose keys are those of them who want to hear of CTRL
    variable Observed           ;# dict: KEY -> dict whose keys are its objects with observers
    variable Queue              ;# dict whose keys are {object method}: answers to take in, lines to make, questions to ask
    if {![info exists Queue]} {
        set Daemons [set Observed [set Queue {}]]
        array set Observers {}
        array set Changes {}
    }
}

# ---- all of them ----

# ::sorma::worldDaemon::of KEY -- its object; empty: there is none. fact KEY METHOD ?OTHERWISE? -- what it says; OTHERWISE when there is none.
# all -- dict: KEY -> object.
proc ::sorma::worldDaemon::of key {
    variable Daemons
    return [if {[dict exists $Daemons $key]} {dict get $Daemons $key}]
}
proc ::sorma::worldDaemon::fact {key method {otherwise {}}} {
    set daemon [of $key]
    return [if {$daemon eq {}} {set otherwise} else {$daemon $method}]
}
proc ::sorma::worldDaemon::all {} {
    return $::sorma::worldDaemon::Daemons
}

# ::sorma::worldDaemon::attach NAME@KEY OBSERVER ?CHANGES? -- call its methods; CHANGES 1: objectChanged, too. detach NAME@KEY OBSERVER -- stop that.
proc ::sorma::worldDaemon::attach {full observer {changes 0}} {
    variable Observers
    variable Changes
    variable Observed
    dict set Observers($full) $observer 1
    if {$changes} {
        dict set Changes($full) $observer 1
    }
    dict set Observed [string range $full [string first @ $full]+1 end] $full 1
}
proc ::sorma::worldDaemon::detach {full observer} {
    variable Observers
    variable Changes
    variable Observed
    dict unset Observers($full) $observer
    if {[info exists Changes($full)]} {
        dict unset Changes($full) $observer
    }
    if {[dict size $Observers($full)] == 0} {
        unset -nocomplain Observers($full) Changes($full)
        dict unset Observed [string range $full [string first @ $full]+1 end] $full
        set Observed [dict filter $Observed script {key objects} {dict size $objects}]
    }
}
proc ::sorma::worldDaemon::ObserversOf full {
    variable Observers
    return [if {[info exists Observers($full)]} {dict keys $Observers($full)}]
}

# ::sorma::worldDaemon::observed -- has anybody attached itself? inUse -- or does anybody watch objects?
proc ::sorma::worldDaemon::observed {} {
    return [expr {[dict size $::sorma::worldDaemon::Observed] > 0}]
}
proc ::sorma::worldDaemon::inUse {} {
    return [expr {[observed] || [lsearch -not -exact [::sorma::news::patterns] {}] >= 0}]
}

# ::sorma::worldDaemon::ready -- tell who watches when each daemon has answered, or failed, or let us wait for long enough.
proc ::sorma::worldDaemon::ready {} {
    variable Daemons
    foreach daemon [dict values $Daemons] {
        set ms [$daemon patience]
        if {$ms > 0} {
            ::sorma::timer::once world.ready $ms ::sorma::worldDaemon::ready
            return
        }
    }
    ::sorma::news::ready
}

# ::sorma::worldDaemon::later OBJECT METHOD ?FIRST? -- call the method with the end of its time, again and again until it returns 0. Calls take
# turns, for 10 ms together, so that the event loop goes on. FIRST 1: somebody waits for it. never OBJECT -- forget its calls.
proc ::sorma::worldDaemon::later {object method {first 0}} {
    variable Queue
    set item [list $object $method]
    if {$first} {
        set Queue [dict merge [dict create $item 1] $Queue]
    } else {
        dict set Queue $item 1
    }
    ::sorma::timer::once world.work 0 ::sorma::worldDaemon::DoWork
}
proc ::sorma::worldDaemon::never object {
    variable Queue
    if {[dict size $Queue] > 0} {
        set Queue [dict filter $Queue script {item one} {expr {[lindex $item 0] ne $object}}]
    }
}
proc ::sorma::worldDaemon::DoWork {} {
    variable Queue
    variable Slice
    set end [expr {[clock milliseconds] + $Slice}]
    while {[dict size $Queue] > 0} {
        dict for {item one} $Queue break
        dict unset Queue $item
        if {[{*}$item $end]} {
            later {*}$item 1
        }
        if {[clock milliseconds] >= $end && [dict size $Queue] > 0} {
            ::sorma::timer::cancel world.work
            ::sorma::timer::once world.work 1 ::sorma::worldDaemon::DoWork
            return
        }
    }
}

# ---- one of them ----

if {![info object isa object ::sorma::worldDaemon::daemon]} {oo::class create ::sorma::worldDaemon::daemon}
oo::define ::sorma::worldDaemon::daemon {
    variable key
    variable facts              ;# dict, as sorma::world get gives it
    variable objects            ;# dict: NAME@KEY -> dict, as sorma::world get gives it
    variable first              ;# ms, when it came to be known
    variable known              ;# are all its objects known, since there is the line
    variable heard counted      ;# ms, of the last HEALTH, and when the question for its objects was sent that was answered last; 0: none
    variable log                ;# dict: NAME -> made or removed, since they were asked for: newer than the answer
    variable items at seen      ;# an answer that is taken in: objects; how far it has come, -1: not looked at yet; dict: NAME -> 1

    constructor {itsKey address how state} {
        set key $itsKey
        set first [clock milliseconds]
        set facts [dict create name $key address $address how $how state $state why {} since $first user {} host {} pid {} \
            boot {} objects {} busy {} called {}]
        set objects {}
        set known [set heard [set counted 0]]
        set log [set items [set seen {}]]
        dict set ::sorma::worldDaemon::Daemons $key [self]
        my Tell here
    }
    destructor {
        ::sorma::worldDaemon::never [self]
        my Leave
    }
    method Leave {} {
        if {[::sorma::worldDaemon::of $key] eq [self]} {
            dict unset ::sorma::worldDaemon::Daemons $key
        }
    }

    # ---- what is known ----

    method facts {} {
        return $facts
    }
    # Those of another process know better.
    method visible {} {
        return 0
    }
    method unsettled {} {
        return 0
    }
    # Does it answer? Is it known that it does not?
    method answers {} {
        return [expr {[dict get $facts state] in {alive busy}}]
    }
    method away {} {
        return [expr {[dict get $facts state] in {silent dead refused unresolved}}]
    }
    # An object, by its full name; full names that fit; all objects, sorted.
    method object full {
        return [if {[dict exists $objects $full]} {dict get $objects $full}]
    }
    method keys pattern {
        return [dict keys $objects $pattern]
    }
    method objects {} {
        return [lmap name [lsort [my Names]] {dict get $objects $name@$key}]
    }
    method Names {} {
        set n [expr {1 + [string length $key]}]
        return [lmap full [dict keys $objects] {string range $full 0 end-$n}]
    }
    method knows {} {
        return $known
    }
    method counted {} {
        return $counted
    }
    method heard {} {
        return $heard
    }
    # How long its answer is still waited for, before all counts as known [ms].
    method patience {} {
        return [expr {$known || [dict get $facts state] ni {asking alive busy} ? 0 : max(0, 1001 + $first - [clock milliseconds])}]
    }

    # ---- telling ----

    # The word what is here, changed or gone.
    method Tell what {
        ::sorma::news::emit daemon.$what $key $facts
        my ToObservers daemonChanged
    }
    # Those of all its objects.
    method ToObservers method {
        variable ::sorma::worldDaemon::Observed
        if {[dict exists $Observed $key]} {
            foreach full [dict keys [dict get $Observed $key]] {
                foreach observer [::sorma::worldDaemon::ObserversOf $full] {
                    $observer $method
                }
            }
        }
    }
    # Facts that may be new.
    method Set new {
        set before $facts
        set facts [dict merge $facts $new]
        if {$facts ne $before} {
            if {[dict get $facts boot] ne [dict get $before boot]} {
                ::sorma::news::hint daemon.process $key $facts
                my ToObservers daemonProcess
            }
            my Tell changed
        }
    }
    # ago: how long it has lasted already, when it is new [ms].
    method State {state why {busy {}} {ago 0}} {
        set new [dict create state $state why $why busy $busy]
        if {[dict get $facts state] ne $state} {
            dict set new since [expr {[clock milliseconds] - $ago}]
        }
        my Set $new
        ::sorma::worldDaemon::ready
    }
    method Made {name class calls underway} {
        set full $name@$key
        set object [dict create name $name class $class calls $calls underway $underway]
        if {![dict exists $objects $full]} {
            if {[dict size $objects] >= $::sorma::worldDaemon::MostObjects} return
            dict set objects $full $object
            foreach observer [::sorma::worldDaemon::ObserversOf $full] {
                $observer objectMade
            }
            ::sorma::news::emit object.made $full $object
        } elseif {[dict get $objects $full] ne $object} {
            dict set objects $full $object
            ::sorma::news::emit object.changed $full $object
        }
    }
    method Removed name {
        set full $name@$key
        if {[dict exists $objects $full]} {
            set object [dict get $objects $full]
            dict unset objects $full
            foreach observer [::sorma::worldDaemon::ObserversOf $full] {
                $observer objectRemoved
            }
            ::sorma::news::emit object.removed $full $object
        }
    }
    method RemoveAll {} {
        foreach name [my Names] {
            my Removed $name
        }
    }
    method Counts {} {
        my Set [dict create objects [dict size $objects]]
    }

    # ---- what happens there ----

    # An event of its object sorm.
    method Take event {
        set name [dict get $event text]
        switch -glob -- [dict get $event event] {
            object.made {
                my Made $name [lindex [dict get $event words] 0] 0 0
                my Counts
            }
            object.removed {
                my Removed $name
                my Counts
            }
            object.changed {
                set full $name@$key
                set changes [lrange [dict get $event words] 1 end-1]
                set by [lindex [dict get $event words] end]
                if {![dict exists $objects $full] || [llength $changes] % 2 != 0} return
                if {[info exists ::sorma::worldDaemon::Changes($full)]} {
                    foreach observer [dict keys $::sorma::worldDaemon::Changes($full)] {
                        $observer objectChanged $changes $by
                    }
                }
                ::sorma::news::emit object.changed $full [dict replace [dict get $objects $full] changes $changes by $by]
            }
            trail.* {
                lassign [dict get $event words] so code request
                ::sorma::news::emit trail [if {$so ne {}} {string cat $so@$key} else {set key}] [dict create \
                    severity [string range [dict get $event event] 6 end] text $name so $so code $code request $request time [dict get $event time]]
            }
        }
    }

    # All its objects, a dict of objects, {name class calls underway} each: tell the differences, when it is their turn.
    method TakeIn {inventory {first 0}} {
        set items $inventory
        set at -1
        set seen {}
        ::sorma::worldDaemon::later [self] takeSome $first
    }
    # takeSome END -- go on with that until then. Is there more? Most are as they were: those are passed by quickly.
    method takeSome end {
        if {$at < 0} {
            if {[catch {dict get $items objects} items] || [catch {llength $items}]} {
                set items {}
                my Nonsense
                return 0
            }
            set at 0
        }
        set inUse [::sorma::worldDaemon::inUse]
        for {set n [llength $items]} {$at < $n} {incr at} {
            if {$at % 20 == 0 && [clock milliseconds] >= $end} {
                return 1
            }
            if {[catch {lassign [lindex $items $at] name class calls underway}]} continue
            set full $name@$key
            if {[dict exists $objects $full]} {
                dict set seen $name 1
                set object [dict get $objects $full]
                if {[dict get $object calls] eq $calls && [dict get $object underway] eq $underway && [dict get $object class] eq $class} continue
            } elseif {![my IsName $name $class] || [dict size $objects] >= $::sorma::worldDaemon::MostObjects} {
                continue
            }
            if {![string is wideinteger -strict $calls] || ![string is wideinteger -strict $underway]} continue
            dict set seen $name 1
            if {!$inUse} {
                dict set objects $full [dict create name $name class $class calls $calls underway $underway]
            } elseif {![dict exists $log $name] || [dict get $log $name] eq "made"} {
                my Made $name $class $calls $underway
            }
        }
        foreach name [my Names] {
            if {![dict exists $seen $name] && !([dict exists $log $name] && [dict get $log $name] eq "made")} {
                my Removed $name
            }
        }
        my TookAll
        return 0
    }
    # Most names have nothing but letters, digits and the like; to see that is quicker.
    method IsName {name class} {
        return [expr {[string is alpha -strict [string index $name 0]] && [string is alnum -strict [string map {. {} _ {} - {}} $name$class]]
            || [regexp {^[[:alpha:]][^\s@\[\]{}$"\\;[:cntrl:]]*$} $name] && [regexp {^\w+$} $class]}]
    }
    method TookAll {} {
        set known 1
        set log [set items [set seen {}]]
        my Counts
        my ToObservers daemonChanged
        ::sorma::news::hint counted $key
        ::sorma::worldDaemon::ready
    }
}
