# errorPage.tcl -- each error code of the sources, in doctools, for the page that includes it: [include errors.codes].
#
# The texts come from sorma::catalogue, the way out from the lists of errors of other pages, and the test from tests/*.test.

namespace eval ::errorPage {}

# ::errorPage::codes PAGES TESTS -- sections of the page. PAGES: texts of the other pages; TESTS: the folder with the suites.
proc ::errorPage::codes {pages tests} {
    foreach file [glob -directory [file join $::sorma::library services] *] {
        catch {package require sorma::service::[file rootname [file tail $file]]}
    }
    set known {}                ;# dict: {AREA SYMBOL} -> list of {severity text}
    foreach entry [::sorma::catalogue] {
        lassign $entry area symbol severity text
        dict lappend known [list $area $symbol] [list $severity [regsub -all {\{\d*\}} $text ...]]
    }
    set told [Told $pages]
    # Pieces of texts that belong to one code alone.
    set owners {}
    dict for {code texts} $known {
        foreach piece [Pieces $texts] {
            dict set owners $piece $code 1
        }
    }
    set all [Tests $tests]
    set out {}
    set last {}
    foreach code [lsort [dict keys $known]] {
        lassign $code area symbol
        if {$area ne $last} {
            append out [expr {$last eq {} ? {} : "\[list_end]\n"}] "\n\[section {$area}]\n\[list_begin definitions]\n"
            set last $area
        }
        append out "\[def {$code}] [expr {[dict exists $told $code] ? [dict get $told $code] : {}}]\n\[example_begin]\n"
        set texts [lsort -unique [dict get $known $code]]
        foreach pair $texts {
            lassign $pair severity text
            append out [::classPage::plain "[expr {$severity eq "error" ? {} : "($severity) "}]$text"] \n
        }
        append out "\[example_end]\n"
        set test [Reaching $code [lmap piece [Pieces $texts] {
            if {[dict size [dict get $owners $piece]] > 1} continue
            set piece
        }] $all]
        append out [if {$test ne {}} {string cat "A test of it: $test.\n"} else {string cat "No test names it.\n"}]
    }
    return "$out\[list_end]"
}

# The texts of the lists of errors: a dict, {AREA SYMBOL} -> doctools.
proc ::errorPage::Told pages {
    set told {}
    foreach text $pages {
        # Marks: an item ends where the next one begins, or its list.
        set text [string map [list "\[def " \1 "\[list_end\]" \2] $text]
        foreach {- head body} [regexp -all -inline "\1\\{(\[A-Z\]\[A-Z_ ,\]*)\\}\\](\[^\1\2\]*)" $text] {
            foreach item [split $head ,] {
                set item [string trim $item]
                if {[llength $item] == 2} {
                    set area [lindex $item 0]
                }
                # Options belong to the page that explains them.
                dict set told [list $area [lindex $item end]] [string trim [string map {"\[option " "\[const "} $body]]
            }
        }
    }
    return $told
}

# List of {name body} of all tests. A loop is the body of the test in it, with its table.
proc ::errorPage::Tests folder {
    set found {}
    foreach file [lsort [glob -directory $folder *.test]] {
        set in [open $file]
        fconfigure $in -encoding utf-8
        set text [string map [list "\ntest " "\1test " "\nforeach " "\1foreach "] [read $in]]
        close $in
        foreach body [lrange [split $text \1] 1 end] {
            if {[regexp -line {^\s*test (\S+) } $body - name]} {
                lappend found [list [regsub {[.](?:\$\w+|\[.*)$} $name {}] $body]
            }
        }
    }
    return $found
}

# Parts of texts between names and values, long enough to know a text by.
proc ::errorPage::Pieces texts {
    return [concat {*}[lmap text $texts {
        lmap piece [split [string map {... \1} [lindex $text 1]] \1] {
            set piece [string trim $piece { :;,}]
            if {[string length $piece] < 12} continue
            set piece
        }
    }]]
}

# The first test that has the code, or else one of these pieces of its texts.
proc ::errorPage::Reaching {code pieces tests} {
    foreach pair $tests {
        lassign $pair name body
        if {[string first $code $body] >= 0} {
            return $name
        }
    }
    foreach piece $pieces {
        foreach pair $tests {
            lassign $pair name body
            if {[string first $piece $body] >= 0} {
                return $name
            }
        }
    }
}
