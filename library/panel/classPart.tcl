# classPart.tcl -- what a class adds to the panels of its objects, below their actions: a button, its state.
#
# The package sorma::CLASSState, if there is one, is read when the first panel of that class is made; it registers what it adds. So a class that comes
# with such a package needs no change here.

package require Tk
package require sorma
package provide sorma::classPart 1.0

namespace eval ::sorma::classPart {
    namespace export register of
    namespace ensemble create
    variable Parts {}           ;# dict: class -> command prefix
}

# ::sorma::classPart register CLASS PREFIX -- PREFIX is called with a window to make and the name of the object. That window takes -state, normal or
# disabled. An empty PREFIX: nothing any more.
proc ::sorma::classPart::register {class prefix} {
    variable Parts
    dict set Parts $class $prefix
    return
}

# ::sorma::classPart of CLASS -- that prefix; empty: there is none. The name may come from a stranger.
proc ::sorma::classPart::of class {
    variable Parts
    if {![dict exists $Parts $class] && [regexp {^[a-z]\w{0,60}$} $class] && [package versions sorma::${class}State] ne {}} {
        package require sorma::${class}State
    }
    return [if {[dict exists $Parts $class]} {dict get $Parts $class}]
}
