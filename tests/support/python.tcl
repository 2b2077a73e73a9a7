# python.tcl -- programs of tests/python, with the python3 that Debian has.

set env(PYTHONDONTWRITEBYTECODE) 1
set python [expr {[file executable /usr/bin/python3] ? "/usr/bin/python3" : "python3"}]
testConstraint python [expr {![catch {exec $python -c {import sys; assert sys.version_info >= (3, 9); import sorma}} message]}]

proc python {script args} {
    # It writes UTF-8, whatever the locale.
    set pipe [open |[list env PYTHONUTF8=1 timeout 300 $::python [file join [file dirname $::supportFolder] python $script] {*}$args 2>@1]]
    fconfigure $pipe -encoding utf-8
    set said [string trimright [read $pipe] \n]
    if {[catch {close $pipe} why]} {
        return -code error "$said\n$why"
    }
    return $said
}
