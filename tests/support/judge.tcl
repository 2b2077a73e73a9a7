# judge.tcl -- a second judge of policies, written from the manual (doc/security.man) and from nothing else.
#
# judge::decide LINES PRINCIPAL RIGHT NAME   -> yes or no. LINES: in the order in which they count. PRINCIPAL: as in a line, without groups
# judge::random SEED                         what follows repeats with the seed
# judge::line, judge::principal, judge::right, judge::name      a random one

namespace eval judge {
    variable Rights {call inspect configure make dictionary files program reach}
    variable Sums {use {call inspect} tune {call inspect configure make dictionary} everything {call inspect configure make dictionary files program reach}}
    variable Names {foo foo.a foo.b foo.secret bar bar.a fork.x @robot /tmp/x /dev/shm/lab.clock carry.slow f}
}

proc judge::decide {lines principal right name} {
    foreach line $lines {
        lassign [Parse $line] verdict subject rights patterns
        if {$right in $rights && [Fits $subject $principal] && [Covers $patterns $name]} {
            return [expr {$verdict eq "allow" ? "yes" : "no"}]
        }
    }
    return no
}

# allow|deny SUBJECT RIGHT... ?on PATTERN...?
proc judge::Parse line {
    variable Sums
    set words [regexp -all -inline {\S+} [regsub {(^|\s)#.*} $line {}]]
    if {[lindex $words 0] ni {allow deny}} {
        set words [linsert $words 0 allow]
    }
    set n [expr {[lindex $words 1] eq "anyone" ? 1 : 2}]
    set rest [lrange $words $n+1 end]
    set on [lsearch -exact $rest on]
    set named [expr {$on < 0 ? $rest : [lrange $rest 0 $on-1]}]
    set rights {}
    foreach word $named {
        lappend rights {*}[expr {[dict exists $Sums $word] ? [dict get $Sums $word] : [list $word]}]
    }
    return [list [lindex $words 0] [lrange $words 1 $n] $rights [expr {$on < 0 ? {*} : [lrange $rest $on+1 end]}]]
}

proc judge::Covers {patterns name} {
    foreach pattern $patterns {
        if {[string match $pattern $name]} {
            return 1
        }
    }
    return 0
}

# A line for 127.0.0.1 also fits the connections of local.
proc judge::Fits {subject principal} {
    lassign $subject kind who
    lassign $principal is name
    switch -- $kind {
        anyone { return 1 }
        host {
            if {$is eq "local"} {
                return [Inside 127.0.0.1 $who]
            }
            return [expr {$is eq "host" && [Inside $name $who]}]
        }
        default { return [expr {$kind eq $is && $who eq $name}] }
    }
}

proc judge::Bits address {
    if {[string first : $address] < 0} {
        binary scan [binary format c4 [split $address .]] B* bits
        return [string repeat 0 80][string repeat 1 16]$bits
    }
    lassign [split [string map {:: _} $address] _] head tail
    set head [split $head :]
    set tail [split $tail :]
    if {[string first :: $address] >= 0} {
        lappend head {*}[lrepeat [expr {8 - [llength $head] - [llength $tail]}] 0] {*}$tail
    }
    return [join [lmap part $head {format %016b 0x$part}] {}]
}

proc judge::Inside {address network} {
    lassign [split $network /] base bits
    set four [expr {[string first : $base] < 0}]
    if {$bits eq {}} {
        set bits [expr {$four ? 32 : 128}]
    }
    incr bits [expr {$four ? 96 : 0}]
    return [expr {[string range [Bits $address] 0 $bits-1] eq [string range [Bits $base] 0 $bits-1]}]
}

# ---- random ones ----

proc judge::random seed {
    expr {srand($seed)}
}

proc judge::One list {
    return [lindex $list [expr {int(rand() * [llength $list])}]]
}

proc judge::Address {} {
    return [One {192.168.7.5 192.168.7.99 192.168.8.1 10.0.0.1 127.0.0.1 127.0.0.9 fd00::7 fd00:1::2 ::1}]
}

proc judge::principal {} {
    return [One [list anyone [list host [Address]] [list host [Address]] {user daemon} {user bin} {local daemon} {local bin}]]
}

proc judge::right {} {
    variable Rights
    return [One $Rights]
}

proc judge::name {} {
    variable Names
    return [One $Names]
}

proc judge::line {} {
    variable Sums
    variable Names
    set subject [One [list anyone anyone {user daemon} {user bin} {local daemon} {local bin} {group daemon} "host [Address]" \
        "host [One {192.168.7.0/24 192.168.0.0/16 10.0.0.0/8 127.0.0.0/8 0.0.0.0/0 fd00::/8 fd00::/64 ::/0 192.168.7.5/31 ::1/127}]"]]
    set rights [lmap n [lrange {1 2 3} 0 [expr {int(rand() * 3)}]] {expr {rand() < 0.4 ? [One [dict keys $Sums]] : [right]}}]
    set on {}
    if {rand() < 0.6} {
        append on " on"
        foreach n [lrange {1 2} 0 [expr {int(rand() * 2)}]] {
            append on " " [One [list * [name] "[lindex [split [name] .] 0].*" *.a {[a-f]*} {[!f]*} {[^f]*} {f?o*} {*\*} {/dev/shm/*} {@*} {[]f]*} {[[:alpha:]]*} {[o-f]*}]]
        }
    }
    return "[One {allow deny deny {}}] $subject [join $rights]$on[One {{} {} {   # why}}]"
}
