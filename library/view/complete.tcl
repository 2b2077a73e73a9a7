# complete.tcl -- what can be typed next: for the terminal, and for whatever else takes lines.
#
# A line is read as Tcl reads it, up to the point. The place of the point decides: a command's name, a word of a request, a
# value, a recipe in quotes. Names come from candidates.tcl, words of a request from requestWords.tcl.
# Tables come from table.tcl: nothing is made, nothing is called, nobody is waited for.

package require sorma::candidates
package require sorma::line
package require sorma::requestWords
package require sorma::table
package require sorma::text
package require sorma::usage
package provide sorma::complete 1.0
namespace eval ::sorma::complete {
    variable Methods {CTRL DBX EXEC cget configure destroy exec info}
    # The kinds of commands' words, by their names in the manual; some commands have others. The kinds are object (that there is),
    # so (that can be), class, daemon, at (@daemon), file, text (a request), request (words), recipe, setting, topic.
    variable Kinds {NAME so SO object KEY object name object pattern object daemon daemon @daemon at class class file file path file
        request text address daemon}
    variable Special {
        sorma::async {method request word request}
        sorma::create {name so option recipe}
        sorma::pipe {step none}
        sorma::piece {dict none}
        sorma::retry {method request word request}
        sorma::inspect::retry {method request word request}
        sorma::at {request request word request time none}
        sorma::inspect::at {request request word request time none}
        sorma::trace {script none}
        sorma::classes {pattern class}
        sorma::catalogue {pattern none}
        sorma::manual {name topic}
        sorma::inspect::help {name topic}
        sorma::serve {name none}
        sorma::unserve {name none}
        sorma::resolve {name so}
        sorma::configure {option setting value setting}
        sorma::action {request none}
        sorma::example {request none}
    }
    # Commands of Tcl whose words are names of files.
    variable FileCommands {source cd open load glob exec file}
}

# ::sorma::complete --
#       What can stand at a point of a line.
# Arguments:
#       line    what has been typed
#       point   characters before the cursor
# Results:
#       A dict. Words that lead on end in / or ::.
#       from      column where the words go, up to the point
#       words     sorted, each as it is to be typed
#       hint      a line about the word that is expected there, or empty
proc ::sorma::complete {line point} {
    return [KeepTrail [list ::sorma::complete::Complete $line $point]]
}

proc ::sorma::complete::Complete {line point} {
    set point [expr {max(0, min($point, [string length $line]))}]
    set context [::sorma::line::context [string range $line 0 $point-1]]
    # Braces may hold a script or a text: the command around them knows.
    if {[dict exists $context outer words] && [WantsText [dict get $context outer words]]} {
        set context [dict get $context outer]
    }
    if {[dict exists $context comment]} {
        return [dict create from $point words {} hint {}]
    }
    dict with context {}
    if {[regexp {^(.*)\$([\w:]*(\([^()]*)?)$} $partial -> before name] && $quote ni {' \{}} {
        set candidates [::sorma::candidates::variables $name]
        set hint {}
        set skip [expr {[string length $before] + 1}]
    } else {
        lassign [ForWord $words $partial] candidates hint skip
    }
    if {$skip ne {}} {
        incr from $skip         ;# what is completed begins inside of the word
        set partial [string range $partial $skip end]
    }
    set found [lsort -unique [lsearch -all -inline -glob $candidates [::sorma::text::escape $partial]*]]
    # Names come from anywhere. None may do anything to a terminal, some have to be quoted, most are harmless.
    set all [join $found {}]
    if {[regexp {[[:cntrl:]]} $all]} {
        set found [lsearch -all -inline -not -regexp $found {[[:cntrl:]]}]
    }
    if {[regexp {[][\\{}"$; ]} $all]} {
        set found [lmap word $found {Quoted $word $quote}]
    }
    # A mistyped word is reported first. A word that nothing continues is complete. A flavor may be a new one.
    set slip [Slip [concat $words [if {$partial ne {} && $skip eq {} && [llength $found] == 0} {list $partial}]] [expr {$hint eq {}}]]
    if {$slip ne {}} {
        set hint $slip
    }
    set hint [string map {\n { }} $hint]
    if {[regexp {[^\x20-\x7e]} $hint]} {
        set hint [::sorma::text::clean $hint]
    }
    return [dict create from $from words $found hint $hint]
}

# A word as it has to be typed in its quotes.
proc ::sorma::complete::Quoted {word quote} {
    switch -- $quote {
        {} { return [string map {\\ \\\\ \[ \\\[ \] \\\] \{ \\\{ \} \\\} \" \\\" $ \\$ ; \\; { } {\ } \t \\t \n \\n} $word] }
        \" { return [string map {\\ \\\\ \[ \\\[ \" \\\" $ \\$} $word] }
    }
    return $word
}

# ---- contexts ----

# Does a command take its next word as text, not as a script?
proc ::sorma::complete::WantsText words {
    set kind [lindex [Expected $words] 0]
    return [expr {$kind in {recipe text} || ([lindex $words 1] in {CTRL DBX EXEC exec configure} && [::sorma::candidates::isName [lindex $words 0]])}]
}

# How a class makes objects without a name.
proc ::sorma::complete::Makers {name table} {
    return [if {[dict exists $table class] && [dict get $table class] eq $name && $name ni {sorm dict}} {list create new}]
}

# {candidates hint ?skip?} for the word after others. skip: where in the partial word the completed part begins.
proc ::sorma::complete::ForWord {words partial} {
    if {[llength $words] == 0} {
        return [ForCommand $partial]
    }
    set expected [Expected $words]
    if {[string match -* $partial] && [lindex $expected 0] in {so object at daemon class topic file either list}} {
        set options [::sorma::candidates::without [dict keys [::sorma::usage::options [Documented [lindex $words 0]]]] $words]
        if {[llength $options] > 0} {
            set expected [list list [lindex $expected 1] $options]
        }
    }
    return [ForKind $expected $partial]
}

proc ::sorma::complete::ForKind {expected partial} {
    lassign $expected kind one two
    switch -- $kind {
        request { return [::sorma::requestWords::next $one $partial] }
        methods {
            set table [::sorma::table guess $one]
            set methods [if {$one eq "dict"} {concat {CTRL DBX EXEC} [::sorma::candidates::subcommands dict]} else {concat $::sorma::complete::Methods [Makers $one $table]}]
            set hint [if {[dict exists $table purpose]} {string cat "[dict get $table class]: [dict get $table purpose]"}]
            return [list $methods $hint]
        }
        recipe {
            set skip [expr {[string last { } $partial] + 1}]
            set before [::sorma::line::words [string range $partial 0 $skip-1]]
            lassign [::sorma::requestWords::recipe $one [concat $two $before] [string range $partial $skip end]] candidates hint
            return [list $candidates $hint $skip]
        }
        text {
            set context [::sorma::line::context $partial]
            if {[dict exists $context comment] || [llength [dict get $context words]] == 0} {
                return [list [::sorma::candidates::names $partial] $one 0]
            }
            lassign [ForWord [dict get $context words] [dict get $context partial]] candidates hint
            return [list $candidates $hint [dict get $context from]]
        }
        object { return [list [::sorma::candidates::names $partial 1] $one] }
        so { return [list [::sorma::candidates::names $partial] $one] }
        at { return [list [lmap name [concat [::sorma::world names] [dict values [::sorma::world others]]] {string cat @ $name}] $one] }
        daemon { return [list [::sorma::world names] $one] }
        class { return [list [::sorma::table classes {}] $one] }
        topic { return [list [concat [::sorma::candidates::names $partial] [Topics]] $one] }
        setting { return [list [dict keys [::sorma::configure]] $one] }
        file { return [list [::sorma::candidates::files $partial] $one] }
        list { return [list $two $one] }
        either {
            lassign [ForKind [list $two $one] $partial] candidates hint skip
            return [list [concat $candidates [lindex $expected 3]] $hint $skip]
        }
        none { return [list {} $one] }
    }
    set found [::sorma::candidates::names $partial]
    if {$partial ne {} && [lsearch -glob $found [::sorma::text::escape $partial]*] < 0} {
        set found [::sorma::candidates::files $partial]
    }
    return [list $found $one]
}

# The name of a command in the manual; empty: it is not there. A word of scott's is meant only where it is a command.
proc ::sorma::complete::Documented command {
    set command [string trimleft $command :]
    set known [::sorma::usage::commands]
    if {[string match sorma::* $command]} {
        return [if {$command in $known} {set command}]
    }
    if {[::sorma::candidates::command $command] eq {}} {
        return {}
    }
    foreach name [list sorma::inspect::$command $command] {
        if {$name in $known && "::sorma::words::$command" eq [::sorma::candidates::command $command]} {
            return $name
        }
    }
}

# The word that a command expects next. One of these, or a kind of the table above and a hint:
#     request WORDS    methods NAME    recipe NAME WORDS    list HINT LIST    either HINT KIND LIST
proc ::sorma::complete::Expected words {
    variable FileCommands
    variable Methods
    set command [string trimleft [lindex $words 0] :]
    set rest [lrange $words 1 end]
    if {[string match sorma::so::* $command]} {
        set command [string range $command 11 end]
        lset words 0 $command
    }
    if {$command eq "sorma" && [llength $rest] > 0 && [Documented sorma::[lindex $rest 0]] ne {}} {
        return [Expected [list sorma::[lindex $rest 0] {*}[lrange $rest 1 end]]]
    }
    if {$command in $FileCommands} {
        return [list file [usage $command]]
    }
    if {$command eq "package" && [lindex $rest 0] in {require present versions names}} {
        return [list list {} [package names]]
    }
    set full [Documented $command]
    if {$full ne {}} {
        return [ByManual $full $rest]
    }
    if {[llength $rest] > 0 && [lindex $rest 0] in $Methods && ($command eq "dict" || [::sorma::candidates::isCallable $command])} {
        return [list request $words]
    }
    if {[lindex $rest 0] in {create new} && [regexp {^[a-z]\w*$} $command] && [::sorma::candidates::isCallable $command] && ![info object isa object ::$command]} {
        set words [lrange $rest [expr {[lindex $rest 0] eq "create" ? 2 : 1}] end]
        return [if {$rest eq "create"} {list none "$command create command ?-option value ...?"} else {list recipe $command $words}]
    }
    if {$command eq "dict" && [llength $rest] == 0 || [llength $rest] == 0 && [::sorma::candidates::isCallable $command]} {
        return [list methods $command]
    }
    set subcommands [::sorma::candidates::subcommands $command]
    if {[llength $rest] == 0 && [llength $subcommands] > 0} {
        return [list list {} $subcommands]
    }
    return [list any [usage $command]]
}

# The same for a command of the manual.
proc ::sorma::complete::ByManual {command typed} {
    set options [::sorma::usage::options $command]
    set hint [join [::sorma::usage::of $command] { | }]
    set plain {}
    for {set i 0} {$i < [llength $typed]} {incr i} {
        set word [lindex $typed $i]
        if {![dict exists $options $word] || $command eq "sorma::configure" || $command in {sorma::async sorma::retry sorma::inspect::retry} && [llength $plain] > 0} {
            lappend plain $word
        } elseif {[dict get $options $word] ne {} && [incr i] == [llength $typed]} {
            return [OptionValue [dict get $options $word] $hint]
        }
    }
    set kinds {}
    set literal {}
    set hints {}
    foreach way [::sorma::usage::words $command] usage [::sorma::usage::of $command] {
        if {![Fits $way $plain]} continue
        lappend hints $usage
        set next [At $way [llength $plain]]
        if {[regexp {^<([^|]*)>(\.\.\.)?$} $next -> name]} {
            lappend kinds [Kind $command $name]
        } elseif {$next ne {}} {
            lappend literal {*}[split [string trim $next <.>] |]
        }
    }
    set literal [lsort -unique $literal]
    if {[llength $hints] > 3} {
        set hint "[join [concat $command $plain]] [join $literal |] ..."
    } elseif {[llength $hints] > 0} {
        set hint [join $hints { | }]
    }
    set kind [lindex [concat [lsearch -all -inline -not -exact $kinds none] none] 0]
    switch -- $kind {
        request { return [Expected $plain] }
        recipe { return [list recipe [lindex $plain 0] [lrange $plain 1 end]] }
        setting {
            if {[llength $plain] % 2 == 1} {
                return [list list $hint [SettingValue [lindex $plain end]]]
            }
        }
        none { return [list list $hint [if {[llength $literal] > 0} {set literal} else {::sorma::candidates::without [dict keys $options] $typed}]] }
    }
    return [if {[llength $literal] > 0} {list either $hint $kind $literal} else {list $kind $hint}]
}

# The word of a way to call a command at a place; the last one may be repeated. Empty: there is none.
proc ::sorma::complete::At {way index} {
    if {$index >= [llength $way] && [string match *... [lindex $way end]]} {
        return [lindex $way end]
    }
    return [lindex $way $index]
}

# Can a command that is called in this way begin with these words?
proc ::sorma::complete::Fits {way plain} {
    set index -1
    foreach word $plain {
        set expected [At $way [incr index]]
        if {![string match <* $expected] && $expected ne {} && $word ni [split $expected |]} {
            return 0
        }
    }
    return 1
}

# The kind of a word of a command.
proc ::sorma::complete::Kind {command name} {
    variable Kinds
    variable Special
    foreach kinds [list [if {[dict exists $Special $command]} {dict get $Special $command}] $Kinds] {
        if {[dict exists $kinds $name]} {
            return [dict get $kinds $name]
        }
    }
    return none
}

# The kind of the word after an option, by its name in the manual.
proc ::sorma::complete::OptionValue {argument hint} {
    return [switch -glob -- $argument {
        *|* { list list $hint [split $argument |] }
        boolean { list list $hint {0 1} }
        file - path { list file $hint }
        default { list none $hint }
    }]
}

proc ::sorma::complete::SettingValue name {
    set settings [::sorma::configure]
    return [if {[dict exists $settings $name]} {list [dict get $settings $name]}]
}

# ---- commands of Tcl ----

proc ::sorma::complete::ForCommand partial {
    set pattern [::sorma::text::escape $partial]*
    set found [uplevel #0 [list info commands $pattern]]
    if {[string match *::* $partial] && ![string match ::* $partial]} {
        set found [lmap name $found {string trimleft $name :}]
    }
    set tail [string range $partial [expr {[string last : $partial] + 1}] end]
    if {[string match *::* $partial] && ![string is upper -strict [string index $tail 0]]} {
        set found [lsearch -all -inline -not -regexp $found {^(::)?sorma(::.*)?::[A-Z]\w*$}]
    }
    if {![string match *::* $partial]} {
        set found [concat $found [::sorma::candidates::names $partial]]
    }
    set found [concat $found [::sorma::candidates::children $partial]]
    set hint {}
    set exact [lsearch -exact -inline $found $partial]
    if {$exact eq {} && $partial ne {}} {
        set matches [lsort -unique [lsearch -all -inline -glob $found $pattern]]
        if {[llength $matches] == 1} {
            set exact [lindex $matches 0]
        }
    }
    if {$exact ne {}} {
        set hint [usage $exact]
        if {$hint eq {} && [::sorma::candidates::isCallable $exact]} {
            set table [::sorma::table guess $exact]
            if {$table ne {}} {
                set hint "[dict get $table class]: [dict get $table purpose]"
            }
        }
    }
    return [list $found $hint]
}

# ::sorma::complete::usage COMMAND -- how it is called, where that is known: by the manual, else by a proc's arguments.
proc ::sorma::complete::usage command {
    set command [string trimleft $command :]
    foreach name [list sorma::inspect::$command $command] {
        set usages [::sorma::usage::of $name]
        if {[llength $usages] > 0} {
            return [string map [list sorma::inspect::$command $command] [join $usages { | }]]
        }
    }
    if {[llength [info procs [::sorma::text::escape ::$command]]] == 0} {
        return {}
    }
    set words [list $command]
    foreach argument [info args ::$command] {
        if {[info default ::$command $argument default]} {
            lappend words ?$argument?
        } elseif {$argument eq "args"} {
            lappend words ?word? ...
        } else {
            lappend words $argument
        }
    }
    return [join $words]
}

# ---- names of service objects ----

proc ::sorma::complete::Topics {} {
    return [::sorma::usage::commands sorma::*]
}

# ---- slips of the pen ----

# A word that is not known while another one is near: "unknown -temp (did you mean -tempo?)". Empty: nothing looks wrong.
# flavors: may it be the flavor of an object, too?
proc ::sorma::complete::Slip {words flavors} {
    set rest [lassign $words name method]
    if {[llength $words] == 0 || ![regexp {^[a-z]\w*((\.[^@]+)?(@.*)?|(::\w+)+)$} $name]} {
        return {}
    }
    if {[::sorma::candidates::command $name] ne {} && [::sorma::candidates::isTaken $name] || [string match *::* $name]} {
        return [if {[::sorma::candidates::command $name] eq {}} {::sorma::candidates::unknown $name [::sorma::usage::commands sorma::*] {}}]
    }
    if {![regexp {[.@]} $name] && ![::sorma::candidates::isName $name] && $method ni $::sorma::complete::Methods} {
        return [if {![info exists ::auto_index($name)]} {::sorma::candidates::unknown $name [concat [uplevel #0 {info commands}] [::sorma::names] [::sorma::table classes {}]] {}}]
    }
    set slip [SlipOfName $name $flavors]
    if {$slip eq {} && $method ne {} && !($name eq "dict" && $method in [::sorma::candidates::subcommands dict])} {
        set slip [::sorma::candidates::unknown $method [concat $::sorma::complete::Methods {create new}] {}]
    }
    return [if {$slip ne {}} {set slip} else {::sorma::requestWords::slip $name $method $rest}]
}

# ... in the name of an object.
proc ::sorma::complete::SlipOfName {name flavors} {
    if {![regexp {^([a-z]\w*)(\.[^@]+)?(@(.*))?$} $name -> class flavor at where]} {
        return {}
    }
    if {$at ne {} && [regexp {^[\w.-]+$} $where]} {
        set elsewhere [dict keys [dict filter [::sorma::world others] value $where]]
        if {[llength $elsewhere] > 0 && $where ni [::sorma::world names]} {
            return "\"$where\" is at [join $elsewhere { and at }]"
        }
        set slip [::sorma::candidates::unknown $where [concat self [::sorma::world names]] "daemon "]
        if {$slip ne {} || $where ni [::sorma::world names]} {
            return $slip
        }
    }
    if {$where eq "self"} {
        set where {}
    }
    set objects [expr {$where eq {} ? [lsearch -all -inline -not [::sorma::names] *@*] : [::sorma::table objects $where]}]
    set service $class$flavor
    if {$service in $objects} {
        return {}
    }
    set slip [::sorma::candidates::unknown $class [concat [::sorma::table classes $where] [lmap object $objects {lindex [split $object .] 0}]] "class "]
    if {$slip eq {} && $flavor ne {} && $flavors} {
        set known [concat $objects [::sorma::table words $where]]
        set slip [::sorma::candidates::unknown $service [lsearch -all -inline -glob $known $class.*] {}]
    }
    return $slip
}
