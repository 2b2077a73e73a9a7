# picture.tcl -- how the demos' pictures.tcl make pictures of their windows. Two variables of the environment say what is wanted besides: PICTURES_DPI,
# dots per inch; PICTURES_SIZES, a list of sizes such as 1280x800, each one more picture.
#
#     picture begin THEME       before the first window; an empty theme: the desktop's
#     picture save FILE         of the main window, PNG; FILE without .png, -SIZE.png: of another size
#     picture copy ...          files of a demo with buffers of their own

package require fileutil
package require Tk

namespace eval picture {
    namespace export begin save copy
    namespace ensemble create
}

proc picture::begin theme {
    if {[info exists ::env(PICTURES_DPI)]} {
        tk scaling [expr {$::env(PICTURES_DPI) / 72.0}]
    }
    if {$theme ne {}} {
        catch {package require awthemes}
        package require sorma::theme
        sorma::theme use $theme
    }
}

proc picture::save file {
    # The screen shows all of it.
    wm geometry . [expr {min([winfo width .], [winfo screenwidth .])}]x[expr {min([winfo height .], [winfo screenheight .])}]+0+0
    update
    One $file
    if {![info exists ::env(PICTURES_SIZES)]} return
    foreach size $::env(PICTURES_SIZES) {
        wm geometry . $size+0+0
        # What is drawn again and again is drawn in its new size.
        for {set i 0} {$i < 12} {incr i} {
            after 100 {set ::picture::tick 1}
            vwait ::picture::tick
        }
        One [file rootname $file]-$size.png
    }
}
proc picture::One file {
    package require img::window
    package require img::png
    raise .
    update
    set image [image create photo -format window -data .]
    $image write $file -format png
    image delete $image
}

# picture copy TO FROM NAMES PATTERN -- copies of files whose buffers have names of their own: another demo may run beside. PATTERN: the beginning of such a
# name in these files; what is in its first parentheses stays.
proc picture::copy {to from names pattern} {
    foreach name $names {
        fileutil::writeFile [file join $to $name] [regsub -all $pattern [fileutil::cat [file join $from $name]] "\\1picture[pid]."]
    }
}
