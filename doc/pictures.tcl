# pictures.tcl FOLDER ?-widgets|-all? -- pictures of windows for the web pages.
#
# They show real objects of a daemon, light in NAME.png and dark in NAME-dark.png. The laboratory and the demos have lab-WHAT.png,
# checkers-WHAT.png and tracker-WHAT.png, as their pictures.tcl in demos make them, where their services are. The tracker's circuit is a drawing,
# tracker-circuit.svg.
# -widgets    without the laboratory and the demos
# -all        of widgets also at 192 dots per inch, NAME-192.png and NAME-dark-192.png; and windows as a whole at two sizes,
#             NAME-SHADE-DPI-SIZE.png (windowPictures.tcl)
#
# Needs Tk with libtk-img and snit, and Xvfb, which it starts. What is missing, or what fails, it says, and goes on: a manual without pictures is
# one, too.

namespace eval pictures {
    variable Classes {
        package require sorma
        oo::class create arm {
            superclass sorma::Service
            sorma::concurrency concurrent
            sorma::purpose "moves a gripper"
            sorma::option -speed double -unit m/s -range {0 1.5} -default 0.5 -warn {0 1.2} -alarm {0 1.4} -group Motion -help "while loaded"
            sorma::option -at vector -length 3 -unit m -default {0.4 0.1 0.25} -names {x y z} -group Motion -help "place"
            sorma::option -gripper enum -choices {open closed soft} -default soft -group Gripper -help "how it holds"
            sorma::option -force double -unit N -range {0 40} -default 12 -warn {{} 30} -group Gripper -help "of the fingers"
            sorma::option -lamp flag -default 1 -group Gripper -help "light at the fingers"
            sorma::reads floats 3 m "place"
            sorma::writes floats 1 s "how long it took"
            sorma::example "arm EXEC FMSG 3 0.4 0.2 0.3"
            sorma::action -stop {} "stop where it is" {}
            method exec message {
                my publish progress -floats 0.42 -text "second of four places"
                sorma::atCancel [info coroutine]
                yield
                return {}
            }
        }
        oo::class create camera {
            superclass sorma::Service
            method exec message {
                set pixels {}
                for {set y 0} {$y < 120} {incr y} {
                    for {set x 0} {$x < 160} {incr x} {
                        append pixels [binary format c [expr {($x / 20 + $y / 20) % 2 ? 60 + $x / 2 : 190 - $y / 2}]]
                    }
                }
                return [dict create any "P5\n160 120\n255\n$pixels"]
            }
        }
        # Sixty options, and calls of others.
        oo::class create plant {
            superclass sorma::Service
            sorma::purpose "a plant with many parts"
            foreach {group unit high} {Belt m/s 2 Oven K 600 Press N 5000 Pump l/min 40 Tank m 3 Light lx 2000} {
                foreach name {setpoint limit ramp gain offset delay} {
                    sorma::option -[string tolower $group][string totitle $name] double -unit $unit -range [list 0 $high] -default [expr {$high / 4.0}] \
                        -group $group -help "$name of the [string tolower $group]"
                }
                foreach name {mode} {
                    sorma::option -[string tolower $group][string totitle $name] enum -choices {off manual automatic remote} -default automatic -group $group -help "who decides"
                }
                sorma::option -[string tolower $group]Enabled flag -default 1 -group $group -help "does it take part"
                sorma::option -[string tolower $group]Note string -default {} -group $group -help "what the next shift should know"
                sorma::option -[string tolower $group]Zero vector -length 3 -unit mm -default {0 0 0} -names {x y z} -group $group -help "where it stands"
            }
            method exec message {
                foo.cell EXEC
                gain.valve EXEC FMSG 1 1
                return {}
            }
        }
        # Two red tokens and a yellow one on a board, in light that is not even.
        oo::class create eye {
            superclass sorma::Service
            method exec message {
                set pixels {}
                for {set y 0} {$y < 240} {incr y} {
                    for {set x 0} {$x < 320} {incr x} {
                        set colour [expr {($x / 80 + $y / 80) % 2 ? {64 107 64} : {226 219 195}}]
                        foreach {u v token} {120 40 {204 15 10} 200 120 {204 15 10} 40 120 {242 204 13}} {
                            if {($x - $u) ** 2 + ($y - $v) ** 2 < 900} {
                                set colour $token
                            }
                        }
                        foreach part $colour {
                            append pixels [format %c [expr {int(min(255, $part * (0.8 + $x / 800.0) + rand() * 8))}]]
                        }
                    }
                }
                return [dict create any "P6\n320 240\n255\n$pixels"]
            }
        }
    }
    # name: command, its arguments. N stands for a name at the daemon: arm.left becomes arm.left@pictures.
    variable Widgets {
        panel      {sorma::panel arm.left@pictures}
        form       {sorma::form -entries {
            group Arm
            arm.left@pictures -speed
            arm.left@pictures -gripper
            arm.left@pictures -force -show meter
            group Kitchen
            foo.cell@pictures -where -text {Where to serve}
            foo.cell@pictures -breakfast -show led
            foo.cell@pictures EXEC -part text -text Menu
        }}
        slider     {sorma::slider -name arm.left@pictures -option -speed}
        entry      {sorma::entry -name foo.cell@pictures -option -where}
        vector     {sorma::vector -name arm.left@pictures -option -at}
        choice     {sorma::choice -name arm.left@pictures -option -gripper}
        check      {sorma::check -name arm.left@pictures -option -lamp -text "light at the fingers"}
        button     {sorma::button -name foo.cell@pictures -request EXEC -text Serve}
        execform   {sorma::execform -name arm.left@pictures}
        led        {sorma::led -name arm.left@pictures -option -lamp -text "light at the fingers"}
        meter      {sorma::meter -name arm.left@pictures -option -force}
        reading    {sorma::reading -name foo.cell@pictures -part text}
        notice     {sorma::notice -lines 2}
        status     {sorma::status -name arm.left@pictures}
        stripchart {sorma::stripchart -span 20 -width 420 -height 160}
        timeline   {sorma::timeline -name recorder.pictures}
        display    {sorma::display -name arm.left@pictures -option -force}
        dashboard  {sorma::dashboard}
        image      {sorma::image -name camera.hand@pictures -every 200 -width 320 -height 240 -zoom 2}
        painter    {sorma::painter -name hsvtable.board@pictures -picture eye.left@pictures}
        trailview  {sorma::trailview -keys arm.*@* -height 4}
        console    {sorma::console -width 84 -height 22}
        browser    {sorma::browser}
        circuitEditor {sorma::circuitEditor circuit.level@pictures}
    }
    variable Bound 20000        ;# ms for which something is waited for
    variable Sizes {1280x800 2560x1440}
    variable Demos [file join [file dirname [file dirname [file normalize [info script]]]] demos]
}

# What is missing for pictures; empty: nothing.
proc pictures::Missing {} {
    if {[auto_execok Xvfb] eq {}} {
        return "Xvfb"
    }
    catch {package require no.such.package}     ;# `package versions` knows what has been looked for
    foreach name {Tk img::window img::png snit} {
        if {[package versions $name] eq {}} {
            return "package $name"
        }
    }
}

proc pictures::until condition {
    variable Bound
    set end [expr {[clock milliseconds] + $Bound}]
    while {![uplevel 1 [list expr $condition]]} {
        if {[clock milliseconds] > $end} {
            return -code error "waited in vain for $condition"
        }
        after 10 {set ::pictures::tick 1}
        vwait ::pictures::tick
    }
}

# ---- the child, which has a display ----

proc pictures::draw {folder shade dpi} {
    variable Widgets
    package require Tk
    tk scaling [expr {$dpi / 72.0}]
    package require sorma
    package require img::window
    package require img::png
    package require sorma::theme
    ::sorma::theme use $shade
    set end [expr {$shade eq "dark" ? "-dark" : {}}][expr {$dpi == 192 ? "-192" : {}}].png
    foreach object {arm.left foo.cell camera.hand} {
        $object@pictures CTRL -dump
    }
    arm.left@pictures CTRL -speed 0.5 -force 12
    foo.cell@pictures CTRL -where garden -tempo presto -breakfast -freshJuice
    Record
    foreach {name words} $Widgets {
        if {$name eq "painter" && [catch {hsvtable.board@pictures CTRL -dump}]} continue       ;# built without OpenCV
        destroy {*}[winfo children .]
        wm geometry . {}
        set words [lassign $words command]
        pack [$command .w {*}$words] -fill both -expand 1 -padx 8 -pady 8
        Ready $name
        update
        set picture [image create photo -format window -data .]
        $picture write [file join $folder $name$end] -format png
        image delete $picture
    }
}

# Some requests, of which some have failed, in the file of recorder.pictures.
proc pictures::Record {} {
    package require sorma::service::recorder
    sorma::create recorder.pictures -file [file join $::env(SORMA_RUNTIME_DIR) pictures.rec] -requests echo.*
    recorder.pictures CTRL -record
    for {set i 0} {$i < 300} {incr i} {
        catch {echo.[expr {$i % 4}] {*}[expr {$i % 41 == 7 ? "CTRL -loud 1" : "EXEC IMSG 1 $i"}]}
    }
    recorder.pictures CTRL -stop
}

# The window is so large, in pixels at 96 dots per inch.
proc pictures::Sized {width height} {
    wm geometry . [::sorma::style pixels $width]x[::sorma::style pixels $height]
}

# Wait until a window shows what it has to.
proc pictures::Ready name {
    switch -- $name {
        panel {
            until {[winfo exists .w.exec.in.entry1]}
            until {![catch {[.w field -speed].entry.entry get} speed] && $speed ne {}}
            [.w subject] edit -speed 1.3
            arm.left@pictures CTRL -force 33
            until {[[.w subject] get -force] ne {} && [dict get [[.w subject] get -force] live] == 33}
        }
        form {
            until {[winfo exists .w.body.canvas.inner.field5.entry] && [[.w item 7] shows] ne {asking {}} && [lindex [[.w item 3] shows] 0] eq "warn"}
        }
        execform {
            until {[winfo exists .w.in.entry3] || [winfo exists .w.in.entry1]}
            .w execute
            until {[winfo ismapped .w.part]}
        }
        button {
            .w invoke
            until {[lindex [.w answer] 0] eq "ok"}
        }
        reading { until {[lindex [.w shows] 0] eq "live"} }
        browser {
            until {{arm.left@pictures} in [.w tree keys]}
            .w choose {object pictures arm.left}
            until {[string match "*-speed 0.5*" [.w text]]}
        }
        circuitEditor {
            Sized 1000 560
            circuit.level@pictures CTRL -inputs {target 1 m} -period 0.1 -wires {
                target              -> sum.error.in1
                integrator.tank.out -> sum.error.in2
                sum.error.out       -> gain.valve.in
                gain.valve.out      -> integrator.tank.in
                integrator.tank.out -> level
            }
            sum.error@pictures CTRL -signs +-
            circuit.level@pictures EXEC FMSG 1 1.5
            until {[.w value 0] eq "1.5 m" && "sum" in [.w palette classes]}
        }
        notice { Sized 460 64; .w say gone "arm.left is not there any more. A request makes it again, from its recipe." {apply {{} {}}} }
        status { until {[.w shows] eq "alive"} }
        image { until {[.w answer] eq "ok"} }
        stripchart {
            foreach trace {x y} {
                for {set i 0} {$i <= 200} {incr i} {
                    .w sample $trace [expr {sin($i / 20.0 + ($trace eq "y")) * exp($i / -300.0)}] [expr {$i / 10.0 - 20}]
                }
            }
        }
        timeline {
            until {[.w idle] && [llength [.w rows]] > 2}
            .w failed next
            until {[.w idle] && [.w text] ne {}}
        }
        display {
            Sized 260 120
            until {[lindex [.w shows] 1] eq "33"}
        }
        dashboard {
            .w read {
                text -text "Left arm" -at "0 0 24 1"
                display -name arm.left@pictures -option -force -text Force -at "0 1 6 4"
                display -name arm.left@pictures -option -gripper -text Gripper -at "0 5 6 3"
                stripchart -plot "arm.left@pictures -force" -span 2 -text "Force over time" -at "6 1 18 7"
                led -name arm.left@pictures -option -lamp -text Lamp -at "0 8 6 2"
                meter -name arm.left@pictures -option -force -text Force -at "6 8 9 2"
                button -name foo.cell@pictures -request EXEC -text Serve -at "15 8 9 2"
                status -name arm.left@pictures -text Daemon -at "0 10 6 2"
                reading -name foo.cell@pictures -part text -text Menu -at "6 10 18 2"
            }
            update
            foreach force {12 20 35} {
                arm.left@pictures CTRL -force $force
                until {[lindex [[.w window 2] shows] 1] == $force}
            }
        }
        trailview {
            foreach words {{CTRL -speed 7} {CTRL -gripper shut} {CTRL -speeed 1}} {
                catch {arm.left@pictures {*}$words}
            }
            until {[llength [.w messages]] >= 3}
        }
        painter {
            until {[string match "Paint with *" [.w said]]}
            foreach {colour stroke} {0 {20 20 60 60} 0 {260 20 300 60} 1 {110 30 130 50} 2 {30 110 50 130}} {
                .w paint $colour {*}$stroke
            }
            .w learn
            until {[string match "Learned: *" [.w said]]}
        }
        console {
            foreach line {{foo.cell@pictures EXEC} {arm.left@pictures CTRL -speed 7} {ls *@pictures}} {
                .w execute $line
                until {![.w running]}
            }
            .w unfold
            .w.text insert end "arm.left@pictures CTRL -gripper "
            until {[.w.hint cget -text] ne {}}
        }
        default {
            set option [.w cget -option]
            [.w subject] revert             ;# what was typed in the panel before
            until {[dict get [[.w subject] get $option] state] eq "live"}
        }
    }
    # What is drawn at the next idle moment is drawn, too.
    after 50 {set ::pictures::tick 1}
    vwait ::pictures::tick
}

# ---- the parent ----

# Is the laboratory built, with someone who can draw it?
proc pictures::lab {} {
    return [expr {![catch {exec [info nameofexecutable] << {
        package require sorma
        foreach name {simlab vision robot hand carry sight psom} {
            package require sorma::service::$name
        }
        sorma::create simlab.probe -prefix probe[pid]. -paused 1
        simlab.probe exec camera
    }}]}]
}

proc pictures::make {folder demos all} {
    variable Classes
    variable Demos
    variable Sizes
    file delete -force $folder
    file mkdir $folder
    set missing [Missing]
    if {$missing ne {}} {
        puts "no pictures of windows in the manual: $missing is not installed"
        return
    }
    set temporary [exec mktemp -d]
    set ::env(SORMA_RUNTIME_DIR) $temporary
    set ::env(XDG_STATE_HOME) $temporary
    set script [open [file join $temporary classes.tcl] w]
    puts $script $Classes
    close $script
    set server [open |[list Xvfb -displayfd 1 -screen 0 2560x2048x24 -nolisten tcp 2> /dev/null] r]
    set daemon [open |[list sormad -name pictures -until-eof -script [file join $temporary classes.tcl]] r+]
    try {
        set ::env(DISPLAY) :[gets $server]
        if {![string match "ready *" [gets $daemon]]} {
            error "sormad does not start"
        }
        foreach shade {light dark} {
            foreach dpi [expr {$all ? "96 192" : "96"}] {
                exec [info nameofexecutable] [info script] -draw $folder $shade $dpi 2>@1
                if {$all} {
                    puts -nonewline [exec [info nameofexecutable] [file join [file dirname [info script]] windowPictures.tcl] $folder $shade $dpi {*}$Sizes 2>@1]
                }
            }
        }
        if {$demos && [lab]} {
            foreach {demo name arguments} {
                lab lab-scene {scene FILE}              lab lab-reading {reading FILE}      lab lab-panel {panel FILE}
                tracker tracker-circuit {circuit FILE}          checkers checkers-window FILE       tracker tracker-window {window FILE}
            } {
                # A sanitizer is too slow for a whole demo.
                if {[info exists ::env(LD_PRELOAD)] && [string match *-window $name]} continue
                set fixed [expr {$name in {lab-scene lab-reading}}]
                foreach shade [expr {$fixed ? "light" : "light dark"}] {
                    set file [file join $folder $name[expr {$shade eq "dark" ? "-dark" : {}}][expr {$name eq "tracker-circuit" ? ".svg" : ".png"}]]
                    exec timeout 120 [info nameofexecutable] [file join $Demos $demo pictures.tcl] {*}[string map [list FILE $file] $arguments] $shade 2>@1
                }
                if {!$all || $fixed} continue
                set ::env(PICTURES_SIZES) $Sizes
                foreach shade {light dark} {
                    foreach ::env(PICTURES_DPI) {96 192} {
                        set file [file join $folder $name-$shade-$::env(PICTURES_DPI).png]
                        if {[catch {exec timeout 240 [info nameofexecutable] [file join $Demos $demo pictures.tcl] {*}[string map [list FILE $file] $arguments] $shade 2>@1} message]} {
                            puts "[file tail $file]: [lindex [split $message \n] end]"
                        }
                    }
                }
                unset ::env(PICTURES_SIZES) ::env(PICTURES_DPI)
            }
        }
    } on error message {
        puts "not all pictures of windows are in the manual: $message"
    } finally {
        catch {close $daemon}
        exec sh -c {kill "$@"} kill {*}[pid $server]
        catch {close $server}
        file delete -force $temporary
    }
}

if {[lindex $argv 0] eq "-draw"} {
    pictures::draw {*}[lrange $argv 1 end]
    exit
}
pictures::make [lindex $argv 0] [expr {[lindex $argv 1] ne "-widgets"}] [expr {[lindex $argv 1] eq "-all"}]
