# browserTabs.tcl -- sorma::browserTabs: a notebook of many tabs in a narrow window. No name is cut: a menu at the row's end has those without room.

package require Tk
package require sorma::style
package provide sorma::browserTabs 1.0

namespace eval ::sorma::browserTabs {}

# ::sorma::browserTabs::manage NOTEBOOK -- from now on. The tab in front is always among those that are shown. When one is taken from the menu,
#       others make room.
proc ::sorma::browserTabs::manage book {
    ttk::menubutton $book.more -style Toolbutton -text \u2026 -menu $book.more.menu -takefocus 1
    menu $book.more.menu -tearoff 0
    bind $book <Configure> +[list ::sorma::browserTabs::Fit $book]
    bind $book <<NotebookTabChanged>> +[list ::sorma::browserTabs::Fit $book]
    bind $book <<ThemeChanged>> +[list ::sorma::browserTabs::Fit $book]
}
# The width of this tab in the row. The theme says how much space is around a name.
proc ::sorma::browserTabs::Width {book tab} {
    lassign [ttk::style lookup TNotebook.Tab -padding] left
    set font [ttk::style lookup TNotebook.Tab -font {} TkDefaultFont]
    return [expr {[font measure $font [$book tab $tab -text]] + 2 * [winfo pixels $book $left] + [::sorma::style pixels 2]}]
}
proc ::sorma::browserTabs::Fit book {
    set front [$book select]
    if {$front eq {} || [winfo width $book] <= 1} return
    set all [$book tabs]
    set room [winfo width $book]
    set needed [tcl::mathop::+ {*}[lmap tab $all {Width $book $tab}]]
    if {$needed > $room} {
        incr room -[winfo reqwidth $book.more]
        incr room -[Width $book $front]
    }
    set hidden {}
    foreach tab $all {
        if {$needed > $room && $tab ne $front && ($hidden ne {} || [incr room -[Width $book $tab]] < 0)} {
            lappend hidden $tab
        }
    }
    foreach tab $all {
        set state [expr {$tab in $hidden ? "hidden" : "normal"}]
        if {[$book tab $tab -state] ne $state} {
            $book tab $tab -state $state
        }
    }
    $book.more.menu delete 0 end
    foreach tab $hidden {
        $book.more.menu add command -label [$book tab $tab -text] -command [list ::sorma::browserTabs::Choose $book $tab]
    }
    if {$hidden eq {}} {
        place forget $book.more
    } else {
        place $book.more -relx 1 -anchor ne
    }
}
proc ::sorma::browserTabs::Choose {book tab} {
    $book select $tab
    focus $book
}
