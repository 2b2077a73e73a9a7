# complete.tcl -- what can be typed next: for the terminal, and for whatever else takes lines.
#
# A line is read as Tcl reads it, up to the point. The place of the point decides: a command's name, a word of a request, a
# value, a recipe in quotes. Tables come from table.tcl: nothing is made, nothing is called, nobody is waited for.

package require sorma::line
package require sorma::table
package require sorma::text
package require sorma::usage
package provide sorma::complete 1.0
namespace eval ::sorma::complete {
    variable Methods {CTRL DBX EXEC cget configure destroy exec info}
    variable Infos {actions class dump example help inspections location methods name options purpose signature trail version}
    # What the words of commands stand for, by their names in the manual; of some commands it is something else. object (that there
    # is), so (that can be), class, daemon, at (@daemon), file, text (a request), request (words), recipe, setting, topic.
    variable Kinds {NAME so SO object KEY object name object pattern object daemon daemon @daemon at class class file file path file
        request text address daemon}
    variable Special {
        sorma::async {method request word request}
        sorma::create {name so option recipe}
        sorma::pipe {step none}
        sorma::piece {dict none}
        sorma::retry {method request word request}
        sorma::inspect::retry {method request word request}
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
#       A dict: from (column where the words go, up to the point), words (sorted, each as it is to be typed) and hint (one
#       line about what is expected there, or empty). Words that lead on end in / or ::.
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
        set candidates [Variables $name]
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
    return [expr {$kind in {recipe text} || ([lindex $words 1] in {CTRL DBX EXEC exec configure} && [isName [lindex $words 0]])}]
}

# How a class makes objects without a name.
proc ::sorma::complete::Makers {name table} {
    return [if {[dict exists $table class] && [dict get $table class] eq $name && $name ni {sorm dict}} {list create new}]
}

# Variables of the global level, elements of arrays included.
proc ::sorma::complete::Variables name {
    if {[regexp {^([^(]+)\((.*)$} $name -> array element]} {
        if {![uplevel #0 [list array exists $array]]} {
            return {}
        }
        return [lmap key [uplevel #0 [list array names $array [::sorma::text::escape $element]*]] {string cat $array ( $key )}]
    }
    set found [uplevel #0 [list info vars [::sorma::text::escape $name]*]]
    foreach child [Children $name] {
        lappend found $child
    }
    return $found
}

# Namespaces that a partial name may lead into, written as it is.
proc ::sorma::complete::Children name {
    set tail [string last :: $name]
    set parent [if {$tail > 0} {string range $name 0 $tail-1} else {string cat ::}]
    set parent ::[string trimleft $parent :]
    if {![namespace exists $parent]} {
        return {}
    }
    set found [lmap child [namespace children $parent] {string cat $child ::}]
    if {![string match ::* $name]} {
        set found [lmap child $found {string range $child 2 end}]
    }
    return $found
}

# {candidates hint ?skip?} for the word after others. skip: where in the partial word the completed part begins.
proc ::sorma::complete::ForWord {words partial} {
    if {[llength $words] == 0} {
        return [ForCommand $partial]
    }
    set expected [Expected $words]
    if {[string match -* $partial] && [lindex $expected 0] in {so object at daemon class topic file either list}} {
        set options [Without [dict keys [::sorma::usage::options [Documented [lindex $words 0]]]] $words]
        if {[llength $options] > 0} {
            set expected [list list [lindex $expected 1] $options]
        }
    }
    return [ForKind $expected $partial]
}

proc ::sorma::complete::ForKind {expected partial} {
    lassign $expected kind one two
    switch -- $kind {
        request { return [Request $one $partial] }
        methods {
            set table [::sorma::table guess $one]
            set methods [if {$one eq "dict"} {concat {CTRL DBX EXEC} [Subcommands dict]} else {concat $::sorma::complete::Methods [Makers $one $table]}]
            set hint [if {[dict exists $table purpose]} {string cat "[dict get $table class]: [dict get $table purpose]"}]
            return [list $methods $hint]
        }
        recipe {
            set skip [expr {[string last { } $partial] + 1}]
            set before [::sorma::line::words [string range $partial 0 $skip-1]]
            lassign [Recipe $one [concat $two $before] [string range $partial $skip end]] candidates hint
            return [list $candidates $hint $skip]
        }
        text {
            set context [::sorma::line::context $partial]
            if {[dict exists $context comment] || [llength [dict get $context words]] == 0} {
                return [list [Names $partial] $one 0]
            }
            lassign [ForWord [dict get $context words] [dict get $context partial]] candidates hint
            return [list $candidates $hint [dict get $context from]]
        }
        object { return [list [Names $partial 1] $one] }
        so { return [list [Names $partial] $one] }
        at { return [list [lmap name [concat [::sorma::world names] [dict values [::sorma::world others]]] {string cat @ $name}] $one] }
        daemon { return [list [::sorma::world names] $one] }
        class { return [list [::sorma::table classes {}] $one] }
        topic { return [list [concat [Names $partial] [Topics]] $one] }
        setting { return [list [dict keys [::sorma::configure]] $one] }
        file { return [list [Files $partial] $one] }
        list { return [list $two $one] }
        either {
            lassign [ForKind [list $two $one] $partial] candidates hint skip
            return [list [concat $candidates [lindex $expected 3]] $hint $skip]
        }
        none { return [list {} $one] }
    }
    set found [Names $partial]
    if {$partial ne {} && [lsearch -glob $found [::sorma::text::escape $partial]*] < 0} {
        set found [Files $partial]
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
    if {[Known $command] eq {}} {
        return {}
    }
    foreach name [list sorma::inspect::$command $command] {
        if {$name in $known && "::sorma::words::$command" eq [Known $command]} {
            return $name
        }
    }
}

# The word that a command expects next: {kind ...}. request WORDS; methods NAME; recipe NAME WORDS; list HINT LIST; either HINT KIND LIST;
# else a kind of the table above and a hint.
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
    if {[llength $rest] > 0 && [lindex $rest 0] in $Methods && [isName $command] && !($command ne "dict" && [Occupied $command])} {
        return [list request $words]
    }
    if {[lindex $rest 0] in {create new} && [regexp {^[a-z]\w*$} $command] && [isName $command] && ![Occupied $command] && ![info object isa object ::$command]} {
        set words [lrange $rest [expr {[lindex $rest 0] eq "create" ? 2 : 1}] end]
        return [if {$rest eq "create"} {list none "$command create command ?-option value ...?"} else {list recipe $command $words}]
    }
    if {$command eq "dict" && [llength $rest] == 0 || [llength $rest] == 0 && [isName $command] && ![Occupied $command]} {
        return [list methods $command]
    }
    set subcommands [Subcommands $command]
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
        none { return [list list $hint [if {[llength $literal] > 0} {set literal} else {Without [dict keys $options] $typed}]] }
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

# A command of the global namespace, or of what it looks into. Empty: there is none.
proc ::sorma::complete::Known name {
    return [uplevel #0 [list namespace which -command $name]]
}

# Is a command of that name something else than a service object? A class in Tcl is both.
proc ::sorma::complete::Occupied name {
    if {[Known $name] eq {} || [::sorma::AnonymousObject $name] ne {}} {
        return 0
    }
    if {[string match *::* $name]} {
        return 1
    }
    return [expr {[namespace which -command ::sorma::so::$name] eq {} && !([info object isa object ::$name] && [info object isa class ::$name]
        && [llength [::sorma::classes [::sorma::text::escape $name]]] > 0)}]
}

# Can it be a service object? Cheap: nothing is looked up elsewhere.
proc ::sorma::complete::isName name {
    if {[::sorma::AnonymousObject $name] ne {}} {
        return 1
    }
    if {![regexp {^([[:alpha:]]\w*)(\.[^\s@\[\]{}$"\\;]*)?(@.+)?$} $name -> class flavor where]} {
        return 0
    }
    if {$where ne {}} {
        return 1
    }
    if {[string is upper -strict [string index $class 0]]} {
        return [expr {[lindex [::sorma::table locate $name] 1] ne {}}]
    }
    return [expr {[::sorma::exists $name] || [llength [::sorma::classes $class]] > 0 || [::sorma::table hasPackage sorma::service::$class]}]
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
        set found [concat $found [Names $partial]]
    }
    set found [concat $found [Children $partial]]
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
        if {$hint eq {} && [isName $exact] && ![Occupied $exact]} {
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

# Words that can follow a command: of an ensemble, of an object, of a future, of a stream.
proc ::sorma::complete::Subcommands command {
    set command ::[string trimleft $command :]
    if {[namespace which -command $command] eq {}} {
        return {}
    }
    if {[namespace ensemble exists $command]} {
        set map [namespace ensemble configure $command -map]
        if {[dict size $map] > 0} {
            return [dict keys $map]
        }
        set listed [namespace ensemble configure $command -subcommands]
        if {[llength $listed] > 0} {
            return $listed
        }
        set space [namespace ensemble configure $command -namespace]
        set found {}
        foreach pattern [namespace eval $space {namespace export}] {
            foreach name [info commands ${space}::$pattern] {
                lappend found [namespace tail $name]
            }
        }
        return $found
    }
    if {[info object isa object $command]} {
        return [info object methods $command -all]
    }
    if {[string match ::sorma::future::* $command]} {
        return {cancel destroy done request result take wait}
    }
    if {[string match ::sorma::streams::s* $command]} {
        return {close next}
    }
    return {}
}

# ---- names of service objects ----

# Names that can be called: objects, flavors of dictionaries, classes; here, and at each daemon as far as it is known.
# made: only objects that are there.
proc ::sorma::complete::Names {partial {made 0}} {
    set at [string first @ $partial]
    if {$at >= 0} {
        set object [string range $partial 0 $at]
        set found [lmap name [::sorma::world names] {string cat $object $name}]
        if {[string index $partial $at+1] eq "/"} {
            foreach file [Files [string range $partial $at+1 end]] {
                lappend found $object$file
            }
        }
        return $found
    }
    set pattern [::sorma::text::escape $partial]*
    set found [::sorma::names $pattern]
    if {!$made} {
        set words [lsearch -all -inline -glob [::sorma::table words {}] $pattern]
        set found [concat $found [lsearch -all -inline -glob [::sorma::table classes {}] $pattern] \
            [lsearch -all -inline -regexp $words {^[[:alpha:]]\w*(\.[^\s@\[\]{}$"\\;]+)?$}]]
    }
    if {[regexp {^([A-Z][A-Z0-9_]*)\.} $partial -> class]} {
        lassign [::sorma::table locate $class] service where
        foreach name [concat [::sorma::table objects $where] [::sorma::table words $where]] {
            if {[string match $service.* $name]} {
                lappend found $class[string range $name [string length $service] end]
            }
        }
    }
    if {$partial ne {}} {
        foreach daemon [::sorma::world names] {
            set lists [list [::sorma::table objects $daemon]]
            set known [::sorma::table inventory $daemon]
            if {!$made && $known ne {}} {
                lappend lists [dict keys [dict get $known classes]] [dict get $known words]
            }
            foreach names $lists {
                foreach name [lsearch -all -inline -glob $names $pattern] {
                    if {[regexp {^[[:alpha:]]} $name]} {
                        lappend found $name@$daemon
                    }
                }
            }
        }
    }
    return $found
}

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
    if {[Known $name] ne {} && [Occupied $name] || [string match *::* $name]} {
        return [if {[Known $name] eq {}} {Unknown $name [::sorma::usage::commands sorma::*] {}}]
    }
    if {![regexp {[.@]} $name] && ![isName $name] && $method ni $::sorma::complete::Methods} {
        return [if {![info exists ::auto_index($name)]} {Unknown $name [concat [uplevel #0 {info commands}] [::sorma::names] [::sorma::table classes {}]] {}}]
    }
    set slip [SlipOfName $name $flavors]
    if {$slip eq {} && $method ne {} && !($name eq "dict" && $method in [Subcommands dict])} {
        set slip [Unknown $method [concat $::sorma::complete::Methods {create new}] {}]
    }
    return [if {$slip ne {}} {set slip} else {SlipOfRequest $name $method $rest}]
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
        set slip [Unknown $where [concat self [::sorma::world names]] "daemon "]
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
    set slip [Unknown $class [concat [::sorma::table classes $where] [lmap object $objects {lindex [split $object .] 0}]] "class "]
    if {$slip eq {} && $flavor ne {} && $flavors} {
        set known [concat $objects [::sorma::table words $where]]
        set slip [Unknown $service [lsearch -all -inline -glob $known $class.*] {}]
    }
    return $slip
}

# ... in what follows the method: an option, a word, or one of the choices of an option.
proc ::sorma::complete::SlipOfRequest {name method words} {
    set table [if {$method in {CTRL DBX cget configure info}} {::sorma::table guess $name}]
    if {$table eq {}} {
        return {}
    }
    if {$method eq "info"} {
        return [if {[llength $words] > 0} {Unknown [lindex $words 0] $::sorma::complete::Infos {}}]
    }
    set ctrl [expr {$method ne "DBX"}]
    set known [if {$method in {CTRL DBX}} {KnownNames $table $ctrl} else {OptionNames $table}]
    set before {}
    foreach word $words {
        lassign [State $table $ctrl $before] what item
        lappend before $word
        set slip {}
        if {$what eq "value" && [lindex $item 1] eq "enum"} {
            set slip [Unknown $word [lindex $item 3] "[lindex $item 0] "]
        } elseif {$what eq "name" || [regexp {^-[[:alpha:]]} $word]} {
            set slip [Unknown $word $known {}]
        }
        if {$slip ne {}} {
            return $slip
        }
    }
    return {}
}

proc ::sorma::complete::Unknown {word known what} {
    if {$word in $known} {
        return {}
    }
    set hint [::sorma::DidYouMean $word $known]
    return [if {$hint ne {}} {string cat "unknown $what" $word $hint}]
}

# ---- requests ----

# {candidates hint ?skip?} for the next word of NAME METHOD WORD...
proc ::sorma::complete::Request {words partial} {
    variable Infos
    set rest [lassign $words name method]
    set table [::sorma::table guess $name]
    if {$table eq {}} {
        return [list {} {}]
    }
    switch -- $method {
        CTRL { return [Words $name $table 1 $rest $partial] }
        DBX { return [Words $name $table 0 $rest $partial] }
        EXEC { return [Exec $table $rest $partial] }
        exec {
            set waits [expr {[lindex $rest end] in {-text -floats -ints -any}}]
            return [list [if {!($waits)} {string cat {-any -floats -ints -text}}] [Signature $table]]
        }
        configure {
            if {[llength $rest] % 2 == 1} {
                return [Value $table [lindex $rest end] $partial]
            }
            return [list [Without [OptionNames $table] $rest] [NameHint $table $partial 1]]
        }
        cget {
            return [list [if {[llength $rest] == 0} {OptionNames $table}] [NameHint $table $partial 1]]
        }
        info {
            if {[llength $rest] == 0} {
                return [list $Infos "$name info what"]
            }
            return [list [if {$rest eq "options"} {OptionNames $table}] [NameHint $table $partial 1]]
        }
    }
    return [list {} {}]
}

proc ::sorma::complete::OptionNames table {
    return [lmap option [dict get $table options] {lindex $option 0}]
}

proc ::sorma::complete::Without {names used} {
    return [lmap name $names {if {$name in $used} continue; set name}]
}

# CTRL and DBX: names of the table, or what follows the last of them.
proc ::sorma::complete::Words {name table ctrl words partial} {
    lassign [State $table $ctrl $words] what item index open
    set names [Without [KnownNames $table $ctrl] $words]
    if {$what eq "value"} {
        lassign [Value $table [lindex $item 0] $partial] candidates hint skip
        return [list [if {$open} {concat $candidates $names} else {set candidates}] $hint $skip]
    }
    if {$what eq "argument"} {
        lassign [Argument $name $table $item [lrange $words end-[expr {$index - 1}] end] $partial] candidates hint skip
        return [list [if {$open} {concat $candidates $names} else {set candidates}] $hint $skip]
    }
    return [list $names [NameHint $table $partial $ctrl]]
}

# dict of all words that CTRL or DBX of a class knows -> {option ITEM} or {action ITEM}.
proc ::sorma::complete::KnownItems {table ctrl} {
    set known {}
    if {$ctrl} {
        foreach item [dict get $table options] {
            dict set known [lindex $item 0] [list option $item]
        }
    }
    set own [dict get $table [expr {$ctrl ? "actions" : "inspections"}]]
    foreach item [concat [lindex [::sorma::table common] [expr {!$ctrl}]] $own] {
        dict set known [lindex $item 0] [list action $item]
    }
    return $known
}

proc ::sorma::complete::KnownNames {table ctrl} {
    return [dict keys [KnownItems $table $ctrl]]
}

# Where words lead: {name}; {value OPTION 0 OPEN}; {argument ACTION INDEX OPEN}. OPEN: another name may come instead.
proc ::sorma::complete::State {table ctrl words} {
    set known [KnownItems $table $ctrl]
    set n [llength $words]
    for {set i 0} {$i < $n} {} {
        set word [lindex $words $i]
        incr i
        if {![dict exists $known $word]} {
            continue
        }
        lassign [dict get $known $word] kind item
        if {$kind eq "option"} {
            set flag [expr {[lindex $item 1] eq "flag"}]
            if {$i == $n} {
                return [list value $item 0 $flag]
            }
            if {!$flag || ![string match -* [lindex $words $i]]} {
                incr i
            }
            continue
        }
        lassign $item - usage - least most
        set count 0
        while {$i < $n && ($count < $least || $most == -1 || ($count < $most && ![dict exists $known [lindex $words $i]]))} {
            incr i
            incr count
        }
        if {$i == $n && ($most == -1 || $count < $most)} {
            return [list argument $item $count [expr {$count >= $least && $most != -1}]]
        }
    }
    return {name}
}

# {candidates hint} for the value of an option.
proc ::sorma::complete::Value {table name partial} {
    set option [lsearch -inline -index 0 -exact [dict get $table options] $name]
    if {$option eq {}} {
        return [list {} {}]
    }
    lassign $option name type unit range default value help
    switch -- $type {
        enum { set candidates $range }
        flag { set candidates {0 1} }
        service { set candidates [Names $partial] }
        default {
            set candidates {}
            foreach known [list $value $default] {
                if {$known ne {}} {
                    lappend candidates $known
                }
            }
            if {$type eq "string" && [regexp -nocase {file|folder|path|socket|script} "$name $help"]} {
                set candidates [concat $candidates [Files $partial]]
            }
        }
    }
    return [list $candidates [optionHint $table $option]]
}

# An option in one line: -transferSpeed double [m/s] 0.01 .. 1.5, default 0.5, now 0.2: speed while loaded
proc ::sorma::complete::optionHint {table option} {
    lassign $option name type unit range default value help
    set text "$name $type"
    if {$unit ne {}} {
        append text " \[$unit\]"
    }
    if {$range ne {}} {
        append text " " [if {$type eq "enum"} {join $range |} else {set range}]
    }
    if {$default ne {}} {
        append text ", default [OneLine $default]"
    }
    if {[dict get $table exists]} {
        append text ", now [if {$value eq {}} {string cat empty} else {OneLine $value}]"
        if {[dict exists $table age] && [dict get $table age] ne {}} {
            append text " ([dict get $table age])"
        }
    }
    if {[dict exists $table hints $name measured]} {
        append text ", measured"
    } elseif {$name in [dict get $table fixed]} {
        append text ", recipe only"
    }
    if {$help ne {}} {
        append text ": $help"
    }
    return $text
}

# A value of any kind in one line, harmless to a terminal.
proc ::sorma::complete::OneLine value {
    return [string map {\n \\n} [::sorma::text::clean $value]]
}

proc ::sorma::complete::ActionHint item {
    lassign $item name usage help
    return [string trimright "[string trimright "$name $usage"]: $help" ": "]
}

# About the name that is being typed, when it can only be one.
proc ::sorma::complete::NameHint {table partial ctrl} {
    set known [KnownItems $table $ctrl]
    if {[dict exists $known $partial]} {
        set found [list $partial]
    } else {
        set found [dict keys $known [::sorma::text::escape $partial]*]
    }
    if {$partial eq {} || [llength $found] != 1} {
        return {}
    }
    lassign [dict get $known [lindex $found 0]] kind item
    return [if {$kind eq "option"} {optionHint $table $item} else {ActionHint $item}]
}

# {candidates hint ?skip?} for an argument of an action; before: its arguments so far. Its name in the usage tells its meaning.
proc ::sorma::complete::Argument {name table item before partial} {
    set index [llength $before]
    lassign $item action usage
    set hint [ActionHint $item]
    set placeholders [lmap word $usage {
        set word [string trim $word ?]
        if {$word eq "..."} continue
        set word
    }]
    set what [lindex $placeholders [expr {min($index, [llength $placeholders] - 1)}]]
    lassign [::sorma::table locate $name] service where
    set class [dict get $table class]
    if {$class eq "dict" && $action eq "-add" && $index > 0 || $class eq "sorm" && $action eq "-create" && $index > 0} {
        set skip [expr {[string last { } $partial] + 1}]
        set typed [concat [lrange $before 1 end] [::sorma::line::words [string range $partial 0 $skip-1]]]
        # An entry at a daemon is for its objects, of classes that perhaps it alone knows.
        set entry [lindex $before 0]
        set object [expr {$where ne {} && $class eq "dict" && [string first @ $entry] < 0 ? "$entry@$where" : $entry}]
        lassign [Recipe $object $typed [string range $partial $skip end] [expr {$class eq "dict" ? $where : {}}]] candidates more
        return [list $candidates [if {$more eq {}} {set hint} else {set more}] $skip]
    }
    switch -glob -- $what {
        option { set candidates [OptionNames $table] }
        file - folder - path - script { set candidates [Files $partial] }
        word { set candidates [if {$class eq "dict"} {concat [::sorma::table words $where] [Classes $action $where]}] }
        name - target - pattern - object {
            set candidates [if {$action eq "-classes"} {::sorma::table classes $where} else {::sorma::table objects $where}]
            if {$what eq "pattern" && $class eq "dict"} {
                set candidates [::sorma::table words $where]
            }
        }
        class { set candidates [::sorma::table classes $where] }
        what {
            set candidates $::sorma::complete::Infos
            if {$action eq "-inventory"} {
                set candidates {addresses classes names objects serves words}
            }
        }
        daemon { set candidates [::sorma::world names] }
        0..2 { set candidates {0 1 2} }
        default { set candidates [Alternatives $what] }
    }
    return [list $candidates $hint]
}

# New entries may be for any class, old ones are those that there are.
proc ::sorma::complete::Classes {action where} {
    return [if {$action eq "-add"} {::sorma::table classes $where}]
}

# Literal words of a usage text: a|b|c. A single word is the name of something.
proc ::sorma::complete::Alternatives usage {
    return [if {[string match *|* $usage]} {lsearch -all -inline -regexp [split $usage |?] {^[\w-]+$}}]
}

# A recipe: words of CTRL of the class of NAME, and -SUBST with an entry of the dictionary.
# where: the daemon of that dictionary; empty: here.
proc ::sorma::complete::Recipe {name words partial {where {}}} {
    if {[lindex $words end] eq "-SUBST"} {
        return [list [::sorma::table words $where] "-SUBST word: what that entry says is put here"]
    }
    set table {}
    if {[regexp {^[[:alpha:]]} $name]} {
        set table [::sorma::table guess $name]
    }
    if {$table eq {}} {
        return [list -SUBST {}]
    }
    dict set table actions {}
    lassign [State $table 1 $words] what item
    if {$what eq "value"} {
        lassign [Value $table [lindex $item 0] $partial] candidates hint
        if {[lindex $item 1] ne "flag"} {
            return [list $candidates $hint]
        }
    } else {
        set candidates {}
        set hint [NameHint $table $partial 1]
    }
    return [list [concat $candidates -SUBST [Without [OptionNames $table] $words]] $hint]
}

# EXEC: parts of a message, and words of the class's own. {candidates hint}
proc ::sorma::complete::Exec {table words partial} {
    set hint [Signature $table]
    set used {}
    for {set i 0} {$i < [llength $words]} {} {
        set word [lindex $words $i]
        incr i
        switch -- $word {
            TMSG - AMSG {
                if {$i == [llength $words]} {
                    return [list {} $hint]
                }
                incr i
            }
            FMSG - IMSG {
                if {$i == [llength $words]} {
                    return [list [Count $table $word] $hint]
                }
                set count [lindex $words $i]
                if {![string is integer -strict $count]} {
                    return [list {} $hint]
                }
                if {[llength $words] - $i - 1 < $count} {
                    return [list {} "$word: number [expr {[llength $words] - $i}] of $count; $hint"]
                }
                incr i [expr {1 + $count}]
            }
        }
        lappend used $word
    }
    set keys {}
    foreach part [dict get $table reads] {
        lappend keys [dict get {text TMSG floats FMSG ints IMSG any AMSG} [lindex $part 0]]
    }
    if {[llength $keys] == 0} {
        set keys {TMSG FMSG IMSG AMSG}
    }
    return [list [Without [concat $keys [Alternatives [dict get $table words]]] $used] $hint]
}

# How many numbers EXEC reads, where the table says so.
proc ::sorma::complete::Count {table key} {
    set part [lsearch -inline -index 0 [dict get $table reads] [expr {$key eq "FMSG" ? "floats" : "ints"}]]
    lassign $part - low high
    return [if {$low ne {} && $low eq $high} {set low}]
}

proc ::sorma::complete::Signature table {
    set text [string map {\n "; "} [dict get $table signature]]
    if {[dict get $table example] ne {}} {
        append text [expr {$text eq {} ? {} : "; "}] "as in: " [dict get $table example]
    }
    return $text
}

# ---- files ----

proc ::sorma::complete::Files partial {
    set folder [string range $partial 0 [string last / $partial]]
    set tail [string range $partial [string length $folder] end]
    set place [if {$folder eq {}} {string cat .} else {set folder}]
    if {[string match ~* $place]} {
        if {![info exists ::env(HOME)] || [string index $place 1] ne "/"} {
            return {}
        }
        set place $::env(HOME)[string range $place 1 end]
    }
    set pattern [string map {\\ \\\\ * \\* ? \\? \[ \\\[ \] \\\] \{ \\\{ \} \\\}} $tail]*
    set found {}
    if {[catch {glob -nocomplain -tails -directory $place $pattern} names]} {
        return {}
    }
    if {[string match .* $tail]} {
        catch {lappend names {*}[glob -nocomplain -tails -types hidden -directory $place $pattern]}
    }
    foreach name $names {
        if {$name in {. ..}} continue
        lappend found $folder$name[expr {[file isdirectory [file join $place $name]] ? "/" : {}}]
    }
    return $found
}
