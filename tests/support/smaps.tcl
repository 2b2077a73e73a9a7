# smaps.tcl -- memory of a process, by what it is mapped for.

# Memory of a process that it shares with others by lines [kB].
proc shared pid {
    set f [open /proc/$pid/smaps]
    set kilobytes 0
    foreach {- one} [regexp -all -inline {memfd:sorma [^\n]*\n(?:[A-Z][^\n]*\n)*?Rss: +(\d+)} [read $f]] {
        incr kilobytes $one
    }
    close $f
    return $kilobytes
}
