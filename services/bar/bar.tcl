# bar -- pours tea. The model of a service class in Tcl: read it before you write your own.
#
# The report of 1996 has the recipe (section 1.5):
#
#     bar   -tea 1.5 -ice crushed -lemon 0.3
#
# To a caller there is no difference to a class in C++: its twin is services/foo/fooService.cpp.

package require sorma

oo::class create ::sorma::service::bar {
    superclass sorma::Service

    # One table says all about the class. CTRL, -help, -dump, configure, completion and manual come from it.
    sorma::purpose "pours tea, with ice and lemon"
    sorma::option -tea double -unit l -range {0 10} -default 0.2 -help "how much"
    sorma::option -ice enum -choices {none cubes crushed} -default none -help "what ice"
    sorma::option -lemon double -range {0 1} -default 0 -help "share of lemon juice"
    sorma::writes text 0.. "" "what is in the glass"
    sorma::writes floats 2 l "tea, lemon juice"
    sorma::example "bar EXEC"

    # EXEC gets the message as a dict with the keys text floats ints any words, and returns a dict of what it answers.
    method exec message {
        set tea [my cget -tea]
        set lemon [expr {$tea * [my cget -lemon]}]
        if {$tea == 0} {
            sorma::warn {BAR DRY} "[my name]: the glass is empty"
        }
        return [dict create text "$tea l of tea, ice: [my cget -ice]" floats [list [expr {$tea - $lemon}] $lemon]]
    }
}

package provide sorma::service::bar 1.0
