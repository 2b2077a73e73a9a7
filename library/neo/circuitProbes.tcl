# circuitProbes.tcl -- ::sorma::circuitProbes: a small chart or a lamp on a wire of the circuit editor, for those who ask for it.
#
# A probe belongs to the text of its wire: undo brings both back. It keeps the last 10 s, and asks for no values of its own.

package require snit
package require sorma::style
package provide sorma::circuitProbes 1.0

snit::macro ::sorma::circuitProbes {} {
    variable probes {}          ;# dict: {SOURCE SINK} -> {kind samples}; a sample: list of three numbers at most
    variable sampler {}         ;# timer of Sample

    # probe NUMBER ?KIND? -- chart, lamp or none on that wire. Without a kind: a dict of its kind and samples.
    method probe {number {kind {}}} {
        set wire [lindex [dict get $graph wires] $number]
        if {$wire eq {}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "probe $number: there are [llength [dict get $graph wires]] wires, counted from 0"
        } elseif {$kind ni {{} chart lamp none}} {
            return -code error -errorcode {SORMA REQUEST SYNTAX} "probe $number $kind: the kind must be chart, lamp, or none"
        }
        set key [lrange $wire 1 2]
        set known [if {[dict exists $probes $key]} {dict get $probes $key} else {dict create kind none samples {}}]
        if {$kind eq {}} {
            return $known
        } elseif {$kind eq "none"} {
            dict unset probes $key
        } else {
            dict set probes $key [dict replace $known kind $kind]
        }
        $self ShowProbes
        $self StartProbes
    }
    # The next kind, for the wires that are selected.
    method Probe {} {
        if {$chosenWires eq {}} {
            set hint "[::sorma::style mark refused] probe: select a wire first"
        }
        foreach number $chosenWires {
            $self probe $number [dict get {none chart chart lamp lamp none} [dict get [$self probe $number] kind]]
            set hint [$self WireText $number]
        }
    }
    method ShowProbes {} {
        set shownProbes {}
        set n -1
        foreach wire [dict get $graph wires] {
            incr n
            if {[dict exists $probes [lrange $wire 1 2]]} {
                dict set shownProbes $n [dict get $probes [lrange $wire 1 2]]
            }
        }
        $scene probes $shownProbes
    }
    # Samples are taken while the picture can be seen.
    method StartProbes {} {
        if {$sampler eq {} && $token ne {} && $probes ne {}} {
            set sampler [after 100 [mymethod Sample]]
        }
    }
    method StopProbes {} {
        after cancel $sampler
        set sampler {}
    }
    # Values that are old, or of a recording, give no samples.
    method Sample {} {
        set sampler {}
        if {$moment eq {} && [dict get $told state] ni {stale gone refused}} {
            foreach wire [dict get $graph wires] {
                set key [lrange $wire 1 2]
                set numbers [lrange [lindex [$self Numbers $wire] 1] 0 2]
                if {[dict exists $probes $key] && $numbers ne {}} {
                    dict set probes $key samples [lrange [concat [dict get $probes $key samples] [list $numbers]] end-99 end]
                }
            }
            $self ShowProbes
        }
        $self StartProbes
    }
}
