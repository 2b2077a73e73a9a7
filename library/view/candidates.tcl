# candidates.tcl -- names that can stand in a line: commands, variables, service objects, files.
#
# Nothing is made, nothing is called, nobody is waited for: names of other processes come from table.tcl.

package require sorma::table
package require sorma::text
package provide sorma::candidates 1.0
namespace eval ::sorma::candidates {}

# Names that can be called: objects, flavors of dictionaries, classes; here, and at each daemon as far as it is known.
# made: only objects that are there.
proc ::sorma::candidates::names {partial {made 0}} {
    set at [string first @ $partial]
    if {$at >= 0} {
        set object [string range $partial 0 $at]
        set found [lmap name [::sorma::world names] {string cat $object $name}]
        if {[string index $partial $at+1] eq "/"} {
            foreach file [files [string range $partial $at+1 end]] {
                lappend found $object$file
            }
        }
        return $found
    }
    set pattern [::sorma::text::escape $partial]*
    set found [::sorma::names $pattern]
    if {!$made} {
        set words [lsearch -all -inline -glob [::sorma::table words {}] $pattern]
        set found [concat $found [lsearch -all -inline -glob [::sorma::table classes {}] $pattern] \
            [lsearch -all -inline -regexp $words {^[[:alpha:]]\w*(\.[^\s@\[\]{}$"\\;]+)?$}]]
    }
    if {[regexp {^([A-Z][A-Z0-9_]*)\.} $partial -> class]} {
        lassign [::sorma::table locate $class] service where
        foreach name [concat [::sorma::table objects $where] [::sorma::table words $where]] {
            if {[string match $service.* $name]} {
                lappend found $class[string range $name [string length $service] end]
            }
        }
    }
    if {$partial ne {}} {
        foreach daemon [::sorma::world names] {
            set lists [list [::sorma::table objects $daemon]]
            set known [::sorma::table inventory $daemon]
            if {!$made && $known ne {}} {
                lappend lists [dict keys [dict get $known classes]] [dict get $known words]
            }
            foreach names $lists {
                foreach name [lsearch -all -inline -glob $names $pattern] {
                    if {[regexp {^[[:alpha:]]} $name]} {
                        lappend found $name@$daemon
                    }
                }
            }
        }
    }
    return $found
}

# The full name of a command of the global namespace, or of what it looks into. Empty: there is none.
proc ::sorma::candidates::command name {
    return [uplevel #0 [list namespace which -command $name]]
}

# Is a command of that name something else than a service object? A class in Tcl is both.
proc ::sorma::candidates::isTaken name {
    if {[command $name] eq {} || [::sorma::AnonymousObject $name] ne {}} {
        return 0
    }
    if {[string match *::* $name]} {
        return 1
    }
    return [expr {[namespace which -command ::sorma::so::$name] eq {} && !([info object isa object ::$name] && [info object isa class ::$name]
        && [llength [::sorma::classes [::sorma::text::escape $name]]] > 0)}]
}

# Can it be a service object? Cheap: nothing is looked up elsewhere.
proc ::sorma::candidates::isName name {
    if {[::sorma::AnonymousObject $name] ne {}} {
        return 1
    }
    if {![regexp {^([[:alpha:]]\w*)(\.[^\s@\[\]{}$"\\;]*)?(@.+)?$} $name -> class flavor where]} {
        return 0
    }
    if {$where ne {}} {
        return 1
    }
    if {[string is upper -strict [string index $class 0]]} {
        return [expr {[lindex [::sorma::table locate $name] 1] ne {}}]
    }
    return [expr {[::sorma::exists $name] || [llength [::sorma::classes $class]] > 0 || [::sorma::table hasPackage sorma::service::$class]}]
}

# ... and no other command has that name?
proc ::sorma::candidates::isCallable name {
    return [expr {[isName $name] && ![isTaken $name]}]
}

# Words that can follow a command: of an ensemble, of an object, of a future, of a stream.
proc ::sorma::candidates::subcommands command {
    set command ::[string trimleft $command :]
    if {[namespace which -command $command] eq {}} {
        return {}
    }
    if {[namespace ensemble exists $command]} {
        set map [namespace ensemble configure $command -map]
        if {[dict size $map] > 0} {
            return [dict keys $map]
        }
        set listed [namespace ensemble configure $command -subcommands]
        if {[llength $listed] > 0} {
            return $listed
        }
        set space [namespace ensemble configure $command -namespace]
        set found {}
        foreach pattern [namespace eval $space {namespace export}] {
            foreach name [info commands ${space}::$pattern] {
                lappend found [namespace tail $name]
            }
        }
        return $found
    }
    if {[info object isa object $command]} {
        return [info object methods $command -all]
    }
    if {[string match ::sorma::future::* $command]} {
        return {cancel destroy done request result take wait}
    }
    if {[string match ::sorma::streams::s* $command]} {
        return {close next}
    }
    return {}
}

# Variables of the global level, elements of arrays included.
proc ::sorma::candidates::variables name {
    if {[regexp {^([^(]+)\((.*)$} $name -> array element]} {
        if {![uplevel #0 [list array exists $array]]} {
            return {}
        }
        return [lmap key [uplevel #0 [list array names $array [::sorma::text::escape $element]*]] {string cat $array ( $key )}]
    }
    set found [uplevel #0 [list info vars [::sorma::text::escape $name]*]]
    foreach child [children $name] {
        lappend found $child
    }
    return $found
}

# Namespaces that a partial name may lead into, written as it is.
proc ::sorma::candidates::children name {
    set tail [string last :: $name]
    set parent [if {$tail > 0} {string range $name 0 $tail-1} else {string cat ::}]
    set parent ::[string trimleft $parent :]
    if {![namespace exists $parent]} {
        return {}
    }
    set found [lmap child [namespace children $parent] {string cat $child ::}]
    if {![string match ::* $name]} {
        set found [lmap child $found {string range $child 2 end}]
    }
    return $found
}

# Files whose path begins so; folders end in /.
proc ::sorma::candidates::files partial {
    set folder [string range $partial 0 [string last / $partial]]
    set tail [string range $partial [string length $folder] end]
    set place [if {$folder eq {}} {string cat .} else {set folder}]
    if {[string match ~* $place]} {
        if {![info exists ::env(HOME)] || [string index $place 1] ne "/"} {
            return {}
        }
        set place $::env(HOME)[string range $place 1 end]
    }
    set pattern [string map {\\ \\\\ * \\* ? \\? \[ \\\[ \] \\\] \{ \\\{ \} \\\}} $tail]*
    set found {}
    if {[catch {glob -nocomplain -tails -directory $place $pattern} names]} {
        return {}
    }
    if {[string match .* $tail]} {
        catch {lappend names {*}[glob -nocomplain -tails -types hidden -directory $place $pattern]}
    }
    foreach name $names {
        if {$name in {. ..}} continue
        lappend found $folder$name[expr {[file isdirectory [file join $place $name]] ? "/" : {}}]
    }
    return $found
}

# Names that have not been used yet.
proc ::sorma::candidates::without {names used} {
    return [lmap name $names {if {$name in $used} continue; set name}]
}

# "unknown daemon lbb (did you mean lab?)"; empty: it is known, or nothing known is near.   what: "daemon " or empty
proc ::sorma::candidates::unknown {word known what} {
    if {$word in $known} {
        return {}
    }
    set hint [::sorma::DidYouMean $word $known]
    return [if {$hint ne {}} {string cat "unknown $what" $word $hint}]
}
