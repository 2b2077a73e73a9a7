# launchFile.tcl -- what a launch file says: the daemons of an application. Words, never code.
#
#     defaults -restart failure -dict common.dict           options of the daemons that follow
#     daemon eye -package sorma::service::echo
#     daemon arm -after eye -on robot@cell2 -port 7014 -host 0.0.0.0 -env MODE=slow
#     daemon watch -hosts cell1 cell2                       one on each: watch.cell1, watch.cell2
#     daemon carry -hosts cell1 cell2 self -one-of 1        one that serves, the others stand by
#
# Lines are as entries.tcl reads them. A later option replaces an earlier one; those that take several words add to it. Files of daemons on
# this host are relative to the folder of the launch file.

package require sorma
package require sorma::entries
package require sorma::options
package require sorma::text
package provide sorma::launchFile 1.0

namespace eval ::sorma::launchFile {
    # The settings of a daemon; the manual of sorma-launch explains them.
    variable Options {
        -package words  -make words  -dict words  -path words  -script word  -port {{whole 0 65535}}  -host word  -socket word  -rpcbind boolean  -program word
        -allow words  -policy word  -share boolean  -strict boolean  -selftest {{seconds 0 86400}}  -log word  -env words  -directory word  -on word  -after words
        -hosts words  -one-of {boolean 0}  -standby boolean  -owned words
        -ready {{seconds 0.1 86400} 20}  -restart {{choice never failure always} never}  -limit {{whole 0 1000000} 5}
        -pause {{seconds 0 3600} 0.5}  -grace {{seconds 0 86400} 5}  -essential {boolean 0}
        -sormad {{word {a command}} sormad}  -ssh {{word {a command}} ssh}
    }
}

# ::sorma::launchFile::read --
#       Read a launch file.
# Arguments:
#       file    its path
# Results:
#       A dict in the order of the file: name of daemon -> dict of its options, of place ("FILE:LINE"), and of members: a dict of label -> options for each
#       host where it runs, with -on of that one ({}: this host), and as: the name that is served there.
#       Fails with {SORMA LAUNCH FILE} and a line FILE:LINE: ... for each thing that is wrong.
proc ::sorma::launchFile::read file {
    variable Options
    set wrong [Readable $file]
    if {$wrong ne {}} {
        return -code error -errorcode {SORMA LAUNCH FILE} "$file: $wrong"
    }
    set defaults [::sorma::options::defaults $Options]
    set daemons {}
    ::sorma::entries::each {place words} [::sorma::text::readFile $file] $file ::sorma::SplitWords {
        set words [lassign $words keyword]
        switch -- $keyword {
            defaults {
                set defaults [Take $words $defaults]
            }
            daemon {
                set words [lassign $words name]
                if {![regexp {^[A-Za-z0-9_][A-Za-z0-9_.-]*$} $name]} {
                    error "bad name of a daemon \"$name\": letters, digits, _ - and . only"
                }
                if {[dict exists $daemons $name]} {
                    error "daemon $name is there already, in line [lindex [split [dict get $daemons $name place] :] end]"
                }
                dict set daemons $name [CheckDaemon $name [file dirname $file] [Take $words [dict create place $place {*}$defaults]]]
            }
            default {
                error "unknown word \"$keyword\"[::sorma::DidYouMean $keyword {daemon defaults}]: must be daemon or defaults"
            }
        }
    } wrong
    if {[llength $wrong] == 0} {
        set wrong [concat [CheckNames $daemons] [CheckOrder $daemons]]
    }
    if {[dict size $daemons] == 0 && [llength $wrong] == 0} {
        lappend wrong "$file: there is no daemon in it; a line \"daemon NAME\" makes one"
    }
    if {[llength $wrong] > 0} {
        return -code error -errorcode {SORMA LAUNCH FILE} [join $wrong \n]
    }
    return $daemons
}

# Why a file cannot be read; empty: it can.
proc ::sorma::launchFile::Readable file {
    if {![file exists $file]} {
        return "there is no such file"
    } elseif {[file isdirectory $file]} {
        return "is a folder"
    } elseif {![file readable $file]} {
        return "cannot be read by this user"
    }
}

# Take words of a line over into options.
proc ::sorma::launchFile::Take {words settings} {
    variable Options
    set settings [::sorma::options::take $Options $settings $words]
    dict for {option value} $settings {
        if {[string first \0 $value] >= 0} {
            return -code error "$option has a zero character, which no program can be given"
        }
    }
    return $settings
}

# Check the settings of one daemon. Returns them, with full paths for files of this host, and with its members.
proc ::sorma::launchFile::CheckDaemon {name folder settings} {
    foreach option {-sormad -ssh} {
        dict set settings $option [::sorma::SplitWords [dict get $settings $option]]
        if {[llength [dict get $settings $option]] == 0} {
            return -code error "$option expects a command, got only blanks"
        }
    }
    dict with settings {
        foreach word ${-env} {
            if {![regexp {^[A-Za-z_][A-Za-z0-9_]*=} $word]} {
                return -code error "-env expects NAME=VALUE, got \"$word\""
            }
        }
        if {${-on} ne {}} {
            CheckHost -on ${-on}
        }
    }
    return [WithMembers $name $folder $settings]
}

# A word that begins with a dash would be an option of ssh.
proc ::sorma::launchFile::CheckHost {option host} {
    if {![regexp {^([A-Za-z0-9_.][^\s@]*@)?[A-Za-z0-9_\[:][^\s@]*$} $host]} {
        return -code error "$option expects host or user@host, got \"$host\""
    }
}

proc ::sorma::launchFile::WithMembers {name folder settings} {
    set hosts [concat {*}[lmap word [dict get $settings -hosts] {regexp -all -inline {\S+} $word}]]     ;# {a b c} is one word
    set oneOf [string is true [dict get $settings -one-of]]
    if {$oneOf && [llength $hosts] < 2} {
        return -code error "-one-of 1 needs two hosts or more: -hosts HOST HOST"
    }
    if {[llength $hosts] == 0} {
        set settings [FilesOfHere $folder [dict replace $settings as $name]]
        return [dict replace $settings members [dict create $name $settings]]
    }
    if {[dict get $settings -on] ne {}} {
        return -code error "-on and -hosts do not go together: both say where it runs"
    }
    set members {}
    foreach host $hosts {
        CheckHost -hosts $host
        set at [regsub {^.*@} $host {}]
        set label $name[expr {$oneOf ? "@" : "."}]$at
        if {[dict exists $members $label]} {
            return -code error "-hosts has $at twice"
        }
        if {!$oneOf && ![regexp {^[A-Za-z0-9_.-]+$} $label]} {
            return -code error "-hosts: \"$label\" is no name for a daemon: give the host a name of letters, digits, _ - and ."
        }
        set own [dict replace $settings -on [expr {$host eq "self" ? {} : $host}] as [expr {$oneOf ? $name : $label}]]
        if {$oneOf} {
            dict set own -standby 1
        }
        dict set members $label [FilesOfHere $folder $own]
    }
    return [dict replace $settings members $members]
}

# The settings with full paths, if it runs on this host.
proc ::sorma::launchFile::FilesOfHere {folder settings} {
    if {[dict get $settings -on] ne {}} {
        return $settings
    }
    foreach option {-dict -path -script -directory -log} {
        set files [lmap file [Values $option $settings] {file normalize [file join $folder $file]}]
        foreach file $files {
            CheckFile $option $file
        }
        if {$option ni {-dict -path}} {
            set files [lindex $files 0]
        }
        dict set settings $option $files
    }
    return $settings
}

# Is what an option names there, as far as it has to be?
proc ::sorma::launchFile::CheckFile {option file} {
    if {$option eq "-log"} {
        set file [file dirname $file]
    }
    if {$option in {-log -directory -path}} {
        if {![file isdirectory $file]} {
            return -code error "$option: there is no folder $file"
        }
    } else {
        set wrong [Readable $file]
        if {$wrong ne {}} {
            return -code error "$option $file: $wrong"
        }
    }
}

# The values of an option as a list: none, one, or several.
proc ::sorma::launchFile::Values {option settings} {
    variable Options
    set value [dict get $settings $option]
    if {[lindex [dict get $Options $option] 0] eq "words"} {
        return $value
    }
    return [expr {$value eq {} ? {} : [list $value]}]
}

# Names that two lines would give: a list of messages.
proc ::sorma::launchFile::CheckNames daemons {
    set wrong {}
    set used {}
    dict for {name settings} $daemons {
        foreach as [lsort -unique [lmap member [dict values [dict get $settings members]] {dict get $member as}]] {
            if {[dict exists $used $as]} {
                lappend wrong "[dict get $settings place]: daemon $as is there already, in line [lindex [split [dict get $used $as] :] end]"
            }
            dict set used $as [dict get $settings place]
        }
    }
    return $wrong
}

# Errors in -after: a list of messages.
proc ::sorma::launchFile::CheckOrder daemons {
    set wrong {}
    dict for {name settings} $daemons {
        foreach before [dict get $settings -after] {
            if {![dict exists $daemons $before]} {
                lappend wrong "[dict get $settings place]: -after $before[::sorma::DidYouMean $before [dict keys $daemons]]: there is no such daemon; there are\
                    [join [dict keys $daemons] {, }]"
            }
        }
    }
    if {[llength $wrong] > 0} {
        return $wrong
    }
    set order [startOrder $daemons]
    foreach name [dict keys $daemons] {
        if {$name ni $order} {
            set chain [Circle $daemons $order $name]
            set place [dict get $daemons [lindex $chain 0] place]
            return [list "$place: daemons wait for each other in a circle: [join $chain { -after }]"]
        }
    }
    return {}
}

# ::sorma::launchFile::startOrder DAEMONS -- names in an order in which they can be started; those that wait in a circle, or for one, are left out.
proc ::sorma::launchFile::startOrder daemons {
    set order {}
    for {set before -1} {[llength $order] > $before} {} {
        set before [llength $order]
        dict for {name settings} $daemons {
            set missing [lmap other [dict get $settings -after] {if {$other in $order} continue; set other}]
            if {$name ni $order && [llength $missing] == 0} {
                lappend order $name
            }
        }
    }
    return $order
}

# The circle to which -after leads from a daemon that is not in the order: its names, the first one again at the end.
proc ::sorma::launchFile::Circle {daemons order name} {
    set chain {}
    while {$name ni $chain} {
        lappend chain $name
        foreach other [dict get $daemons $name -after] {
            if {$other ni $order} {
                set name $other
                break
            }
        }
    }
    return [list {*}[lrange $chain [lsearch -exact $chain $name] end] $name]
}
