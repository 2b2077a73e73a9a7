# sight.tcl -- what the daemon sight does from its start: it says where the ball is, as soon as there is a map.
set cache [expr {[info exists env(XDG_CACHE_HOME)] ? $env(XDG_CACHE_HOME) : [file join $env(HOME) .cache]}]
file mkdir [file join $cache sorma]
sight.ball CTRL -file [file join $cache sorma tracker.map]
sight.ball CTRL -stream 1
