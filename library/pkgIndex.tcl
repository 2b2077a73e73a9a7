# pkgIndex.tcl -- where sorma is, and the services that come with it. The modules are made for Tcl 8 or for Tcl 9.

if {![package vsatisfies [package provide Tcl] 8.6-]} return

apply {dir {
    set prefix [expr {[package vsatisfies [package provide Tcl] 9.0-] ? "libtcl9" : "lib"}]
    set end [info sharedlibextension]
    package ifneeded sorma 1.0 [list apply {{dir module} {
        load $module Sorma
        set ::sorma::library $dir
        uplevel #0 [list source -encoding utf-8 [file join $dir package.tcl]]
    }} $dir [file join $dir ${prefix}sorma1.0$end]]
    package ifneeded sorma::edit 1.0 [list load [file join $dir ${prefix}sormaedit1.0$end] Sormaedit]
    package ifneeded sorma::webServer 1.0 [list load [file join $dir ${prefix}sormaweb1.0$end] Sormaweb]
    foreach file [glob -nocomplain -directory $dir *.tcl] {
        set name [file rootname [file tail $file]]
        if {$name in {package pkgIndex}} continue
        package ifneeded sorma::$name 1.0 [list source -encoding utf-8 $file]
    }

    foreach file [glob -nocomplain -directory [file join $dir services] *.tcl *$end] {
        set name [file rootname [file tail $file]]
        if {[file extension $file] eq ".tcl"} {
            set script [list source -encoding utf-8 $file]
        } else {
            set script "package require sorma\n[list load $file [string totitle $name]]"
        }
        package ifneeded sorma::service::$name 1.0 $script
    }
    # Modules that hold classes of other names: the plant asks for sorma::service::CLASS.
    foreach {module classes} {
        robot {calibrate mvpos pino push wspc}
        hand {manus}
        shmem {shmem_w shmem_r}
        track {track trajectory}
        units {sum gain matrix clip squash lowpass integrator delay table select sine noise probe}
        vision {hsvtable findball findbrdmarker getbrdsit getdisk grab classify blobs moments}
    } {
        if {![file exists [file join $dir services $module$end]]} continue
        if {$module ni $classes} {
            package ifneeded sorma::module::$module 1.0 [list package require sorma::service::$module]      ;# it is no class
        }
        foreach name $classes {
            if {$name eq $module} continue
            package ifneeded sorma::service::$name 1.0 "package require sorma::service::$module\npackage provide sorma::service::$name 1.0"
        }
    }
    # Classes that were left out, because the library for them was missing when this was built.
    foreach {module classes needed} {
        camera {camera} {libopencv-imgcodecs-dev libopencv-videoio-dev}
        metrics {metrics} libmicrohttpd-dev
        modbusline {modbus modbusline powermeter} libmodbus-dev
        psom {psom puma track trajectory robot calibrate mvpos pino push wspc} libeigen3-dev
        simlab {simlab} {libmujoco-dev libegl-dev}
        vision {vision hsvtable findball findbrdmarker getbrdsit getdisk grab classify blobs moments} {libeigen3-dev libopencv-imgproc-dev}
    } {
        if {[file exists [file join $dir services $module$end]]} continue
        foreach name $classes {
            package ifneeded sorma::service::$name 0.1 [list error "SORMA was built without [join $needed { and }]: apt install $needed, then configure and build again"]
        }
    }
}} $dir
