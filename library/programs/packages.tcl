# packages.tcl -- packages that a daemon is told to load: where they are looked for, and what to say when they are not there.

package require sorma
package provide sorma::packages 1.0

namespace eval ::sorma::packages {}

# ::sorma::packages::notFound PACKAGE KNOWN FOLDERS -- the text for people. KNOWN: names of those that there are; FOLDERS: auto_path.
proc ::sorma::packages::notFound {package known folders} {
    return "can't find package $package[::sorma::DidYouMean $package $known]: no pkgIndex.tcl for it in the folders of auto_path or one\
        below them: [join $folders {, }]; TCLLIBPATH adds folders to these"
}

# ::sorma::packages::missing PACKAGES PATH ENVIRONMENT --
#       Look for packages as a daemon of this host would. Nothing is loaded.
# Arguments:
#       path            folders that its -path adds
#       environment     list of NAME=VALUE: what of its environment differs from ours
# Results:
#       A text for each package that it would not find.
proc ::sorma::packages::missing {packages path environment} {
    set was [array get ::env TCLLIBPATH]
    try {
        foreach word $environment {
            regexp {^TCLLIBPATH=(.*)$} $word - ::env(TCLLIBPATH)
        }
        set looking [interp create]
    } finally {
        unset -nocomplain ::env(TCLLIBPATH)
        array set ::env $was
    }
    try {
        $looking eval [list lappend auto_path [file dirname $::sorma::library] {*}$path]
        return [lmap package $packages {
            $looking eval [list {*}[$looking eval {package unknown}] $package]
            if {[$looking eval [list package versions $package]] ne {} || [$looking eval [list package provide $package]] ne {}} continue
            notFound $package [$looking eval {package names}] [$looking eval {set auto_path}]
        }]
    } finally {
        interp delete $looking
    }
}
