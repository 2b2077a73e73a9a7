# entries.tcl -- the one reader of files that people write, one entry a line: forms, arrangements, layouts, launch files. It knows no bus.
#
#     # a comment
#     daemon arm -after eye -port 7014 \
#         -host 0.0.0.0                                the entry of the line before goes on
#     foo.cell@robot -where -text "Where to serve"     # one behind an entry
#
# Words are quoted as in requests: '...' and {...} are taken as they stand, "..." knows \" \\ \n \r \t. A word that begins with # begins a
# comment. Nothing is evaluated.

package provide sorma::entries 1.0

namespace eval ::sorma::entries {}

# ::sorma::entries::each VARS TEXT WHERE SPLIT BODY ?wrongVar? --
#       Run a script for each entry of a text.
# Arguments:
#       vars    names of two variables: place ("WHERE:LINE") and words, which are there for BODY
#       where   name of the file
#       split   makes words of a line: sorma::SplitWords, or what calls it
#       body    fails, by error or throw, with what was expected
#       wrongVar gets a list of errors, "PLACE: MESSAGE" each. Without it the first one ends all
proc ::sorma::entries::each {vars text where split body {wrongVar {}}} {
    lassign $vars placeVar wordsVar
    upvar 1 $placeVar place $wordsVar words {*}[if {$wrongVar ne {}} {list $wrongVar wrong}]
    set wrong {}
    set number 0
    set entry {}
    foreach line [split $text\n \n] {
        incr number
        if {$entry eq {}} {
            set place $where:$number
        }
        set line [string trimright $line \r]
        # It goes on, unless the backslash is one of a pair.
        if {[regexp {(?:^|[^\\])(?:\\\\)*\\$} $line]} {
            append entry [string range $line 0 end-1] { }
            continue
        }
        append entry $line
        try {
            set words [{*}$split $entry]
            if {$words ne {}} {
                uplevel 1 $body
            }
        } on error {message how} {
            if {$wrongVar eq {}} {
                return -code error -errorcode [dict get $how -errorcode] "$place: $message"
            }
            lappend wrong "$place: $message"
        } finally {
            set entry {}
        }
    }
    return
}

# ::sorma::entries::line WORDS -- an entry that is read as these words.
proc ::sorma::entries::line words {
    return [join [lmap word $words {
        if {[regexp {^[\w./:=@%+,*-]+$} $word]} {
            set word
        } elseif {![regexp {[\x00-\x1f{}\\]} $word]} {
            string cat \{ $word \}
        } else {
            string cat \" [string map {\\ \\\\ \" \\\" \n \\n \r \\r \t \\t} $word] \"
        }
    }]]
}
