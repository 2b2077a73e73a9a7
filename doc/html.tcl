# html.tcl FOLDER MANUAL SOURCE ?PICTURES? -- the manual and the tutorials as web pages, with contents and index.
#
# FOLDER is made anew. MANUAL holds the pages as doc/pages.tcl has made them; SOURCE is the folder with README.md and doc. PICTURES holds
# pictures of widgets, NAME.png, as doc/pictures.tcl has made them. Each stands below the command sorma::NAME, those of whole windows on
# the pages about them. NAME-dark.png is shown instead to a reader who has chosen dark. Drawings for pages are there, too, NAME.svg.
# Needs tcllib's doctools, and cmark-gfm for Markdown; graphviz for its graphs, which stay text without. Every link between the pages leads somewhere: tests/html.test follows them.

package require Tcl 8.6-
package require doctools

namespace eval html {
    # Behind the colours of library/base/colours.tcl.
    variable Style {
body { max-width: 46rem; margin: 0 auto; padding: 0 1rem 4rem; font: 16px/1.6 Inter, system-ui, sans-serif; color: var(--text); background: var(--ground) }
h1, h2, h3 { line-height: 1.25; margin: 2em 0 .5em } h1 { font-size: 1.7rem; margin-top: 1em } h2 { font-size: 1.25rem } h3 { font-size: 1.05rem }
nav { position: sticky; top: 0; z-index: 1; display: flex; gap: 1rem; align-items: baseline; padding: .6rem 0; background: var(--ground); border-bottom: 1px solid var(--line); font-size: 14px }
nav input { flex: 1; padding: .3rem .6rem; font: inherit; color: var(--text); background: var(--surface); border: 1px solid var(--edge); border-radius: 5px }
nav ul { position: absolute; top: 100%; right: 0; left: 0; max-height: 70vh; overflow: auto; margin: 0; padding: .6rem 1rem; list-style: none; background: var(--surface); border: 1px solid var(--edge); border-radius: 0 0 5px 5px }
nav ul[hidden] { display: none } small, .about { color: var(--quiet) }
.code { position: relative } .code button { position: absolute; top: .35rem; right: .35rem; padding: .1rem .5rem; font: 12px sans-serif; color: var(--quiet); background: var(--surface); border: 1px solid var(--edge); border-radius: 4px; opacity: 0; cursor: pointer }
.code:hover button, .code button:focus { opacity: 1 }
pre { background: var(--surface); border: 1px solid var(--line); border-radius: 5px; padding: .7rem .9rem; overflow-x: auto; font-size: 13.5px; line-height: 1.45 }
code, pre, .cmd, .const, .option, .package { font-family: ui-monospace, monospace } code { font-size: .92em }
dt { margin-top: 1em } dd { margin-left: 1.5rem } dd > p:first-child { margin-top: 0 } .doctools_requirements { display: none }
table { border-collapse: collapse; display: block; overflow-x: auto } td, th { padding: .35em 1em .35em 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line) }
a[href] { color: var(--accent); text-decoration-thickness: 1px; text-underline-offset: 2px } a { color: inherit }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 1px }
.opt, td code { white-space: nowrap } img, svg { max-width: 100%; height: auto } dd > p img, .windows img { border: 1px solid var(--line) }
.index { columns: 3 13em } .index p { margin: 0 }
}
    variable Tutorials {first-tcl first-cpp first-panel first-circuit two-hosts moving testing embedding tour}
    variable Demos {lab checkers tracker}
    variable Howtos {add-device instrument driver failed-call record tune-loop move-service boot upgrade}
    variable Formats {wire recording snapshot}
    variable Insights {architecture request benchmark measured break comparison debugging stability}
    variable Pages {}       ;# dict: file.html -> {kind title about}, in the order of the contents
    variable Words {}       ;# list of {word file.html anchor}
}

proc html::read_file name {
    set file [open $name]
    fconfigure $file -encoding utf-8
    try {
        return [read $file]
    } finally {
        close $file
    }
}
proc html::write {name text} {
    set file [open $name w]
    fconfigure $file -encoding utf-8
    puts $file $text
    close $file
}
proc html::Escape text {
    return [string map {& &amp; < &lt; > &gt; \" &quot;} $text]
}

proc html::frame {title body} {
    return "<!DOCTYPE html>
<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><title>[Escape $title]</title><link rel=\"stylesheet\" href=\"style.css\"><script src=\"site.js\"></script></head>
<body>
<nav><a href=\"index.html\">Contents</a> <a href=\"keywords.html\">Index</a> <input id=\"search\" type=\"search\" placeholder=\"search\" aria-label=\"search all pages\" autocomplete=\"off\"><ul id=\"found\" hidden></ul></nav>
$body
</body></html>"
}

# ---- Markdown ----

proc html::markdown text {
    variable Pages
    # It reads everything before it writes.
    set converter [open {| cmark-gfm -e table} r+]
    fconfigure $converter -encoding utf-8
    puts -nonewline $converter $text
    close $converter write
    set html [read $converter]
    close $converter
    # What is a page here is linked as such; other files of the sources are named only.
    set out {}
    while {[regexp -indices {<a href="([^"#:]*?)"[^>]*>(.*?)</a>} $html all target label]} {
        append out [string range $html 0 [lindex $all 0]-1]
        set file [Page [string range $html {*}$target]]
        set label [string range $html {*}$label]
        append out [if {[dict exists $Pages $file]} {string cat "<a href=\"$file\">$label</a>"} else {set label}]
        set html [string range $html [lindex $all 1]+1 end]
    }
    return [drawn [regsub -all {<img src="[^"]*/([^"/]+)"} $out$html {<img src="\1"}]]
}
# The page that is made of a file of the sources, which a link names.
proc html::Page target {
    variable Pages
    set name [file rootname [file tail $target]]
    set folder [file tail [file dirname $target]]
    if {$name eq "README" && $folder ne "."} {
        set name [expr {$folder eq "demos" ? "demos" : "$folder-demo"}]
    }
    return [expr {[dict exists $Pages $name-format.html] ? "$name-format.html" : "$name.html"}]
}
# Graphs, code blocks of the language dot, are drawn where there is graphviz.
proc html::drawn html {
    if {[auto_execok dot] eq {}} {
        return $html
    }
    while {[regexp -indices {<pre><code class="language-dot">(.*?)</code></pre>} $html all code]} {
        set graph [string map {&amp; & &lt; < &gt; > &quot; \"} [string range $html {*}$code]]
        # Lines and text have the colour of the page's text, in both themes.
        set drawing [string map {stroke="black" stroke="currentColor" fill="black" fill="currentColor" fill="white" fill="none" "<text " "<text fill=\"currentColor\" "} \
            [exec dot -Tsvg -Gbgcolor=transparent -Gfontname=sans-serif -Nfontname=sans-serif -Efontname=sans-serif << $graph]]
        set html [string replace $html {*}$all [regsub {^.*?(?=<svg)} $drawing {}]]
    }
    return $html
}

# ---- doctools ----

proc html::manual {name text} {
    variable Pages
    variable Words
    doctools::new page -format html
    try {
        page setparam raw 1
        set links {}
        dict for {file facts} $Pages {
            if {[lindex $facts 0] eq "manual"} {
                foreach word [list [lindex $facts 1] [string map {.html {}} $file]] {
                    lappend links [list sa,$word $file {}]
                }
            }
        }
        page setparam xref $links
        set body [page format $text]
    } finally {
        page destroy
    }
    regsub {^.*?<h1} $body {<h1} body
    regsub {</body>.*$} $body {} body
    regsub {<h1[^>]*>[^<]*</h1>} $body "<h1>[Escape [lindex [dict get $Pages $name.html] 1]]</h1>" body
    # The contents need not name themselves, and nothing is said by a synopsis without a command.
    regsub {<li class="doctools_section"><a href="#toc">[^<]*</a></li>\n} $body {} body
    if {[regsub {<div id="synopsis" class="doctools_section"><h2>[^\n]*</h2>\s*(<div class="doctools_synopsis">\s*<ul class="doctools_requirements">(\s*<li>[^\n]*</li>)*\s*</ul>\s*</div>\s*)?</div>\n} $body {} body]} {
        regsub {<li class="doctools_section"><a href="#synopsis">[^<]*</a></li>\n} $body {} body
    }
    # Commands, and sections of the page, are words of the index; so are its keywords.
    foreach {- anchor head} [regexp -all -inline {<dt><a name="([^"]+?)">(.*?)</a></dt>} $body] {
        # The name of a command, with the word of an ensemble, without arguments.
        set command {}
        regexp {^<b class="cmd">([^<]*)</b>(.*)$} $head - command rest
        set head [string map {&quot; \" &gt; > &lt; < &amp; &} [regsub -all {<[^>]*>} $head {}]]
        if {$command ne {} && ![regexp {^ <b class="const">(EXEC|CTRL|DBX)} $rest]} {
            lappend Words [list [string map {&gt; > &lt; < &amp; &} $command] $name.html $anchor]
        } elseif {[regexp {^(sorma::\S+|[a-z_]\w*(?: EXEC| CTRL| DBX)?(?: -?\w+)?)} $head word]} {
            lappend Words [list $word $name.html $anchor]
        }
    }
    foreach {- anchor heading} [regexp -all -inline {<a name="(section\d+)">([^<]*)</a>} $body] {
        if {$heading ni {Description ERRORS OPTIONS EXAMPLES EXAMPLE {EXIT CODES} OUTPUT COMMANDS}} {
            lappend Words [list [string tolower [string map {&amp; &} $heading]] $name.html $anchor]
        }
    }
    if {[regexp {\[keywords ([^\]]*)\]} $text -> keywords]} {
        foreach word $keywords {
            lappend Words [list $word $name.html {}]
        }
    }
    return $body
}

# ---- pictures ----

# The pictures of pages, behind the paragraph that has these words first.
set html::Shown {
    first-panel.html {
        panel,console {<code>sorma::panel</code>}
    }
    first-circuit.html {
        circuitEditor {At the left are the classes}
    }
    lab-demo.html {
        lab-scene,lab-panel,lab-reading {simulated laboratory with an arm}
    }
    checkers-demo.html {
        checkers-window {The arm of the laboratory plays}
    }
    tracker-demo.html {
        tracker-run,tracker-window {starts the four daemons}
    }
    checkers.html {
        checkers-window {On the left is the board}
    }
    tracker.html {
        tracker-circuit {The pictures come late}
        tracker-window {opens a window instead}
        tracker-run {A recording of such a run}
    }
}

# A page of the manual with the pictures of its commands; others with their own.
proc html::pictured {page body pictures} {
    variable Shown
    set paths [lsort $pictures]
    set names [lmap path $paths {file rootname [file tail $path]}]
    if {[dict exists $Shown $page]} {
        dict for {wanted words} [dict get $Shown $page] {
            set images [join [lmap name [split $wanted ,] {
                set at [lsearch -exact $names $name]
                if {$at < 0} continue
                Image $name [file extension [lindex $paths $at]] [expr {"$name-dark" in $names}]
            }] {}]
            if {$images ne {}} {
                regsub "$words.*?</p>" $body "&<p class=\"windows\">$images</p>" body
            }
        }
        return $body
    }
    foreach name $names {
        if {[regexp -indices [string map [list NAME $name] {<dt><a name="[^"]*"><b class="cmd">(?:<a [^>]*>)?sorma::NAME(?:</a>)?</b>(?:(?!</dt>).)*</dt>\s*<dd>}] $body at]} {
            set end [lindex $at 1]
            set body "[string range $body 0 $end]<p>[Image $name .png [expr {"$name-dark" in $names}]]</p>[string range $body $end+1 end]"
        }
    }
    return $body
}
proc html::Image {name extension dark} {
    set alt [if {[regexp {^(lab|checkers|tracker)-(.*)$} $name - demo what]} {string cat "the [dict get {lab laboratory checkers {game of draughts} tracker tracker} $demo]: $what"} else {string cat sorma::$name}]
    set image "<img src=\"$name$extension\" alt=\"$alt\">"
    return [expr {$dark ? "<picture><source srcset=\"$name-dark$extension\" media=\"(prefers-color-scheme: dark)\">$image</picture>" : $image}]
}

# ---- look and search ----

source -encoding utf-8 [file join [file dirname [file dirname [file normalize [info script]]]] library base colours.tcl]
# For the search: for each heading of a page a line of JavaScript, [title, heading, address, text].
proc html::searched {file title body} {
    set found {}
    set heading $title
    set anchor {}
    set from 0
    # Marks: an expression with branches would take as much as it can.
    set body [string map [list <h2 \1<h2 <h3 \1<h3 "<dt><a name" "\1<dt><a name" </h2> </h2>\2 </h3> </h3>\2 </dt> </dt>\2] $body]
    foreach at [concat [regexp -all -inline -indices "\1\[^\2]*\2" $body] {{-1 -1}}] {
        set end [expr {[lindex $at 0] < 0 ? [string length $body] : [lindex $at 0]}]
        lappend found "\[[join [lmap text [list $title $heading $file$anchor [string tolower [Plain [string range $body $from $end-1]]]] {Quoted $text}] ,]\]"
        set from $end
        set head [string range $body {*}$at]
        set heading [string range [Plain $head] 0 90]
        set anchor [if {[regexp {name="([^"]+)"} $head - name]} {string cat # $name}]
    }
    return $found
}
proc html::Plain body {
    return [string trim [regsub -all {\s+} [string map {&lt; < &gt; > &quot; \" &amp; &} [regsub -all "<\[^>]*>|\[\1\2]" $body { }]] { }]]
}
proc html::Quoted text {
    return \"[string map {\\ \\\\ \" \\\" </ <\\/} $text]\"
}

# ---- all of it ----

proc html::make {folder manual source {pictures {}}} {
    variable Style
    variable Tutorials
    variable Demos
    variable Howtos
    variable Formats
    variable Insights
    variable Pages
    variable Words
    variable Shown
    file delete -force $folder
    file mkdir $folder
    write [file join $folder style.css] [::sorma::colours::css][string trim $Style]
    file copy [file join $source doc site.js] $folder
    set pictures [if {$pictures ne {}} {glob -nocomplain -directory $pictures *.png *.svg}]
    foreach picture $pictures {
        file copy $picture $folder
    }

    # All pages are known before the first one is made, since they link to each other.
    dict set Pages README.html {readme SORMA {what it is, and a tour}}
    dict set Pages demos.html {demo {All demos} {what each of them shows, and how they measure}}
    set sources [dict create README.html [read_file [file join $source README.md]] demos.html [read_file [file join $source demos README.md]]]
    file copy [file join $source doc window.svg] $folder
    foreach {kind names where} [list tutorial $Tutorials doc/tutorials/NAME.md howto $Howtos doc/howto/NAME.md \
            demo $Demos demos/NAME/README.md format $Formats doc/NAME.md insight $Insights doc/NAME.md] {
        foreach name $names {
            set text [read_file [file join $source [string map [list NAME $name] $where]]]
            # A page of the manual may have the name of a format or of a demo.
            set file $name[expr {$kind in {tutorial howto} ? {} : $kind eq "demo" ? "-demo" : "-format"}].html
            regexp -line {^# (.*)$} $text -> title
            dict set Pages $file [list $kind $title {}]
            dict set sources $file $text
        }
    }
    foreach path [lsort [glob -directory $manual *.man]] {
        set name [file rootname [file tail $path]]
        set text [read_file $path]
        regexp {\[manpage_begin (\S+)} $text -> title
        regexp {\[titledesc \{([^\}]*)\}} $text -> about
        dict set Pages $name.html [list manual $title $about]
        dict set sources $name.html $text
    }
    dict for {file facts} $Pages {
        lassign $facts kind title
        set text [dict get $sources $file]
        set body [if {$kind eq "manual"} {manual [file rootname $file] $text} else {markdown $text}]
        if {$file eq "panel.html" || [dict exists $Shown $file]} {
            set body [pictured $file $body $pictures]
        }
        write [file join $folder $file] [frame $title $body]
        lappend places {*}[searched $file $title $body]
    }
    write [file join $folder words.js] "sormaSearch.take(\[\n[join $places ,\n]\n\]);"

    # Four doors, by what a reader wants.
    set contents "<h1>SORMA</h1>\n<p><a href=\"README.html\">What it is, and a tour</a></p>"
    foreach {kind heading about} {
        tutorial Learn {Tutorials, to be typed one after another. Tests type each line of them.}
        howto {Do one thing} {One page for one task. Tests type these lines, too.}
        demo {See it work} {Programs with a simulated robot.}
        manual {Look up} {Commands, programs, classes and errors: the manual.}
        format {} {Formats of the wire and of files.}
        insight Understand {How it works inside, what it costs, and how it is tested.}
    } {
        append contents "[if {$heading ne {}} {string cat "\n<h2>" $heading </h2>}]\n<p class=\"about\">$about</p>\n<table>"
        set number 0
        dict for {file facts} $Pages {
            if {[lindex $facts 0] eq $kind} {
                append contents "\n<tr>[if {$kind eq "tutorial"} {string cat <td> [incr number] </td>}]<td><a href=\"$file\">[Escape [lindex $facts 1]]</a></td><td>[Escape [lindex $facts 2]]</td></tr>"
            }
        }
        append contents "\n</table>"
    }
    write [file join $folder index.html] [frame SORMA $contents]

    set index "<h1>Index</h1>\n<div class=\"index\">"
    set last {}
    set places {}               ;# a word leads to a page once
    foreach entry $Words {
        lassign $entry word file anchor
        if {![dict exists $places [list $word $file]]} {
            dict set places [list $word $file] $anchor
        }
    }
    foreach entry [lsort -dictionary -index 0 [lsort -dictionary -index 1 [dict keys $places]]] {
        lassign $entry word file
        set anchor [dict get $places $entry]
        set label [if {$word eq $last} {string cat "&nbsp;&nbsp;" [Escape [lindex [dict get $Pages $file] 1]]} else {Escape $word}]
        append index "\n<p><a href=\"$file[if {$anchor ne {}} {string cat # $anchor}]\">$label</a></p>"
        set last $word
    }
    write [file join $folder keywords.html] [frame "SORMA: index" "$index\n</div>"]
}

html::make {*}$argv
