# pages.tcl FOLDER HEADERS PAGE... -- the manual's pages, made of those in doc: what they include is put in.
#
# [include fork.options]      also .actions, .exec, .table: from the table of that class, as doc/classPage.tcl writes it
# [include inspect.calls]     the heads of the commands of that page, as they are typed to scott
# [include errors.codes]      each error code, as doc/errorPage.tcl writes it
# [include Service.public]    the public part of that C++ class, from the installed headers, whose comments are the manual
#
# doctools reads them, with the engine fmt.blocks. For each page FOLDER gets NAME.man, of which nroff and HTML are made, and NAME.lines.
# The latter is its text for a terminal, a list of {MARGIN HANG TEXT}. Each is a line before it is broken at the width of the terminal.
# Further ones begin at column HANG; -1: it stays as it is.
# And of all pages together:
#
#     contents    list of {PAGE NAME TITLE}
#     places      dict: {KIND WORD} -> list of {PAGE FROM TO}, lines that tell about it. KIND: section, call, def
#     usage       dict: command or program -> dict of
#                 usages    list of {TEXT WORDS}; WORDS: those behind the command that are no options, <name> for what is put in
#                           place of name, the others as they are typed; the last one ends in ... when it may be repeated
#                 options   dict: -option -> what follows it, empty when it stands alone
#     options     dict: {PAGE SECTION} -> list of {OPTION ARGUMENT HELP}
#
# Runs in build/env: the classes come from the build.

package require sorma
package require doctools
source -encoding utf-8 [file join [file dirname [info script]] classPage.tcl]
source -encoding utf-8 [file join [file dirname [info script]] errorPage.tcl]

# Declarations that users of a class see: text of its header from "class NAME {" to "private:" or its end.
proc public {headers name} {
    foreach file [concat [file join $headers sorma.h] [lsort [glob -directory $headers bus/*.h comm/*.h]]] {
        set text [read_file $file]
        if {![regexp -indices -line "^(?:template <\[^>\]*> )?(class|struct|enum class) $name\\y\[^;\]*\$" $text range]} continue
        set out {}
        foreach line [split [string range $text [lindex $range 0] end] \n] {
            if {$line in {private: \}\;}} break
            lappend out $line
            if {[regexp {^(class|struct).*\};} $line]} break
        }
        return "\[example_begin]\n[string trimright [::classPage::plain [join $out \n]]]\n\};\n\[example_end]"
    }
    return -code error "no header has a class $name"
}

proc read_file name {
    set file [open $name]
    fconfigure $file -encoding utf-8
    try {
        return [read $file]
    } finally {
        close $file
    }
}

proc write_file {name text} {
    set file [open $name w]
    fconfigure $file -encoding utf-8 -translation lf
    puts -nonewline $file $text
    close $file
}

proc expanded {headers text} {
    set out {}
    while {[regexp -indices {\[include ([^\]\s]+)\]} $text all name]} {
        append out [string range $text 0 [lindex $all 0]-1]
        lassign [split [string range $text {*}$name] .] class part
        if {$part eq "public"} {
            append out [public $headers $class]
        } elseif {$part eq "calls"} {
            append out [calls $class]
        } elseif {$part eq "codes"} {
            append out [::errorPage::codes [lmap page [lsearch -all -inline -not $::pages */errors.man] {read_file $page}] \
                [file join [file dirname $headers] tests]]
        } else {
            append out [::classPage::fragment $class $part]
        }
        set text [string range $text [lindex $all 1]+1 end]
    }
    return $out$text
}

# Without namespace, and without the options that are for programs.
proc calls page {
    set heads [regexp -all -inline -line "^\\\[call \\\[cmd sorma::${page}::.*$" [read_file [file join [file dirname [info script]] $page.man]]]
    return [string map [list sorma::${page}:: {} { [opt [option -data]]} {} { [opt "[option -command] [arg prefix]"]} {}] [join $heads \n]]
}

# ---- text for a terminal ----

# The lines of a page, and beside each block the number of its first line: {LINES STARTS}.
proc lines blocks {
    set lines {}
    set starts {}
    set depth 0
    set bullet 0
    set last {}
    foreach block $blocks {
        lassign $block kind text title section
        set margin [expr {4 + 4 * $depth}]
        lappend starts [llength $lines]
        switch -- $kind {
            page { lappend lines [list 0 4 "$text ($section) -- $title"] }
            section { lappend lines {0 0 {}} [list 0 0 [string toupper $text]] }
            begin { incr depth }
            end { incr depth -1 }
            item { set bullet 1 }
            call - def - option {
                if {$last ni {call def option}} {
                    lappend lines {0 0 {}}
                }
                lappend lines [list [expr {$margin - 4}] [expr {$margin + 4}] $text]
            }
            para {
                if {$last ni {call def option section page}} {
                    lappend lines {0 0 {}}
                }
                lappend lines [if {$bullet} {list [expr {$margin - 2}] $margin "* $text"} else {list $margin $margin $text}]
                set bullet 0
            }
            example {
                lappend lines {0 0 {}}
                foreach line [split $text \n] {
                    lappend lines [if {[string trim $line] eq {}} {set line {0 0 {}}} else {list [expr {$margin + 4}] -1 [string trimright $line]}]
                }
            }
        }
        if {$kind ne "item"} {
            set last $kind
        }
    }
    return [list $lines [list {*}$starts [llength $lines]]]
}

# ---- what stands where ----

# Enter a page's sections, calls and definitions into places.
proc enter {page blocks starts} {
    upvar #0 places places
    set count [llength $blocks]
    for {set i 0} {$i < $count} {incr i} {
        lassign [lindex $blocks $i] kind text
        switch -- $kind {
            section {
                # An area is no section to ask for: the class of that name has one.
                if {$page eq "errors"} continue
                for {set end [expr {$i + 1}]} {$end < $count && [lindex $blocks $end 0] ne "section"} {incr end} {}
                set words [list [string toupper $text]]
            }
            call - def {
                set end [itemEnd $blocks $i]
                set words [if {$kind eq "call"} {list [lindex [split $text] 0]} else {errors $text}]
            }
            default continue
        }
        foreach word [lsort -unique $words] {
            # A code has its place where a page explains it; the page of all codes comes last.
            if {$page eq "errors" && [dict exists $places [list $kind $word]]} continue
            set at [list $page [lindex $starts $i] [lindex $starts $end]]
            # The first of several heads in a row tells of all behind it.
            set known [if {[dict exists $places [list $kind $word]]} {lindex [dict get $places [list $kind $word]] end}]
            if {[lindex $known 0] ne $page || [lindex $known 2] != [lindex $at 2]} {
                dict lappend places [list $kind $word] $at
            }
        }
    }
}

# The block behind an item: where the next one begins at its depth, or its list ends. Several heads in a row have one text.
proc itemEnd {blocks at} {
    set depth 0
    set heads 1
    for {set i [expr {$at + 1}]} {$i < [llength $blocks]} {incr i} {
        set kind [lindex $blocks $i 0]
        if {$kind eq "begin"} {
            incr depth
        } elseif {$kind eq "end" && [incr depth -1] < 0} {
            return $i
        } elseif {$kind in {call def option item} && $depth == 0 && !$heads} {
            return $i
        }
        set heads [expr {$heads && $kind in {call def option}}]
    }
    return $i
}

# The errors that a head names, "COMM TOO_BIG, LIMIT, DENIED"; and the head itself.
proc errors head {
    set found [list $head]
    foreach item [split $head ,] {
        set item [string trim $item]
        if {[llength [split $item]] == 2} {
            set area [lindex [split $item] 0]
        } elseif {[info exists area]} {
            set item "$area $item"
        }
        lappend found $item
    }
    return $found
}

# ---- how commands are called ----

proc enterUsage {page blocks} {
    upvar #0 usage usage listed listed
    set program [expr {[lindex $blocks 0 3] eq "1"}]
    set section {}
    set commands {}
    set count [llength $blocks]
    for {set i 0} {$i < $count} {incr i} {
        lassign [lindex $blocks $i] kind text parts
        switch -- $kind {
            section { set section $text }
            call {
                set command [lindex [split $text] 0]
                # Words of objects, futures and C++ belong to no command.
                if {!$program && ![string match sorma::* $command]} continue
                set commands [expr {[lindex $blocks $i-1 0] eq "call" ? [concat $commands [list $command]] : [list $command]}]
                set end [itemEnd $blocks $i]
                lassign [parts $parts] words found
                if {![dict exists $usage $command]} {
                    dict set usage $command [dict create usages {} options {}]
                }
                dict with usage $command {
                    lappend usages [list $text $words]
                    set options [dict merge $options $found]
                }
            }
            option {
                set help {}
                for {set k [expr {$i + 1}]} {$k < $count && [lindex $blocks $k 0] eq "para"} {incr k} {
                    lappend help [lindex $blocks $k 1]
                }
                regexp {^(\S+) ?(.*)$} $text -> name argument
                dict lappend listed [list $page $section] [list $name $argument [join $help]]
                # Those that are listed below the heads of commands are theirs, too, and so are a program's.
                if {$program && $section eq "OPTIONS"} {
                    dict set usage [lindex $blocks 0 1] options $name $argument
                } elseif {[info exists end] && $i < $end} {
                    foreach command $commands {
                        dict set usage $command options $name $argument
                    }
                }
            }
        }
    }
}

# {WORDS OPTIONS} of what follows a command.
proc parts text {
    set options {}
    foreach {all - name - argument} [regexp -all -inline {(^|[ ?])(--?\w[\w-]*)( <([^>]*)>)?} $text] {
        dict set options $name $argument
    }
    set text [regsub -all {(^|[ ?])--?\w[\w-]*( <[^>]*>(\.\.\.)?)?} $text {\1}]
    set words {}
    foreach word [lrange [regexp -all -inline {[^\s?]+} $text] 1 end] {
        if {$word eq "..."} {
            lset words end [lindex $words end]...
        } else {
            lappend words $word
        }
    }
    return [list $words $options]
}

# ---- all ----

set contents {}
set places {}
set usage {}
set listed {}
doctools::new reader -format [file join [file dirname [info script]] fmt.blocks]
set pages [lassign $argv folder headers]
foreach page $pages {
    set name [file rootname [file tail $page]]
    if {[catch {
        set text [expanded $headers [read_file $page]]
        set blocks [reader format $text]
    } message]} {
        puts stderr "$page: $message"
        exit 1
    }
    lassign [lines $blocks] lines starts
    lappend contents [list $name [lindex $blocks 0 1] [lindex $blocks 0 2]]
    enter $name $blocks $starts
    enterUsage $name $blocks
    write_file [file join $folder $name.man] $text
    write_file [file join $folder $name.lines] [join [lmap line $lines {list $line}] \n]\n
}
foreach {table content} [list contents $contents places $places usage $usage options $listed] {
    write_file [file join $folder $table] $content\n
}
