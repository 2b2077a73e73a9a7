# elsewhere.tcl INDEX PART FOLDER ?PART FOLDER ...? -- the end of the index of package sorma, for standard output.
#
# INDEX is pkgIndex.tcl. A PART is one of Debian's packages, with Tcl packages in FOLDER. A program that asks for one of these while the part is not
# installed reads where it is. When it is there, 1.0 is taken. All are forgotten after an error: a running process looks again, and
# finds the part when it was installed meanwhile.

set elsewhere {apply {all {
    dict for {place packages} $all {
        foreach package $packages {
            package ifneeded $package 0.1 [list apply {{place packages asked} {
                foreach package $packages {
                    if {[package versions $package] eq "0.1"} {
                        package forget $package
                    }
                }
                set what [expr {[string match sorma::service::* $asked] ? "it" : $asked}]
                error "$what is in Debian's package $place, which is not installed: apt install $place"
            }} $place $packages $package]
        }
    }
}}}

# The packages that the index finds in a folder. Version 0.1 stands for one that was left out of the build.
proc found {index dir} {
    set looking [interp create]
    try {
        $looking eval [list set dir $dir]
        $looking eval [list source $index]
        return [lsort [lmap name [$looking eval {package names}] {
            if {![string match sorma::* $name] || $name in {sorma::edit sorma::webServer} || [$looking eval [list package versions $name]] ne "1.0"} continue
            set name
        }]]
    } finally {
        interp delete $looking
    }
}

set parts [lassign $argv index]
foreach {part folder} $parts {
    set packages [found $index $folder]
    if {$packages eq {}} {
        error "$folder has no package"
    }
    append list "    $part {$packages}\n"
}
puts "\n# Debian has these elsewhere.\n$elsewhere {\n$list}"
