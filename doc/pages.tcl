# pages.tcl FOLDER HEADERS PAGE... -- the manual's pages, made of those in doc: what they include is put in.
#
# [include fork.options], .actions, .exec, .table: from the table of that class, as sorma::manual::fragment writes it.
# [include Service.public]: the public part of that C++ class, from the installed headers, whose comments are the manual.
# Runs in build/env: the classes come from the build.

package require sorma
auto_load ::sorma::manual

# Declarations that users of a class see: text of its header from "class NAME {" to "private:" or its end.
proc public {headers name} {
    foreach file [concat [file join $headers sorma.h] [lsort [glob -directory $headers bus/*.h comm/*.h]]] {
        set text [read_file $file]
        if {![regexp -indices -line "^(class|struct|enum class) $name\\y\[^;\]*\$" $text range]} continue
        set out {}
        foreach line [split [string range $text [lindex $range 0] end] \n] {
            if {$line in {private: \}\;}} break
            lappend out $line
            if {[regexp {^(class|struct).*\};} $line]} break
        }
        return "\[example_begin]\n[string trimright [::sorma::manual::Plain [join $out \n]]]\n\};\n\[example_end]"
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

proc expanded {headers text} {
    set out {}
    while {[regexp -indices {\[include ([^\]\s]+)\]} $text all name]} {
        append out [string range $text 0 [lindex $all 0]-1]
        lassign [split [string range $text {*}$name] .] class part
        if {$part eq "public"} {
            append out [public $headers $class]
        } else {
            append out [::sorma::manual::fragment $class $part]
        }
        set text [string range $text [lindex $all 1]+1 end]
    }
    return $out$text
}

set pages [lassign $argv folder headers]
foreach page $pages {
    if {[catch {expanded $headers [read_file $page]} text]} {
        puts stderr "$page: $text"
        exit 1
    }
    set file [open [file join $folder [file tail $page]] w]
    fconfigure $file -encoding utf-8
    puts -nonewline $file $text
    close $file
}
