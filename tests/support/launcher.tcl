# launcher.tcl -- sorma-launch under test: its files, its output, and other hosts that are this one.
#
# folder                    where the files of a suite are
# put NAME TEXT             write one there; its path
# ends WORD ...             run sorma-launch to its end: exit code, and what it said
# launch TEXT WORD ...      begin a launch of a file; WORDs are a command before sorma-launch, such as env
# untilSaid, said, told     its output so far
# processOf, send, status   its daemons, a signal, its end
# kept, keptWords           the environment that a daemon elsewhere needs: for a shell, and for a launch file
# startSshd ADDRESS ...     a real ssh server of our own; sets realSsh and the constraint sshd.  endSshd

set folder [file join [temporaryDirectory] launch]
file mkdir $folder

# Write a file of the application. Returns its path.
proc put {name text} {
    set path [file join $::folder $name]
    set f [open $path w]
    fconfigure $f -encoding utf-8
    puts -nonewline $f $text
    close $f
    return $path
}

# Run sorma-launch to its end: exit code and all it said, without paths and process numbers.
proc ends args {
    set code [catch {exec sorma-launch {*}$args < /dev/null 2>@1} said options]
    if {$code} {
        set code [lindex [dict get $options -errorcode] 2]
        set said [regsub {\n?child process exited abnormally$} $said {}]
    }
    return [list $code [plain $said]]
}

proc plain text {
    return [regsub -all {process \d+|(\w+)\[\d+\]|/run-?\w*/} [string map [list $::folder/ {}] $text] {\1[N]}]
}

# Begin a launch. Its output is gathered in ::Said; ::Status is its exit code once it has ended.
proc launch {text args} {
    launchFile [put test.launch $text] {*}$args
}

proc launchFile {file args} {
    set ::Said {}
    unset -nocomplain ::Status
    set ::Pipe [open [list | {*}$args sorma-launch $file 2>@1] r]
    set ::Launcher [pid $::Pipe]
    fconfigure $::Pipe -blocking 0 -encoding utf-8
    fileevent $::Pipe readable gather
}

proc gather {} {
    append ::Said [read $::Pipe]
    if {[eof $::Pipe]} {
        fileevent $::Pipe readable {}
        fconfigure $::Pipe -blocking 1
        if {[catch {close $::Pipe} message options]} {
            set ::Status [lindex [dict get $options -errorcode] 2]
        } else {
            set ::Status 0
        }
    }
}

# Until it has said something (a pattern) so many times.
proc untilSaid {pattern {times 1}} {
    if {[catch {waitFor "\[said [list $pattern]\] >= $times || \[info exists ::Status\]" 60000} message]} {
        error "$message; it said:\n$::Said"
    }
    if {[said $pattern] < $times} {
        error "it ended with $::Status and never said $pattern, but:\n$::Said"
    }
}

proc said pattern {
    return [regexp -all -line $pattern $::Said]
}

# The process number of a daemon as it was told last.
proc processOf name {
    return [lindex [regexp -all -inline "$name is started\[^,\]*, process (\\d+)" $::Said] end]
}

proc send {signal {process {}}} {
    exec sh -c {kill "$@"} kill -$signal [expr {$process eq {} ? $::Launcher : $process}]
}

# Wait until the launcher has ended. Returns its exit code.
proc status {} {
    if {[catch {waitFor {[info exists ::Status]} 60000} message]} {
        error "$message; it said:\n$::Said"
    }
    return $::Status
}

# The launcher's own output, without numbers that differ.
proc told {} {
    return [lmap line [split [string trim $::Said] \n] {
        if {![regexp {^ *\* \| (.*)$} [plain $line] -> line]} continue
        regsub { after [\d.]+ s$} $line {}
    }]
}

proc alive pid {
    return [expr {![daemon::Ended $pid]}]
}

proc sockets {} {
    return [lsort [glob -nocomplain -tails -directory $::env(SORMA_RUNTIME_DIR) *.sock]]
}

# A program in place of sormad, which is started with -name NAME -until-eof ...
proc program {name text} {
    return "-sormad \"sh [put $name $text]\""
}

set kept {}         ;# where things are, for a shell; and for a launch file
set keptWords {}
foreach name {PATH TCLLIBPATH LD_LIBRARY_PATH LD_PRELOAD ASAN_OPTIONS UBSAN_OPTIONS SORMA_SUITE} {
    if {[info exists env($name)]} {
        append kept " $name='$env($name)'"
        append keptWords " {$name=$env($name)}"
    }
}

# A real ssh: an sshd of our own, on addresses of this host.
proc startSshd args {
    upvar #0 folder folder sshdPipe pipe
    set sshd [lindex [concat [auto_execok sshd] [glob -nocomplain /usr/sbin/sshd]] 0]
    set serving 0
    if {$sshd ne {} && [auto_execok ssh] ne {} && [auto_execok ssh-keygen] ne {}} {
        exec ssh-keygen -q -t ed25519 -N {} -f [file join $folder key]
        set listener [socket -server {apply {args {}}} -myaddr [lindex $args 0] 0]
        set port [lindex [fconfigure $listener -sockname] 2]
        close $listener
        put sshd.conf "Port $port\n[join [lmap address $args {string cat "ListenAddress $address\n"}] {}]HostKey $folder/key\nAuthorizedKeysFile $folder/key.pub\nPidFile none
StrictModes no\nUsePAM no\nPasswordAuthentication no\nPermitRootLogin yes\n"
        set pipe [open [list | [file normalize $sshd] -D -e -f [file join $folder sshd.conf] 2>@1] r]
        # It says that it listens, or ends with what is missing.
        while {[gets $pipe line] >= 0 && ![set serving [string match "Server listening*" $line]]} {}
        set ::realSsh "ssh -F /dev/null -p $port -i $folder/key -o IdentitiesOnly=yes -o StrictHostKeyChecking=no\
            -o UserKnownHostsFile=/dev/null -o LogLevel=ERROR"
    }
    testConstraint sshd $serving
}
proc endSshd {} {
    if {[testConstraint sshd]} {
        send TERM [pid $::sshdPipe]
    }
    catch {close $::sshdPipe}
}
