# windowPictures.tcl FOLDER SHADE DPI SIZE ... -- pictures of whole windows of SORMA, each with something to see in it: NAME-SHADE-DPI-SIZE.png. They are
# to be looked at one by one; the manual has none of them. SHADE: light or dark. SIZE: 1280x800, in pixels.
#
# doc/pictures.tcl calls it with a display, and with the daemon "pictures" whose classes stand there.

package require Tk
lassign $argv folder shade dpi
tk scaling [expr {$dpi / 72.0}]
package require sorma
package require sorma::arrangement
package require sorma::browser
package require sorma::circuitEditor
package require sorma::console
package require sorma::dashboard
package require sorma::form
package require sorma::panel
package require sorma::service::recorder
package require sorma::theme
package require sorma::timeline
package require img::window
package require img::png

namespace eval windowPictures {
    variable Bound 20000        ;# ms for which something is waited for
    # Values, charts, lamps and buttons, as an operator has them.
    variable Board {
        text -text "Left arm" -at "0 0 24 1"
        display -name arm.left@pictures -option -force -text Force -at "0 1 6 4"
        display -name arm.left@pictures -option -gripper -text Gripper -at "0 5 6 3"
        stripchart -plot "arm.left@pictures -force" -plot "arm.left@pictures -speed" -span 8 -text "Force and speed over time" -at "6 1 18 7"
        led -name arm.left@pictures -option -lamp -text Lamp -at "0 8 6 2"
        meter -name arm.left@pictures -option -force -text Force -at "6 8 9 2"
        button -name foo.cell@pictures -request EXEC -text Serve -at "15 8 9 2"
        status -name arm.left@pictures -text Daemon -at "0 10 6 2"
        reading -name foo.cell@pictures -part text -text Menu -at "6 10 18 2"
    }
    variable Entries {
        group Arm
        arm.left@pictures -speed
        arm.left@pictures -gripper
        arm.left@pictures -force -show meter
        group Kitchen
        foo.cell@pictures -where -text "Where to serve"
        foo.cell@pictures -breakfast -show led
        foo.cell@pictures EXEC -part text -text Menu
    }
    variable Wires {
        target              -> sum.error.in1
        integrator.tank.out -> sum.error.in2
        sum.error.out       -> gain.valve.in
        gain.valve.out      -> integrator.tank.in
        integrator.tank.out -> level
    }
    # name: how it is made as .w, and what is waited for before it is drawn.
    variable Windows {
        panel       {sorma::panel .w arm.left@pictures}                 {Fill arm}
        large       {sorma::panel .w plant.all@pictures}                {until {[[.w subject] table] ne {}}}
        empty       {sorma::panel .w nothing.there@pictures}            {until {[string match "*no *" [.w.head.say.text cget -text]] || [winfo exists .w.body.canvas.inner.none]}}
        form        {sorma::form .w -entries $Entries}                  {until {[winfo exists .w.body.canvas.inner.field5.entry] && [lindex [[.w item 3] shows] 0] eq "warn"}}
        dashboard   {sorma::dashboard .w}                               {.w read $Board; Forces}
        editing     {sorma::dashboard .w}                               {.w read $Board; Forces; .w edit 1}
        wall        {sorma::dashboard .w -wall 1}                       {.w read $Board; Forces}
        chart       {sorma::stripchart .w -span 60}                     Lines
        timeline    {sorma::timeline .w -file [Recorded]}               {until {[.w idle]}; .w failed next; until {[.w idle] && [.w text] ne {}}}
        console     {sorma::console .w}                                 Typed
        recording   {sorma::browser .w}                                 {Chosen; .w tab timeline select; [.w tab timeline] open [Recorded]; update; until {[[.w tab timeline] line] ne {} && [[[.w tab timeline] line] idle]}; [[.w tab timeline] line] failed next; until {[.w text] ne {}}}
        norecording {sorma::browser .w}                                 {Chosen; .w tab timeline select}
        circuit     {sorma::circuitEditor .w circuit.level@pictures}    {until {[.w value 0] eq "1.5 m" && "sum" in [.w palette classes]}}
        overview    {sorma::browser .w}                                 {Chosen; .w tab overview select}
        object      {sorma::browser .w}                                 {Chosen; .w tab panel select; after 300 {set ::tick 1}; vwait ::tick}
        help        {sorma::browser .w}                                 {Tab help *gripper*}
        statistics  {sorma::browser .w}                                 {Tab statistics *CALLS*}
        audit       {sorma::browser .w}                                 {Tab audit *CTRL*}
        dictionary  {sorma::browser .w}                                 {Chosen; .w tab dictionary select; Pause 500}
        events      {sorma::browser .w}                                 {Chosen; .w tab events select; Listened}
        graph       {sorma::browser .w}                                 {Chosen; .w tab graph select; Calls}
        launch      {sorma::browser .w}                                 {Chosen; .w tab launch select; Launched}
        log         {sorma::browser .w}                                 {Chosen; .w tab log select; Wrong; until {[llength [[.w tab log] messages]] > 2}}
        schema      {sorma::browser .w}                                 {Chosen; .w choose {object pictures circuit.level}; .w tab circuit select; until {[[.w tab circuit] editor] ne {}}; until {[[[.w tab circuit] editor] value 0] eq "1.5 m" && "sum" in [[[.w tab circuit] editor] palette classes]}}
    }
}

proc windowPictures::until condition {
    variable Bound
    set end [expr {[clock milliseconds] + $Bound}]
    while {![uplevel 1 [list expr $condition]]} {
        if {[clock milliseconds] > $end} {
            return -code error "waited in vain for $condition"
        }
        Pause 10
    }
}
proc windowPictures::Pause ms {
    after $ms {set ::windowPictures::tick 1}
    vwait ::windowPictures::tick
}

# ---- what is in them ----

proc windowPictures::Prepare {} {
    variable Wires
    foo.cell@pictures CTRL -where garden -tempo presto -breakfast -freshJuice
    circuit.level@pictures CTRL -inputs {target 1 m} -period 0.1 -wires $Wires
    sum.error@pictures CTRL -signs +-
    circuit.level@pictures EXEC FMSG 1 1.5
    plant.all@pictures CTRL -dump
    arm.left@pictures CTRL -force 33
}
proc windowPictures::Fill object {
    until {[winfo exists .w.exec.in.entry1]}
    until {![catch {[.w field -speed].entry.entry get} speed] && $speed ne {}}
    [.w subject] edit -speed 1.3
    until {[[.w subject] get -force] ne {} && [dict get [[.w subject] get -force] live] == 33}
}
proc windowPictures::Forces {} {
    update
    foreach {force speed} {12 0.5 20 0.8 35 1.1 33 0.6} {
        arm.left@pictures CTRL -force $force -speed $speed
        until {[lindex [[.w window 2] shows] 1] == $force}
        Pause 1000
    }
}
proc windowPictures::Lines {} {
    foreach trace {x y z} shift {0 1 2} {
        .w trace $trace -unit mm
        for {set i 0} {$i <= 600} {incr i} {
            .w sample $trace [expr {100 * sin($i / 40.0 + $shift) * exp($i / -500.0)}] [expr {$i / 10.0 - 60}]
        }
    }
}
# A recording of some requests, of which some have failed: its file.
proc windowPictures::Recorded {} {
    set file [file join $::env(SORMA_RUNTIME_DIR) pictures.rec]
    catch {sorma::remove recorder.pictures}
    sorma::create recorder.pictures -file $file -requests *
    recorder.pictures CTRL -record
    for {set i 0} {$i < 400} {incr i} {
        catch {echo.[expr {$i % 5}] {*}[expr {$i % 41 == 7 ? "CTRL -loud 1" : "EXEC IMSG 1 $i"}]}
    }
    recorder.pictures CTRL -stop
    return $file
}
proc windowPictures::Typed {} {
    foreach line {{foo.cell@pictures EXEC} {arm.left@pictures CTRL -speed 7} {ls *@pictures} {foo.cell@pictures CTRL -dump}} {
        .w execute $line
        until {![.w running]}
    }
    .w unfold
    .w.text insert end "arm.left@pictures CTRL -gripper "
    until {[.w.hint cget -text] ne {}}
}
proc windowPictures::Wrong {} {
    foreach words {{CTRL -speed 7} {CTRL -gripper shut} {CTRL -speeed 1}} {
        catch {arm.left@pictures {*}$words}
    }
}
proc windowPictures::Chosen {} {
    until {{arm.left@pictures} in [.w tree keys]}
    .w choose {object pictures arm.left}
    until {[string match "*-speed*" [.w text]]}
}
proc windowPictures::Tab {name pattern} {
    Chosen
    .w tab $name select
    until {[string match $pattern [.w text]]}
}
proc windowPictures::Listened {} {
    until {[[.w tab events].bar.listen cget -state] eq "normal"}
    [.w tab events] listen
    Pause 500
    for {set i 0} {$i < 5} {incr i} {
        set motion [sorma::async arm.left@pictures EXEC FMSG 3 0.4 0.2 0.3]
        Pause 100
        $motion destroy
    }
    until {[string match *progress* [.w text]]}
}
# Two other programs that call: what the window itself asks is not shown.
proc windowPictures::Calls {} {
    foreach objects {{foo.cell circuit.level} {plant.all foo.cell}} {
        lappend pipes [open |[list [info nameofexecutable] << [string map [list @O $objects] {
            package require sorma
            for {set i 0} {$i < 120} {incr i} {
                foreach object {@O} {
                    catch {$object@pictures EXEC FMSG 1 1}
                }
                after 25
            }
        }] 2> /dev/null] r]
    }
    until {[string match *circuit.level*plant.all* [.w text]] || [string match *plant.all*circuit.level* [.w text]]}
    Pause 1200
    foreach pipe $pipes {
        catch {exec kill {*}[pid $pipe]}
        catch {close $pipe}
    }
    circuit.level@pictures EXEC FMSG 1 1.5
}
proc windowPictures::Launched {} {
    variable Folder
    set file [file join $::env(SORMA_RUNTIME_DIR) cell.launch]
    set channel [open $file w]
    puts $channel "daemon kitchen -package sorma::service::foo\ndaemon belt -package sorma::service::foo -after kitchen"
    close $channel
    [.w tab launch] open $file
    [.w tab launch] start
    until {[[.w tab launch] state belt] eq "ready"}
}

# ---- pictures ----

proc windowPictures::Picture {name made ready size} {
    variable Entries
    variable Board
    wm attributes . -fullscreen 0
    destroy {*}[winfo children .]
    . configure -menu {}
    wm minsize . 1 1
    wm geometry . $size+0+0
    pack [eval $made] -fill both -expand 1
    update
    eval $ready
    wm geometry . $size+0+0
    focus -force .
    Pause 200
    raise .
    update
    set picture [image create photo -format window -data .]
    $picture write [file join $::folder $name-$::shade-$::dpi-$size.png] -format png
    image delete $picture
}

sorma::theme use $shade
windowPictures::Prepare
foreach size [lrange $argv 3 end] {
    foreach {name made ready} $windowPictures::Windows {
        if {[info exists ::env(PICTURES_ONLY)] && $name ni $::env(PICTURES_ONLY)} continue
        if {[catch {windowPictures::Picture $name $made $ready $size} message]} {
            puts "$name-$shade-$dpi-$size: $message"
        }
    }
}
exit
