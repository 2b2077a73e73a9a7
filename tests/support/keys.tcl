# keys.tcl -- folders of keys for RPC with TLS: each stands for a host. They are below $folder, which the suite sets.

testConstraint openssl [expr {[auto_execok openssl] ne {} && [catch {exec openssl version} m] == 0}]
set env(SORMA_PASSPHRASE) "correct horse"

# A folder of keys; with a script: evaluate it there, as another host would.
proc at {host {script {}}} {
    global env folder
    set before [expr {[info exists env(SORMA_KEYS)] ? $env(SORMA_KEYS) : {}}]
    set env(SORMA_KEYS) [file join $folder $host]
    try {
        return [uplevel 1 $script]
    } finally {
        set env(SORMA_KEYS) $before
    }
}
proc keys args {
    return [string trim [exec sorma-keys {*}$args]]
}
