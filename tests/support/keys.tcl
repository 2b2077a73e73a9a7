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

# A list of what the authority of a host has revoked, as openssl makes it with more words: of one certificate.
proc revocations {host certificate args} {
    global folder
    set work [file join $folder lists]
    file mkdir $work
    set out [open $work/config w]
    puts $out "\[ca\]\ndefault_ca=all\n\[all\]\ndatabase=$work/index\ndefault_md=sha256\ndefault_crl_days=30\nnew_certs_dir=$work"
    close $out
    close [open $work/index w]
    set words [list -config $work/config -cert $folder/$host/authority.pem -keyfile $folder/$host/authority.key]
    exec openssl ca {*}$words -revoke $certificate 2>@1
    exec openssl ca {*}$words -gencrl -out $work/crl.pem {*}$args 2>@1
    return $work/crl.pem
}
