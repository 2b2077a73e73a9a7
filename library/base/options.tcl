# options.tcl -- the one reader of options, -name value ..., as commands and programs take them. It knows no bus.
#
# A table is a dict: option -> {KIND ?DEFAULT?}. Without a DEFAULT it is empty, of a flag 0.
#
#     flag              stands alone; its value is 1
#     any               one word
#     word, {word WHAT} one word that is not empty; WHAT says in an error what is expected
#     words             some words, up to the next one that begins with a dash; given again it adds to them
#     rest              all words behind it
#     collect, {collect WHAT} one word; given again it adds to them
#     boolean           becomes 0 or 1
#     {whole LOW HIGH}  a whole number in decimal digits; HIGH empty: no limit
#     {seconds LOW HIGH}, {number LOW HIGH}
#     {choice A B ...}  one of these;  {some A B ...}: a list of these
#
# Errors name the option, what it expects and what came: {SORMA REQUEST SYNTAX}.

package provide sorma::options 1.0

namespace eval ::sorma::options {
    variable Suggest {}         ;# as suggest was told; empty: nothing is suggested
}

# ::sorma::options::parse --
#       Read the words of a command.
# Arguments:
#       table   the options that it has
#       words   what it was given
#       restVar variable that gets the words that are no options, wherever they stand; empty: there may be none
# Results:
#       A dict: each option of the table -> its value.
proc ::sorma::options::parse {table words {restVar {}}} {
    if {$restVar ne {}} {
        upvar 1 $restVar rest
    }
    return [take $table [defaults $table] $words {*}[if {$restVar ne {}} {string cat rest}]]
}

# ::sorma::options::defaults TABLE -- the values of options that are not given.
proc ::sorma::options::defaults table {
    return [dict map {option facts} $table {
        expr {[llength $facts] > 1 ? [lindex $facts 1] : [lindex $facts 0] eq "flag" ? 0 : {}}
    }]
}

# ::sorma::options::take TABLE SETTINGS WORDS ?restVar? -- as parse, beginning with the values of an earlier one.
proc ::sorma::options::take {table settings words {restVar {}}} {
    if {$restVar ne {}} {
        upvar 1 $restVar rest
        set rest {}
    }
    while {[llength $words] > 0} {
        if {$restVar ne {} && ![dict exists $table [lindex $words 0]] && ![string match -?* [lindex $words 0]]} {
            set words [lassign $words word]
            lappend rest $word
        } else {
            set settings [One $table $settings words]
        }
    }
    return $settings
}

# ::sorma::options::leading TABLE wordsVar -- as parse, up to the first word that begins with no dash; the others stay in wordsVar.
proc ::sorma::options::leading {table wordsVar} {
    upvar 1 $wordsVar words
    set settings [defaults $table]
    while {[string match -?* [lindex $words 0]]} {
        set settings [One $table $settings words]
    }
    return $settings
}

# Take the option off the words with which they begin.
proc ::sorma::options::One {table settings wordsVar} {
    upvar 1 $wordsVar words
    set words [lassign $words option]
    if {![dict exists $table $option]} {
        Fail "bad option \"$option\"[Near $option [dict keys $table]]: must be [oneOf [lsort [dict keys $table]]]"
    }
    set kind [lindex [dict get $table $option] 0]
    if {$kind eq "flag"} {
        return [dict replace $settings $option 1]
    }
    if {[llength $words] == 0 || $kind eq "words" && [string match -* [lindex $words 0]]} {
        Fail "$option needs a value: [expected $kind]"
    }
    if {$kind in {words rest}} {
        for {set n 1} {$n < [llength $words] && ($kind eq "rest" || ![string match -* [lindex $words $n]])} {incr n} {}
        dict lappend settings $option {*}[lrange $words 0 $n-1]
        set words [lrange $words $n end]
        return $settings
    }
    set words [lassign $words value]
    if {[lindex $kind 0] eq "collect"} {
        dict lappend settings $option $value
    } else {
        dict set settings $option [check $option $kind $value]
    }
    return $settings
}

proc ::sorma::options::Near {word known} {
    variable Suggest
    return [if {$Suggest ne {}} {{*}$Suggest $word $known}]
}

# ::sorma::options::suggest PREFIX -- from now on an error of a wrong option, or of a wrong choice, also has the text that PREFIX WORD KNOWN returns.
proc ::sorma::options::suggest prefix {
    variable Suggest $prefix
}

# ::sorma::options::check NAME KIND VALUE -- the value as it is used; fails when it is none of that kind. NAME: whose value it is.
proc ::sorma::options::check {name kind value} {
    lassign $kind type low high
    switch -- $type {
        whole { set good [expr {[regexp {^\d{1,18}$} $value] && [scan $value %lld] >= $low && ($high eq {} || [scan $value %lld] <= $high)}] }
        seconds - number { set good [expr {[string is double -strict $value] && $value >= $low && ($high eq {} || $value <= $high)}] }
        choice { set good [expr {$value in [lrange $kind 1 end]}] }
        some { set good [expr {![catch {llength $value}] && [llength [lmap word $value {if {$word in $kind} continue; set word}]] == 0}] }
        word { set good [expr {$value ne {}}] }
        boolean {
            set good [string is boolean -strict $value]
            if {$good} {
                set value [expr {bool($value)}]
            }
        }
        default { set good 1 }
    }
    if {!$good} {
        Fail "$name expects [expected $kind], got \"$value\"[Wrong $kind $value]"
    }
    return $value
}

# The words that are near a mistyped choice, or near the first wrong word of a list of choices.
proc ::sorma::options::Wrong {kind value} {
    set known [lassign $kind type]
    if {$type eq "choice"} {
        return [Near $value $known]
    }
    if {$type eq "some" && [string is list $value]} {
        return [Near [lindex [lmap word $value {if {$word in $known} continue; set word}] 0] $known]
    }
}

# ::sorma::options::expected KIND -- what a value has to be, in words.
proc ::sorma::options::expected kind {
    set words [lassign $kind type]
    lassign $words low high
    switch -- $type {
        whole - seconds - number {
            set what [dict get {whole {a whole number} seconds seconds number {a number}} $type]
            return "$what from $low[expr {$high eq {} ? {} : " to $high"}]"
        }
        boolean { return "a boolean" }
        choice { return [oneOf $words] }
        some { return "a list of [oneOf $words and]" }
        words - rest { return "one word or more" }
        word { return [expr {$low ne {} ? $low : "a word that is not empty"}] }
        collect { return [expr {$low ne {} ? $low : "a word"}] }
        default { return "a word" }
    }
}

# ::sorma::options::oneOf WORDS ?CONJUNCTION? -- a, b, or c
proc ::sorma::options::oneOf {words {conjunction or}} {
    switch -- [llength $words] {
        0 { return none }
        1 { return [lindex $words 0] }
        2 { return [join $words " $conjunction "] }
        default { return "[join [lrange $words 0 end-1] {, }], $conjunction [lindex $words end]" }
    }
}

proc ::sorma::options::Fail text {
    return -code error -level 2 -errorcode {SORMA REQUEST SYNTAX} $text
}
