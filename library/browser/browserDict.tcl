# browserDict.tcl -- sorma::browserDict: the dictionary of a daemon: its entries, and one of them to be edited.
#
# Typed text stays until it is set or reverted, also when another daemon is chosen, or when the daemon dies. Before an
# entry is set it is read once more: if another user has changed it, the browser says so, and does not overwrite it. The daemon itself
# checks the words of an entry, as when it makes such an object (sorm DBX -check), without making one.

package require Tk
package require snit
package require sorma::complete
package require sorma::parts
package require sorma::style
package require sorma::table
package require sorma::text
package require sorma::timer
package require sorma::world
package provide sorma::browserDict 1.0

# ::sorma::browserDict .w --
# Methods:
#       about KEY                   the daemon
#       choose WORD                 the entry to be edited
#       type TEXT                   its words
#       set, remove, revert         as the buttons
#       write                       to the file
#       text                        all entries, a line each
#       said                        the line below
#       concerns                    which objects the entry is for
snit::widget ::sorma::browserDict {
    hulltype ttk::frame
    component tree
    component editor
    typevariable Most 1000      ;# entries that are read
    variable key {}             ;# of the daemon
    variable entries {}         ;# dict: WORD -> its words, as they are there
    variable drafts {}          ;# dict: KEY -> dict: WORD -> {what is typed, what was there when it began}
    variable word {}            ;# the entry that is edited
    variable only {}            ;# a part of those that are shown
    variable said {}
    variable forced {}          ;# {KEY WORD TEXT}: of this it was said that it looks wrong
    variable removing {}        ;# {KEY WORD}: of this it was asked whether it is to be removed
    variable firm 0             ;# what is said is an answer to the user: it stays until something else is typed or chosen
    variable seen {}            ;# {WORD TEXT} as it was typed last
    variable faults {}          ;# list of {place why} of the words that are typed, as the daemon has answered last
    variable tokens {}          ;# dict: KEY -> token of its dictionary.changed
    variable watch {}

    constructor {} {
        set pad [::sorma::style pixels 8]
        set edge [::sorma::style pixels 16]
        ttk::frame $win.bar
        ttk::label $win.bar.label -text [::msgcat::mc "Entries with"]
        ttk::entry $win.bar.only -textvariable [myvar only]
        ttk::button $win.bar.write -text [::msgcat::mc "Write to file"] -underline 0 -command [mymethod write]
        ttk::button $win.bar.reload -text [::msgcat::mc "Read files again"] -underline 5 -command [mymethod Do -reload]
        pack $win.bar.label -side left -padx [list 0 $pad]
        pack $win.bar.reload $win.bar.write -side right -padx [list $pad 0]
        pack $win.bar.only -side left -fill x -expand 1         ;# the last: it gives way in a small window
        ttk::frame $win.list
        install tree using ttk::treeview $win.list.tree -style [::sorma::style own Treeview] -columns words -height 8 -selectmode browse \
            -yscrollcommand [list $win.list.scroll set]
        $tree heading #0 -text [::msgcat::mc Entry] -anchor w
        $tree heading words -text [::msgcat::mc "Stands for"] -anchor w
        $tree column #0 -width [::sorma::style pixels 160] -stretch 0
        $tree column words -width [::sorma::style pixels 340]
        $tree tag configure draft -foreground [::sorma::style colour warn]
        ttk::scrollbar $win.list.scroll -style [::sorma::style own Vertical.TScrollbar] -command [list $tree yview]
        pack $win.list.scroll -side right -fill y
        pack $tree -side left -fill both -expand 1
        ttk::frame $win.edit
        ttk::label $win.edit.wordLabel -text [::msgcat::mc "Entry"] -underline 0
        ttk::entry $win.edit.word -font [::sorma::style font fixed]
        ttk::label $win.edit.wordsLabel -text [::msgcat::mc "Stands for"]
        set editor [::sorma::style text $win.edit.words {wrong refused} -height 3 -width 40 -wrap word -undo 1 -highlightthickness 1 -padx $pad \
            -pady [::sorma::style pixels 4]]
        ttk::label $win.edit.concernsLabel -text [::msgcat::mc "Concerns"]
        ttk::label $win.edit.concerns -justify left
        ttk::label $win.edit.said -justify left
        ttk::frame $win.edit.do
        foreach {name title key method} {set Set Ctrl-Return set remove Remove Ctrl-Delete AskRemove revert Revert Escape revert} {
            ttk::button $win.edit.do.$name -text "$title ($key)" -command [mymethod $method]
            pack $win.edit.do.$name -side left -padx [list 0 $pad]
        }
        foreach {label part} {wordLabel word wordsLabel words concernsLabel concerns} {
            grid $win.edit.$label $win.edit.$part -sticky [expr {$part eq "words" ? "nsew" : "ew"}] -padx [list 0 $pad] -pady [list 0 $pad]
        }
        grid configure $win.edit.wordsLabel -sticky nw -pady [list [::sorma::style pixels 4] 0]
        foreach part {word words concerns} {
            grid configure $win.edit.$part -padx 0
        }
        grid x $win.edit.said -sticky ew
        grid x $win.edit.do -sticky w -pady [list $pad 0]
        grid columnconfigure $win.edit 1 -weight 1
        pack $win.bar -side top -fill x -padx $edge -pady [list $edge $pad]
        pack $win.edit -side bottom -fill x -padx $edge -pady $edge
        pack $win.list -side top -fill both -expand 1 -padx [list $edge 0]
        $editor tag configure wrong -underline 1
        ::sorma::parts::byKeys $tree
        bind $tree <<TreeviewSelect>> [mymethod Selected]
        bind $win.edit.word <KeyRelease> [mymethod Named]
        bind $editor <KeyRelease> [mymethod Typed]
        bind $editor <Control-space> "[mymethod Complete]; break"
        bind $editor <Tab> {tk::TabToWindow [tk_focusNext %W]; break}
        bind $editor <Shift-Tab> {tk::TabToWindow [tk_focusPrev %W]; break}
        foreach window [list $win.edit.word $editor] {
            bind $window <Control-Return> "[mymethod set]; break"
            bind $window <Control-Delete> "[mymethod AskRemove]; break"
            bind $window <Escape> [mymethod revert]
        }
        bind $win.edit <Configure> [mymethod Sized %W %w]
        trace add variable [myvar only] write [mymethod Fill]
        bind $win <Destroy> +[mymethod Ended %W]
        set watch [::sorma::world watch * -events {daemon.here daemon.changed daemon.gone} -command [mymethod Daemon]]
    }
    method Ended window {
        if {$window eq $win} {
            ::sorma::timer::cancel $win.*
            foreach token [list $watch {*}[dict values $tokens]] {
                ::sorma::world unwatch $token
            }
        }
    }
    method Sized {window width} {
        if {$window eq "$win.edit"} {
            set width [expr {max(100, $width - [winfo width $win.edit.wordsLabel] - [::sorma::style pixels 24])}]
            foreach name {concerns said} {
                $win.edit.$name configure -wraplength $width
            }
        }
    }

    # ---- what programs say ----

    method about daemon {
        if {$daemon eq $key} return
        set key $daemon
        set entries {}
        $self Show {}
        $self Say {}
        if {$key ne {} && ![dict exists $tokens $key]} {
            dict set tokens $key [::sorma::world listen sorm@$key -event dictionary.changed -command [mymethod Changed $key]]
        }
        $self Fill
        $self Read
        if {[dict exists $drafts $key]} {
            $self Say "[::sorma::style mark warn] not set yet: [join [dict keys [dict get $drafts $key]] {, }]"
        }
    }
    method choose name {
        $self Show $name
        $self Fill
    }
    method type text {
        $editor replace 1.0 end $text
        $editor mark set insert end-1c
        $self Typed
    }
    method text {} {
        return [join [lmap name [lsort [dict keys $entries]] {string trimright "[$self Quoted $name] [dict get $entries $name]"}] \n]
    }
    method said {} {
        return $said
    }
    method concerns {} {
        return [$win.edit.concerns cget -text]
    }
    method write {} {
        $self Do -save
    }
    method revert {} {
        $self Undraft $key $word
        set removing {}
        $self Show $word
        $self Say {}
        $self Fill
    }

    # ---- what is there ----

    method Ask {request prefix} {
        ::sorma::world ask $key [list dict CTRL {*}$request] -command [list ::sorma::parts::answer [mymethod Answered $key $prefix]]
    }
    # An answer of the daemon that is shown, or of one that was: then nobody wants it.
    method Answered {daemon prefix status value} {
        if {$daemon ne $key} return
        if {$status eq "error"} {
            $self Say "[::sorma::style mark refused] [lindex $value 0]"
            return
        }
        {*}$prefix [if {[dict exists $value text]} {dict get $value text}]
    }
    method Do action {
        $self Ask [list $action] [mymethod Done $action]
    }
    method Done {action text} {
        $self Say [dict get {-save "written to the file" -reload "its files have been read again"} $action]
        $self Read
    }
    method Read {} {
        if {$key ne {} && [dict exists [::sorma::world get $key] state] && [dict get [::sorma::world get $key] state] in {alive busy}} {
            $self Ask -list [mymethod Listed]
        }
    }
    method Listed text {
        if {![string is list $text]} {
            $self Say "[::sorma::style mark refused] its answer makes no sense: it is no list of entries"
            return
        }
        set entries [dict filter $entries script {name line} {expr {$name in $text}}]
        foreach name [lrange $text 0 $Most-1] {
            $self Ask [list -get $name] [mymethod Got $name]
        }
        if {[llength $text] > $Most} {
            $self Say "[llength $text] entries; the first $Most are shown"
        }
        ::sorma::timer::once $win.fill 20 {*}[mymethod Fill]
    }
    method Got {name text} {
        dict set entries $name $text
        if {$name eq $word} {
            if {[$self Draft] eq {}} {
                $self Show $name
            } else {
                $self Compare $text
            }
        }
        ::sorma::timer::once $win.fill 20 {*}[mymethod Fill]
    }
    # The entry has changed since the draft was begun: say so, and go on from there.
    method Compare text {
        lassign [$self Draft] typed base
        if {$text eq $base} {
            return 1
        }
        dict set drafts $key $word [list $typed $text]
        $self Answer "[::sorma::style mark warn] somebody else has changed it meanwhile. There it is now: [if {$text eq {}} {string cat nothing} else {set text}].\
            Yours is not set; set it all the same, or revert."
        return 0
    }
    method Changed {daemon event} {
        if {$daemon ne $key} return
        if {[dict get $event event] eq "dictionary.changed"} {
            ::sorma::timer::once $win.read 20 {*}[mymethod Read]
            if {$word ne {} && [$self Draft] ne {} && $word in [dict get $event text]} {
                $self Check ignore
            }
        } elseif {[dict get $event event] eq "sorma.refused"} {
            $self Say "[::sorma::style mark refused] [dict get $event text]"
        }
    }
    # A daemon that comes again may have another dictionary; what is typed is still here.
    method Daemon {event daemon dict} {
        if {$daemon ne $key} return
        if {$event eq "daemon.gone" || [dict get $dict state] ni {alive busy}} {
            $self Say "[::sorma::style mark stale] the daemon is away[if {[dict exists $drafts $key]} {string cat {; what is typed is kept}}]"
        } else {
            $self Say [if {[dict exists $drafts $key]} {string cat "[::sorma::style mark warn] not set yet: [join [dict keys [dict get $drafts $key]] {, }]"}]
            ::sorma::timer::once $win.read 20 {*}[mymethod Read]
        }
    }

    # ---- editing ----

    method Draft {} {
        return [if {[dict exists $drafts $key $word]} {dict get $drafts $key $word}]
    }
    method Undraft {daemon name} {
        if {[dict exists $drafts $daemon $name]} {
            dict unset drafts $daemon $name
            if {[dict size [dict get $drafts $daemon]] == 0} {
                dict unset drafts $daemon
            }
        }
    }
    method There name {
        return [if {[dict exists $entries $name]} {dict get $entries $name}]
    }
    method Show name {
        set word $name
        $win.edit.word delete 0 end
        $win.edit.word insert 0 $name
        set draft [$self Draft]
        $editor replace 1.0 end [if {$draft ne {}} {lindex $draft 0} else {$self There $name}]
        $editor mark set insert end-1c
        set seen [list $word [$editor get 1.0 end-1c]]
        $self Concern
        $self CheckSoon
    }
    method Named {} {
        set name [$win.edit.word get]
        if {$name ne $word} {
            # The text below goes with the new name.
            set typed [$editor get 1.0 end-1c]
            set word $name
            $self Concern
            if {$typed ne [$self There $name]} {
                $self Typed
            }
        }
    }
    method Typed {} {
        set typed [$editor get 1.0 end-1c]
        if {$seen eq [list $word $typed]} {
            return [$self Hint]         ;# a key that changes nothing
        }
        set seen [list $word $typed]
        set firm 0
        set removing {}
        if {$word ne {} && $key ne {}} {
            set draft [$self Draft]
            set base [if {$draft ne {}} {lindex $draft 1} else {$self There $word}]
            if {$typed eq $base} {
                $self Undraft $key $word
            } else {
                dict set drafts $key $word [list $typed $base]
            }
            ::sorma::timer::once $win.fill 20 {*}[mymethod Fill]
        }
        $self Hint
        $self CheckSoon
    }
    # The line up to the cursor, as scott would read it.
    method Completion {} {
        set at [if {$key eq "self"} {string cat sorma::so::dict} else {string cat sorma::so::dict@$key}]
        set line "$at CTRL -add [$self Quoted $word] [string map {\n { }} [$editor get 1.0 insert]]"
        return [list $line [::sorma::complete $line [string length $line]]]
    }
    method Hint {} {
        if {$word ne {} && !$firm} {
            $self Say [dict get [lindex [$self Completion] 1] hint]
        }
    }
    method Complete {} {
        lassign [$self Completion] line found
        set partial [string range $line [dict get $found from] end]
        set list [dict get $found words]
        set common [lindex $list 0]
        foreach item $list {
            while {![string match [::sorma::text::escape $common]* $item]} {
                set common [string range $common 0 end-1]
            }
        }
        if {[string length $common] >= [string length $partial] && $list ne {}} {
            $editor delete "insert - [string length $partial] chars" insert
            $editor insert insert $common[if {[llength $list] == 1 && ![string match *\[/.@\] $common]} {string cat { }}]
            $self Typed
        }
        $self Say [if {[llength $list] == 1} {dict get $found hint} else {::sorma::text::cut [join $list] 400}]
    }
    method Quoted text {
        return [expr {[regexp {^[\w.@:/-]+$} $text] ? $text : [list $text]}]
    }

    # The error in the words of an entry, as far as it is known here; empty: none.
    method Wrong {name text} {
        if {[catch {::sorma::SplitWords $text} list]} {
            return $list
        }
        if {$name eq {} || [regexp {\s} $name]} {
            return "an entry needs a name, which has no blanks"
        }
        if {[string index $name 0] eq "@"} {
            return [if {[llength $list] == 0} {string cat "an address says where $name is: host:port, the path of a socket, another name, or self"}]
        }
    }
    # Is it a recipe for objects of that daemon, whose words it can check?
    method Recipe name {
        return [regexp {^[a-z]\w*(\.[^@\s]+)?$} $name]
    }

    # ---- the daemon's own check ----

    method CheckSoon {} {
        ::sorma::timer::cancel $win.check
        $self Mark {}
        if {[$self Draft] ne {}} {
            ::sorma::timer::once $win.check 300 {*}[mymethod CheckWords]
        }
    }
    method CheckWords {} {
        set text [$editor get 1.0 end-1c]
        if {$key ne {} && [$self Recipe $word] && ![catch {::sorma::SplitWords $text} list]} {
            $self AskCheck $word $list [mymethod WordsChecked $key $word $text]
        }
    }
    # Ask the daemon of this dictionary about the words of an entry; the prefix gets status and value.
    method AskCheck {name words prefix} {
        ::sorma::world ask $key [list sorm DBX -check $name {*}$words] -command [list ::sorma::parts::answer $prefix]
    }
    method WordsChecked {daemon name text status value} {
        if {[list $daemon $name $text] ne [list $key $word [$editor get 1.0 end-1c]]} return
        $self Mark [$self Faults $status $value]
        if {[llength $faults] > 0 && !$firm} {
            $self Say "[::sorma::style mark refused] [$self FaultsText]"
        }
    }
    # What it has answered. A word that is no name of a class is for -SUBST, and may stand for anything.
    method Faults {status value} {
        if {$status ne "ok" || ![dict exists $value text] || ![string is list [dict get $value text]]} return
        return [lmap fault [lrange [dict get $value text] 0 99] {
            if {[catch {llength $fault} n] || $n != 2 || ![string is integer -strict [lindex $fault 0]]} continue
            set fault
        }]
    }
    method FaultsText {} {
        return [join [lmap fault $faults {lindex $fault 1}] "; "]
    }
    # The words that are wrong, underlined.
    method Mark list {
        set faults $list
        $editor tag remove wrong 1.0 end
        if {[llength $list] == 0 || [catch {::sorma::SplitWords [$editor get 1.0 end-1c]} words]} return
        set from 1.0
        set place 0
        foreach item $words {
            set at [if {$item ne {}} {$editor search -exact -- $item $from end}]
            if {$at ne {}} {
                set from [$editor index "$at + [string length $item] chars"]
                if {[lsearch -exact -index 0 $list $place] >= 0} {
                    $editor tag add wrong $at $from
                }
            }
            incr place
        }
    }
    method set {} {
        if {$key eq {}} return
        set name [$win.edit.word get]
        set text [string trim [$editor get 1.0 end-1c]]
        set wrong [$self Wrong $name $text]
        if {$wrong ne {}} {
            $self Answer "[::sorma::style mark refused] not set: $wrong"
            return
        }
        set word $name
        if {[$self Draft] eq {}} {
            dict set drafts $key $word [list $text [$self There $word]]
        }
        $self Check [mymethod Verify $name $text]
    }
    method Verify {name text} {
        if {[$self Recipe $name] && $forced ne [list $key $name $text]} {
            $self AskCheck $name [::sorma::SplitWords $text] [mymethod Verified $key $name $text]
        } else {
            $self Set $name $text
        }
    }
    method Verified {daemon name text status value} {
        if {$daemon ne $key || $name ne $word} return
        $self Mark [$self Faults $status $value]
        if {[llength $faults] > 0} {
            set forced [list $key $name $text]
            $self Answer "[::sorma::style mark refused] not set: [$self FaultsText]. Once more sets it all the same."
        } else {
            $self Set $name $text
        }
    }
    # Read the entry once more; then PREFIX, when it is as it was when the draft began.
    method Check prefix {
        ::sorma::world ask $key [list dict CTRL -get $word] -command [list ::sorma::parts::answer [mymethod Checked $key $word $prefix]]
    }
    method Checked {daemon name prefix status value} {
        if {$daemon ne $key || $name ne $word || [$self Draft] eq {}} return
        if {$status eq "error" && [lrange [lindex $value 1] 0 2] ne {SORMA DICT UNKNOWN}} {
            $self Answer "[::sorma::style mark refused] not set: [lindex $value 0]"
            return
        }
        set text [if {$status eq "ok" && [dict exists $value text]} {dict get $value text}]
        if {[$self Compare $text] && $prefix ne "ignore"} {
            {*}$prefix
        }
    }
    method Set {name text} {
        set list [::sorma::SplitWords $text]
        if {[llength $list] == 1} {
            set list [list $text]           ;# one word that holds blanks would be split once more
        }
        $self Ask [list -add $name {*}$list] [mymethod Was "$name is set; Write to file keeps it" $name]
    }
    # The first time it asks, the second time it removes.
    method AskRemove {} {
        if {$removing eq [list $key $word]} {
            return [$self remove]
        }
        if {$word in [dict keys $entries]} {
            set removing [list $key $word]
            $self Answer "[::sorma::style mark warn] remove $word? Once more removes it; Escape keeps it"
        }
    }
    method remove {} {
        set removing {}
        if {$word in [dict keys $entries]} {
            if {[$self Draft] eq {}} {
                dict set drafts $key $word [list {} [$self There $word]]
            }
            $self Check [mymethod Remove $word]
        }
    }
    method Remove name {
        $self Ask [list -remove $name] [mymethod Was "$name is removed; Write to file takes it out there" $name]
    }
    method Was {text name value} {
        $self Undraft $key $name
        set forced {}
        $self Answer $text
        $self Read
    }

    # ---- what is shown ----

    # Which objects an entry is about.
    method Concern {} {
        set objects [lmap object [if {$key ne {}} {::sorma::world objects $key}] {dict get $object name}]
        set entry [::sorma::text::escape $word]
        set plain [lindex [split $word @] 0]
        if {$word eq {}} {
            set text {}
        } elseif {[string index $word 0] eq "@"} {
            set text "all names that end in $word"
        } elseif {[string first . $plain] < 0 && $plain eq [string toupper $plain]} {
            set text "all objects that are called $plain or $plain.flavor: it says where they are"
        } elseif {[string first @ $word] >= 0} {
            set text "$word, when it is used from here"
        } else {
            set text "$word[expr {$plain in $objects ? ", which is there already: it has its words from its birth on, so make it anew" : ", when it is made"}]"
        }
        set users [lsort [dict keys [dict filter $entries script {name line} {
            expr {[string match "*-SUBST*" $line] && [regexp -- "-SUBST\\s+\[\"'\{\]?[regsub -all {\W} $word {\\&}]\[\"'\}\]?(\\s|$)" $line]}
        }]]]
        if {$word ne {} && [llength $users] > 0} {
            append text "; by -SUBST also [join $users {, }]"
        }
        $win.edit.concerns configure -text [::sorma::text::cut [::sorma::text::clean $text] 600]
    }
    # Say what became of what the user has done.
    method Answer text {
        $self Say $text
        set firm 1
    }
    method Say text {
        set firm 0
        set said [::sorma::text::cut [::sorma::text::clean $text] 600]
        $win.edit.said configure -text $said
    }
    method Selected {} {
        set item [lindex [$tree selection] 0]
        if {$item ne {} && [set name [lindex [$tree item $item -tags] end]] ne [list entry $word]} {
            $self Show [lindex $name 1]
            $self Say {}
        }
    }
    method Fill args {
        if {![winfo exists $win]} return
        set typed [if {[dict exists $drafts $key]} {dict get $drafts $key}]
        $tree delete [$tree children {}]
        foreach name [lsort [dict keys [dict merge $entries $typed]]] {
            if {![string match -nocase *[::sorma::text::escape $only]* "$name [$self There $name]"]} continue
            set draft [dict exists $typed $name]
            set text [if {$draft} {lindex [dict get $typed $name] 0} else {$self There $name}]
            set item [$tree insert {} end -text "[if {$draft} {string cat "\u270e "}][::sorma::text::cut [::sorma::text::clean $name] 100]" \
                -values [list [::sorma::text::cut [::sorma::text::clean [string map {\n { }} $text]] 300]] \
                -tags [list {*}[if {$draft} {list draft}] [list entry $name]]]
            if {$name eq $word} {
                $tree selection set [list $item]
                $tree focus $item
            }
        }
        $self Concern
    }
}
