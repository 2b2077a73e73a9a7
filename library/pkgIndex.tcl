# pkgIndex.tcl -- sorma, and the services that come with it. The module is made for Tcl 8 or for Tcl 9.

if {![package vsatisfies [package provide Tcl] 8.6-]} return

package ifneeded sorma 1.0 [list apply {dir {
    if {[package vsatisfies [package provide Tcl] 9.0-]} {
        set module libtcl9sorma1.0
    } else {
        set module libsorma1.0
    }
    load [file join $dir $module[info sharedlibextension]] Sorma
    set ::sorma::library $dir
    # Commands in Tcl: their files are read when they are first called.
    foreach {file commands} {
        discover discover
        complete complete
        manual {manual manual::pages manual::titles manual::fragment}
        show {show showTrail showStack showDefaults}
        inspect {inspect inspect::ls inspect::tree inspect::daemons inspect::help inspect::dump inspect::watch inspect::unwatch
            inspect::top inspect::find inspect::monitor inspect::rate inspect::doctor}
    } {
        foreach command $commands {
            set ::auto_index(::sorma::$command) [list source -encoding utf-8 [file join $dir $file.tcl]]
        }
    }
}} $dir]
package ifneeded sorma::inspect 1.0 [list apply {dir {
    package require sorma
    foreach file {discover complete show inspect} {
        uplevel #0 [list source -encoding utf-8 [file join $dir $file.tcl]]
    }
    package provide sorma::inspect 1.0
}} $dir]

package ifneeded sorma::edit 1.0 [list apply {dir {
    set module [expr {[package vsatisfies [package provide Tcl] 9.0-] ? "libtcl9sormaedit1.0" : "libsormaedit1.0"}]
    load [file join $dir $module[info sharedlibextension]] Sormaedit
}} $dir]

foreach file [glob -nocomplain -directory [file join $dir services] *.tcl *[info sharedlibextension]] {
    set name [file rootname [file tail $file]]
    if {[file extension $file] eq ".tcl"} {
        set script [list source -encoding utf-8 $file]
    } else {
        set script "package require sorma\n[list load $file [string totitle $name]]"
    }
    package ifneeded sorma::service::$name 1.0 $script
}

# Modules that hold more classes than one: the plant asks for sorma::service::CLASS.
foreach {module classes} {
    shmem {shmem_w shmem_r}
    units {sum gain matrix clip lowpass integrator delay table select sine noise probe}
} {
    foreach name $classes {
        package ifneeded sorma::service::$name 1.0 "package require sorma::service::$module\npackage provide sorma::service::$name 1.0"
    }
}
unset -nocomplain file name script module classes
