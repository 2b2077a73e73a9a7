# doctor.tcl -- what could keep SORMA from working on this machine, and how to mend it.
#
# Each proc of the namespace that begins with Check adds findings by Note. It changes nothing, but removes the sockets of dead daemons, as
# all that look around do.

package provide sorma::doctor 1.0         ;# before what needs it in turn
package require sorma::inspect
package require sorma::keyFolder

namespace eval ::sorma::inspect {
    dict set Topics doctor {what is wrong on this machine, and how to mend it}
}
namespace eval ::sorma::inspect::doctor {
    variable Findings       ;# list of dicts: what state text mend
    # The checks, in this order.
    variable Checks {Package Clock Folder Sockets Daemons Dictionary Policy Keys SharedMemory Limits Rpcbind}
}

# ::sorma::inspect::doctor ?-selftest? ?-data? --
#       Look at what SORMA needs of this machine: a line for each thing, and below what is wrong how to mend it. With -selftest all objects
#       here and at the daemons test themselves, too.
# Results:
#       With -data a list of dicts: what, state (ok; note: it matters to some; wrong), text, mend.
proc ::sorma::inspect::doctor args {
    lassign [Parse $args {} 0 {-selftest flag}] - data selftest
    set doctor::Findings {}
    foreach check $doctor::Checks {
        if {[catch {doctor::Check$check} message]} {
            doctor::Note [string tolower $check] wrong "cannot be looked at: $message" {}
        }
    }
    if {$selftest} {
        doctor::CheckObjects
    }
    return [if {$data} {set doctor::Findings} else {::sorma::listing findings $doctor::Findings}]
}

proc ::sorma::inspect::doctor::Note {what state text {mend {}}} {
    variable Findings
    lappend Findings [dict create what $what state $state text $text mend $mend]
}

# ---- the package ----

proc ::sorma::inspect::doctor::CheckPackage {} {
    Note package ok "SORMA [package present sorma] in $::sorma::library, Tcl [info patchlevel], [info nameofexecutable]"
    set others [lsearch -all -inline -not -exact [package versions sorma] [package present sorma]]
    if {[llength $others] > 0} {
        Note package note "other versions are installed as well: [join $others {, }]; a script gets the newest" \
            "say package require -exact sorma VERSION, or take their folder out of TCLLIBPATH"
    }
    set found {}
    foreach folder $::auto_path {
        foreach file [glob -nocomplain [file join $folder sorma*/pkgIndex.tcl]] {
            dict set found [file normalize [file dirname $file]] 1
        }
    }
    dict unset found [file normalize $::sorma::library]
    if {[dict size $found] > 0} {
        Note package note "there is another copy in [join [dict keys $found] {, }]; which one a tclsh takes depends on its auto_path" \
            "remove the one that is not wanted"
    }
}

# Certificates need a clock that is right. One that is wrong is seen when somebody has written or started something later than now.
proc ::sorma::inspect::doctor::CheckClock {} {
    set files [list [file join $::sorma::library pkgIndex.tcl]]
    if {![catch {::sorma::keyFolder::folder} folder]} {
        lappend files {*}[glob -nocomplain -type f -directory $folder *.pem]
    }
    foreach file $files {
        if {[CheckLater "$file is written on" [file mtime $file]]} return
    }
    Note clock ok [Moment [clock seconds]]
}

# Is that later than now, more than clocks may differ? Then it is said.
proc ::sorma::inspect::doctor::CheckLater {what seconds} {
    set later [expr {$seconds > [clock seconds] + 300}]
    if {$later} {
        Note clock wrong "$what [Moment $seconds], and here it is [Moment [clock seconds]]: a clock is wrong" \
            "set the clock that is wrong (date -s), and let NTP keep it; certificates with dates fail until then"
    }
    return $later
}

proc ::sorma::inspect::doctor::Moment seconds {
    return [clock format $seconds -format {%Y-%m-%d %H:%M UTC} -timezone :UTC]
}

# ---- where daemons listen ----

# The folder, and which variable says so.
proc ::sorma::inspect::doctor::Folder {} {
    global env
    foreach {variable tail} {SORMA_RUNTIME_DIR {} XDG_RUNTIME_DIR /sorma} {
        if {[info exists env($variable)] && $env($variable) ne {}} {
            return [list $env($variable)$tail $variable]
        }
    }
    file stat /proc/self own
    return [list /tmp/sorma-$own(uid) {}]
}

proc ::sorma::inspect::doctor::CheckFolder {} {
    lassign [Folder] folder variable
    set from [expr {$variable ne {} ? " ($variable)" : " (neither SORMA_RUNTIME_DIR nor XDG_RUNTIME_DIR is set)"}]
    file stat /proc/self own
    if {[catch {file lstat $folder found}]} {
        set above [file dirname $folder]
        if {![file isdirectory $above] || ![file writable $above]} {
            return [Note {runtime folder} wrong "$folder$from is not there, and cannot be made in $above" \
                "make $above, or set SORMA_RUNTIME_DIR to a folder of yours"]
        }
        return [Note {runtime folder} ok "$folder$from is not there yet; the first daemon makes it"]
    }
    if {$found(type) ne "directory"} {
        return [Note {runtime folder} wrong "$folder$from is a $found(type), not a folder" "remove it"]
    }
    if {$found(uid) != $own(uid)} {
        return [Note {runtime folder} wrong "$folder$from belongs to user $found(uid), you are $own(uid); nothing in it is believed" \
            "set SORMA_RUNTIME_DIR to a folder of yours"]
    }
    if {$found(mode) & 0o066} {
        return [Note {runtime folder} wrong "$folder$from may be read or written by others (mode [format %o [expr {$found(mode) & 0o777}]]); nothing in it is believed" \
            "chmod 700 $folder"]
    }
    if {[string length [encoding convertto utf-8 $folder]] > 90} {
        return [Note {runtime folder} wrong "$folder$from is too long: the path of a socket has at most 107 bytes" "set SORMA_RUNTIME_DIR to a shorter one"]
    }
    if {![file writable $folder]} {
        return [Note {runtime folder} wrong "nothing can be written to $folder$from" "chmod u+wx $folder, or see whether its file system is full"]
    }
    Note {runtime folder} ok $folder$from
}

proc ::sorma::inspect::doctor::CheckSockets {} {
    lassign [Folder] folder
    set dead {}
    foreach file [lsort [glob -nocomplain -tails -directory $folder *.sock]] {
        set name [string range $file 0 end-5]
        if {![catch {::sorma::SweepSocket $name} swept] && $swept} {
            lappend dead $name
        }
    }
    if {[llength $dead] > 0} {
        Note sockets note "of daemons that have died, and are removed now: [join $dead {, }]" "look into their logs (sormad -log FILE)"
    }
}

proc ::sorma::inspect::doctor::CheckDaemons {} {
    set own [lindex [split [lindex [::sorma::KeepTrail {::sorma::so::sorm DBX -version}] 3] ,] 1]
    set daemons [::sorma::inspect::daemons -data]
    set well {}
    foreach daemon $daemons {
        set name [dict get $daemon name]
        set trouble [dict get $daemon error]
        if {$trouble ne {}} {
            Note daemon [expr {[string match busy* $trouble] ? "note" : "wrong"}] "$name at [dict get $daemon address]: $trouble" \
                [switch -glob -- $trouble {
                    busy* { string cat "wait, or see what it does: sorma::health $name" }
                    "*is not made for the name*" { string cat "call it by the name in its certificate; or where the authority is: sorma-keys new $name, or sorma-keys give $name" }
                    "*has spoken TLS since*" { string cat "find out why it is in clear now; if it is meant: sorma-keys forget $name" }
                    "*TLS*" - "*certificate*" { string cat "see TLS in sorma::manual security" }
                    "no answer*" { string cat "see whether it is stopped (kill -CONT), or end it" }
                    default { string cat "start it, or take its address out of the dictionary" }
                }]
            continue
        }
        if {[dict get $daemon state] eq "self"} {
            continue
        }
        if {[catch {::sorma::await answer $name {sorm DBX -version} 1000} version]} {
            Note daemon wrong "$name does not say its version: $version" "see sorma::trail"
        } elseif {[lindex [split $version ,] 1] ne $own} {
            Note daemon note "$name has[lindex [split $version ,] 1], here is$own" "restart it with the same version, when calls are refused"
        } else {
            lappend well $name
        }
        if {![catch {::sorma::health $name -timeout 1000} health]} {
            CheckLater "the daemon $name says that it has started on" [expr {[dict get $health started] / 1000000}]
        }
        if {![catch {::sorma::await answer $name {sorm CTRL -statistics} 1000} facts] && [string match "*; open (-open 1)*" $facts]} {
            Note daemon note "$name is open: whoever reaches it may call and inspect its objects" \
                "start it without -open 1, and allow those who shall use it: sorma::manual security"
        }
    }
    if {[llength $well] > 0} {
        Note daemons ok "[join $well {, }]"
    } elseif {[llength $daemons] == 0} {
        Note daemons ok "none runs"
    }
}

proc ::sorma::inspect::doctor::CheckObjects {} {
    set passed 0
    foreach test [::sorma::inspect::selftest -data] {
        if {[dict exists $test error]} continue        ;# that daemon has a line
        if {[dict get $test passed]} {
            incr passed
        } else {
            set place [dict get $test name][if {[dict get $test where] ne {}} {string cat @[dict get $test where]}]
            Note object wrong "$place: [dict get $test text]" "see sorma::help $place; when it is mended, $place CTRL -selftest"
        }
    }
    if {$passed > 0} {
        Note objects ok "$passed pass[if {$passed == 1} {string cat es}] [expr {$passed == 1 ? "its" : "their"}] self-test[if {$passed > 1} {string cat s}]"
    }
}

# ---- what it reads ----

proc ::sorma::inspect::doctor::CheckDictionary {} {
    global env
    set files {}
    if {[info exists env(SORMA_DICT)]} {
        set files [lsearch -all -inline -not -exact [split $env(SORMA_DICT) :] {}]
    }
    foreach file $files {
        # An interpreter reads them when it gets the package.
        set child [interp create]
        try {
            set kept $env(SORMA_DICT)
            set env(SORMA_DICT) $file
            load [lindex [lsearch -inline -index 1 -exact [info loaded {}] Sorma] 0] Sorma $child
            set wrong [split [lindex [interp eval $child {sorma::so::dict CTRL -leftOut}] 3] \n]
        } finally {
            set env(SORMA_DICT) $kept
            interp delete $child
        }
        # The interpreter of each file says what is wrong in other variables; once is enough.
        foreach line $wrong {
            if {![string match "environment variable *" $line]} {
                Note dictionary wrong "SORMA_DICT: $line" "correct that line; it is left out"
            } elseif {$file eq [lindex $files 0]} {
                Note dictionary wrong $line "correct that variable; it is left out"
            }
        }
        if {[llength $wrong] == 0} {
            Note dictionary ok $file
        }
    }
    if {[llength $files] == 0} {
        Note dictionary ok "SORMA_DICT names no file"
    }
}

proc ::sorma::inspect::doctor::CheckPolicy {} {
    global env
    set folder [if {[info exists env(XDG_CONFIG_HOME)] && $env(XDG_CONFIG_HOME) ne {}} {
        set env(XDG_CONFIG_HOME)
    } elseif {[info exists env(HOME)]} {
        file join $env(HOME) .config
    }]
    set file [file join $folder sorma policy]
    if {![file exists $file]} {
        return [Note policy ok "no file $file: you may do everything by Unix-domain socket, others nothing"]
    }
    # A daemon reads it when it is made: so make one, where nobody sees it.
    set temporary /tmp/sorma-doctor-[pid]
    set child [interp create]
    load [lindex [lsearch -inline -index 1 -exact [info loaded {}] Sorma] 0] Sorma $child
    try {
        file mkdir $temporary
        file attributes $temporary -permissions 0700
        interp eval $child [list sorma::serve doctor[pid] -policy $file -socket $temporary/s]
        interp eval $child [list sorma::unserve doctor[pid]]
        Note policy ok $file
    } on error message {
        Note policy wrong [regsub {^sorma::serve: } $message {}] "correct it; until then no daemon starts. See sorma::manual security"
    } finally {
        interp delete $child
        file delete -force $temporary
    }
}

# Keys for TLS: see sorma-keys.
proc ::sorma::inspect::doctor::CheckKeys {} {
    set folder [::sorma::keyFolder::folder]
    set own [::sorma::keyFolder::own]
    if {$own eq {} && ![file exists [::sorma::keyFolder::path authority.pem]]} {
        return [Note keys ok "none in $folder: TCP is in clear"]
    }
    if {$own eq {}} {
        Note keys wrong "there is an authority in $folder, and no certificate of this host: TCP fails" "sorma-keys new NAME, or sorma-keys take FILE"
    } elseif {![file exists [::sorma::keyFolder::path $own.pem]]} {
        Note keys wrong "own names $own, and there is no [::sorma::keyFolder::path $own.pem]" "sorma-keys new $own, or sorma-keys take FILE"
    }
    CheckKeyFolder
    foreach file {authority trusted} {
        CheckAuthorities $file.pem
    }
    foreach name [::sorma::keyFolder::names] {
        CheckKey $name
    }
    CheckRevoked
    CheckPins
    CheckShown $own
}

# These files say whom we trust, so nobody else may write to them.
proc ::sorma::inspect::doctor::CheckKeyFolder {} {
    set key [::sorma::keyFolder::path authority.key]
    if {[file exists $key] && [::sorma::keyFolder::exposed $key]} {
        Note keys wrong "others may read $key: they can make certificates of your authority" "chmod 600 $key; if somebody has read it, make a new authority"
    }
    foreach {file rights} [concat [list [::sorma::keyFolder::folder] 700] {*}[lmap file [glob -nocomplain -type f -directory [::sorma::keyFolder::folder] *] {list $file 600}]] {
        if {$file ne $key && [::sorma::keyFolder::exposed $file 022]} {
            Note keys wrong "others may write to $file: they can say whom you trust" "chmod $rights $file, and look at what is in it"
        }
    }
}

# When an authority has expired, all certificates of it have.
proc ::sorma::inspect::doctor::CheckAuthorities file {
    foreach certificate [::sorma::keyFolder::authorities $file] {
        if {[catch {::sorma::keyFolder::about $certificate} about]} {
            Note keys wrong "[::sorma::keyFolder::path $file] holds a certificate that cannot be read: $about" "bring the authority's file again"
            continue
        }
        set until [dict get $about until]
        if {$until < [clock seconds] + 30 * 86400} {
            Note keys [expr {$until < [clock seconds] ? "wrong" : "note"}] \
                "[::sorma::keyFolder::path $file]: the authority [dict get $about organisation] [expr {$until < [clock seconds] ? "has expired" : "ends"}] on [::sorma::keyFolder::date $until]" \
                "make a new authority, in a new folder (SORMA_KEYS), and give keys of it to each host"
        }
    }
}

proc ::sorma::inspect::doctor::CheckKey name {
    set file [::sorma::keyFolder::path $name.pem]
    if {[::sorma::keyFolder::exposed $file]} {
        return [Note keys wrong "others may read $file; it is not used" "chmod 600 $file; if somebody has: sorma-keys revoke $name"]
    }
    set mend "where the authority is: sorma-keys new $name, or sorma-keys give $name"
    if {[catch {
        set text [::sorma::keyFolder::text $file]
        set about [::sorma::keyFolder::about $text]
        set fits [::sorma::keyFolder::fits $text $text]
    } why]} {
        return [Note keys wrong "$file cannot be read: $why" $mend]
    }
    set now [clock seconds]
    set left [expr {([dict get $about until] - $now) / 86400.0}]
    set until [::sorma::keyFolder::date [dict get $about until]]
    if {[dict get $about name] ne $name} {
        Note keys wrong "$file is made for the name [dict get $about name]: who calls the daemon $name refuses it" $mend
    } elseif {!$fits} {
        Note keys wrong "the key in $file is not that of its certificate" $mend
    } elseif {![::sorma::keyFolder::vouched [lindex [::sorma::keyFolder::parts CERTIFICATE $text] 0] [::sorma::keyFolder::authorities]]} {
        Note keys wrong "$file is signed by no authority that this host knows: the others refuse it" $mend
    } elseif {[dict get $about from] > $now + 300} {
        Note keys wrong "$file holds from [::sorma::keyFolder::date [dict get $about from]]; here it is [::sorma::keyFolder::date $now]" "set the clock, or $mend"
    } elseif {$left < 0} {
        Note keys wrong "$file has expired on $until" $mend
    } else {
        Note keys [expr {$left < 30 ? "note" : "ok"}] "$file, until $until" [expr {$left < 30 ? $mend : {}}]
    }
}

# With such a file no daemon starts. One that runs goes on with the file of before.
proc ::sorma::inspect::doctor::CheckRevoked {} {
    foreach {name mend} {revoked "chmod 600 it, or remove it" crl.pem "put a list of your authority there, or remove the file"} {
        set file [::sorma::keyFolder::path $name]
        if {[catch {file lstat $file found}]} continue
        if {[catch {::sorma::keyFolder::text $file} text]} {
            Note keys wrong "$file cannot be read" $mend
        } elseif {$name eq "crl.pem"} {
            set lists [::sorma::keyFolder::parts {X509 CRL} $text]
            if {[set why [WhyNotSigned $lists]] ne {}} {
                Note keys wrong "$file: $why" $mend
            } elseif {[set end [lindex [lsort -integer [lmap list $lists {::sorma::keyFolder::listEnd $list}]] 0]] ne {} && $end < [clock seconds]} {
                Note keys note "$file: a newer list was to be there by [::sorma::keyFolder::date $end]; this one still counts" "put the newer list there"
            }
        }
    }
}

proc ::sorma::inspect::doctor::WhyNotSigned lists {
    set authorities [::sorma::keyFolder::authorities]
    foreach list $lists {
        if {![::sorma::keyFolder::signed $list $authorities]} {
            return "no authority that this host knows has signed a list in it"
        }
    }
    return [expr {$lists eq {} ? "there is no list in it" : {}}]
}

# Names that are never spoken to in clear. One that is in clear now is a daemon that is not reached.
proc ::sorma::inspect::doctor::CheckPins {} {
    set file [::sorma::keyFolder::path pins]
    if {[catch {::sorma::keyFolder::pins} pins]} {
        return [Note pins wrong "$file cannot be read: daemons that have spoken TLS are not known" "chmod 600 $file"]
    }
    if {![file writable [expr {[file exists $file] ? $file : [file dirname $file]}]]} {
        Note pins wrong "$file cannot be written to: a daemon that speaks TLS is not pinned" "chmod u+w it, and its folder"
    }
    if {[dict size $pins] > 0} {
        Note pins ok "never in clear: [join [lmap {name date} $pins {string cat "$name since $date"}] {, }]"
    }
}

# Which certificate do the daemons here show? Clients refuse one with another name.
proc ::sorma::inspect::doctor::CheckShown own {
    foreach item [dict get [lindex [::sorma::KeepTrail {::sorma::so::sorm DBX -inventory siblings}] 3] siblings] {
        lassign $item name host port
        if {$own ni [list {} $name] && $name ni [::sorma::keyFolder::names]} {
            Note keys note "the daemon $name, on TCP at $host:$port, shows the certificate of $own" \
                "call it @$own from other hosts; or where the authority is: sorma-keys new $name, or sorma-keys give $name"
        }
    }
}

# ---- the machine ----

proc ::sorma::inspect::doctor::CheckSharedMemory {} {
    set folder /dev/shm
    if {![file isdirectory $folder] || ![file writable $folder]} {
        return [Note {shared memory} wrong "$folder is not there or cannot be written to: shmem_w and shmem_r do not work" \
            "mount -t tmpfs -o mode=1777 tmpfs $folder"]
    }
    set segments [llength [glob -nocomplain -directory $folder sorma.*]]
    set state ok
    set mend {}
    set room {}
    if {![catch {exec df -Pk $folder 2>/dev/null} table]} {
        lassign [lindex [split $table \n] end] - total used free
        set room ", [expr {$free / 1024}] of [expr {$total / 1024}] MB are free"
        if {$free < 4096} {
            set state wrong
            set mend "see what is there (ls -l $folder), remove what nobody uses (shmem_w CTRL -clean), or give it more room"
        }
    }
    Note {shared memory} $state "$segments snapshot buffer[expr {$segments == 1 ? {} : "s"}] in $folder$room" $mend
}

proc ::sorma::inspect::doctor::CheckLimits {} {
    set limits [::sorma::text::readFile /proc/self/limits]
    foreach {what pattern} {files {Max open files +(\S+)} memory {Max locked memory +(\S+)} priority {Max realtime priority +(\S+)}} {
        set found($what) 0
        regexp $pattern $limits -> found($what)
    }
    if {$found(files) ne "unlimited" && $found(files) < 2048} {
        Note limits wrong "at most $found(files) open files: connections need numbers above 1024" "ulimit -n 65536, or LimitNOFILE= in its unit"
    } else {
        Note limits ok "open files: $found(files)"
    }
    if {$found(priority) eq "0" && [exec id -u] != 0} {
        Note real-time note "this user may not give a cycle a real-time priority; without one it runs, but late when the machine is busy" \
            "@GROUP - rtprio 90 and @GROUP - memlock unlimited in /etc/security/limits.d/, see sorma::manual cycle"
    } elseif {[exec id -u] == 0 || $found(memory) eq "unlimited"} {
        Note real-time ok "cycles may have a priority and lock their memory"
    } else {
        Note real-time note "at most [expr {$found(memory) / 1024}] kB may be locked in memory: -lockMemory of a cycle needs more" \
            "@GROUP - memlock unlimited in /etc/security/limits.d/"
    }
}

# Needed by -rpcbind, and by addresses that are program numbers.
proc ::sorma::inspect::doctor::CheckRpcbind {} {
    set programs {}
    foreach item [dict get [lindex [::sorma::KeepTrail {::sorma::so::sorm DBX -inventory addresses}] 3] addresses] {
        lassign $item word address
        if {[regexp {:0x[[:xdigit:]]+$} $address]} {
            lappend programs $word
        }
    }
    if {[catch {socket 127.0.0.1 111} channel] && ![file exists /run/rpcbind.sock]} {
        set text "none answers on this host; it is needed by sormad -rpcbind and by addresses like host:0x14"
        if {[llength $programs] > 0} {
            append text ", as of [join $programs {, }]"
        }
        return [Note rpcbind note $text "apt-get install rpcbind, and start it: systemctl start rpcbind, or rpcbind -w"]
    }
    catch {close $channel}
    Note rpcbind ok "it answers"
}
