# webGraph.tcl -- who calls whom, as a page of sorma-web: a view of webLive.tcl.
#
#     GET /live/graph
#
# Daemons tell each login of the requests to objects that it may inspect, while one of its pages shows the graph, and never else. Places are those of
# callGraph.tcl: equal calls give an equal picture. Items:
#
#     said        a line of text
#     places      size {WIDTH HEIGHT}; boxes {name x y width height daemon objects {{name text}}}; lines {id way}. All in steps of a grid
#     rates       for each object {text busy}, and for each line its width, 0: nothing passes

package require sorma::callGraph
package require sorma::json
package require sorma::webLive
package require sorma::world
package provide sorma::webGraph 1.0

namespace eval ::sorma::webGraph {
    variable Letter 1.2         ;# steps that a letter needs, at most; the page draws steps of 6 pixels
    variable Figures 18         ;# letters of rate and latency
    variable Room 220           ;# steps beside each other
    variable Least 30           ;# steps of a box
}

# ::sorma::webGraph::begin -- serve its route.
proc ::sorma::webGraph::begin {} {
    ::sorma::webLive::kind graph
}

oo::class create ::sorma::webLive::graph {
    superclass ::sorma::webLive::view
    variable login name items
    variable calls

    self method of request {
        return {{} {}}
    }
    method Begin {} {
        set calls [::sorma::callGraph::new -as "web $login"]
        $calls begin
        my Put places [::sorma::json::object {size [0,0] boxes [] lines []}]
    }
    method End {} {
        $calls destroy
    }
    method Look {} {
        $calls measure
        if {[$calls stale]} {
            $calls arrange [list [self] Width] $::sorma::webGraph::Room $::sorma::webGraph::Least
            my Places
        }
        my Rates
        my Put said [::sorma::json::text [$calls said]]
    }
    # Steps that a box needs.
    method Width {process objects} {
        set names [lmap object $objects {expr {[string length [$calls own $object]] + $::sorma::webGraph::Figures}}]
        return [expr {int([tcl::mathfunc::max [string length $process] {*}$names] * $::sorma::webGraph::Letter) + 4}]
    }
    method Places {} {
        set right [set low 0]
        set boxes [lmap {process box} [$calls boxes] {
            set objects [lassign $box x y width height]
            set right [expr {max($right, $x + $width)}]
            set low [expr {max($low, $y + $height)}]
            ::sorma::json::object [list name [::sorma::json::text $process] at [::sorma::json::array [list $x $y $width $height]] \
                daemon [expr {[::sorma::world get $process] ne {}}] \
                objects [::sorma::json::array [lmap object $objects {::sorma::json::array [list [::sorma::json::text $object] [::sorma::json::text [$calls own $object]]]}]]]
        }]
        set lines [lmap {edge way} [$calls ways] {
            set right [expr {max($right, [tcl::mathfunc::max {*}[lmap {x y} $way {set x}]])}]
            set low [expr {max($low, [tcl::mathfunc::max {*}[lmap {x y} $way {set y}]])}]
            ::sorma::json::object [list id [::sorma::json::text [join $edge { > }]] way [::sorma::json::array $way]]
        }]
        my Put places [::sorma::json::object [list size [::sorma::json::array [list $right $low]] boxes [::sorma::json::array $boxes] lines [::sorma::json::array $lines]]]
    }
    method Rates {} {
        set lines [concat {*}[lmap edge [$calls edges] {
            lassign $edge caller object rate
            list "$caller > $object" [format %.1f [expr {$rate > 0 ? min(7, 1 + log10(1 + $rate) ** 1.5) : 0}]]
        }]]
        set objects [concat {*}[lmap {object facts} [$calls sums] {
            list $object [::sorma::json::text [if {[lindex $facts 0] > 0} {join [::sorma::callGraph::figures {*}$facts] {  }}]]
        }]]
        my Put rates [::sorma::json::object [list lines [::sorma::json::object $lines] objects [::sorma::json::object $objects]]]
    }
    export Width
}
