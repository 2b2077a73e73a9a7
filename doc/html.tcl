# html.tcl FOLDER MANUAL SOURCE ?PICTURES? -- the manual and the tutorials as web pages, with contents and index.
#
# FOLDER is made anew. MANUAL holds the pages as doc/pages.tcl has made them; SOURCE is the folder with README.md and doc. PICTURES holds those
# of widgets as doc/pictures.tcl has made them, NAME.png: each stands below the command sorma::NAME, those of whole windows on the pages that are about them;
# and drawings for pages, NAME.svg.
# Needs tcllib's doctools, and cmark-gfm for Markdown; graphviz for its graphs, which stay text without. Every link between the pages leads somewhere: tests/html.test follows them.

package require Tcl 8.6-
package require doctools

namespace eval html {
    variable Style {
body { max-width: 58em; margin: 2em auto; padding: 0 1em; font: 16px/1.5 sans-serif; color: #222; background: #fff }
h1, h2, h3 { line-height: 1.2 } h1 { font-size: 1.6em } h2 { font-size: 1.2em; margin-top: 1.6em }
pre { background: #f4f4f2; padding: .6em .8em; overflow-x: auto; font-size: 13px; line-height: 1.4 }
code, pre, .cmd, .const, .option, .package { font-family: monospace }
dt { margin-top: .8em } dd > p:first-child { margin-top: 0 } .doctools_requirements { display: none }
table { border-collapse: collapse } td, th { padding: .2em .8em .2em 0; text-align: left; vertical-align: top }
nav { font-size: 14px; margin-bottom: 1.5em } a[href] { color: #05a } a { color: inherit }
.option, .opt, p code, li code, td code { white-space: nowrap }
dd > p > img, .windows img { max-width: 100%; border: 1px solid #ccc }
.index { columns: 3 14em } .index p { margin: 0 }
}
    variable Tutorials {first-tcl first-cpp first-panel two-hosts moving testing embedding tour}
    variable Demos {lab checkers tracker}
    variable Formats {wire recording snapshot benchmark request debugging}
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
<html lang=\"en\"><head><meta charset=\"utf-8\"><title>[Escape $title]</title><link rel=\"stylesheet\" href=\"style.css\"></head>
<body>
<nav><a href=\"index.html\">Contents</a> &middot; <a href=\"keywords.html\">Index</a></nav>
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
        set html [string replace $html {*}$all [regsub {^.*?(?=<svg)} [exec dot -Tsvg << $graph] {}]]
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
        # Of a command its name, with the word of an ensemble, and not its arguments.
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

# What pictures pages have, behind the paragraph that has these words first.
set html::Shown {
    first-panel.html {
        panel,console {<code>sorma::panel</code>}
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
                Image $name [file extension [lindex $paths $at]]
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
            set body "[string range $body 0 $end]<p>[Image $name]</p>[string range $body $end+1 end]"
        }
    }
    return $body
}
proc html::Image {name {extension .png}} {
    set alt [if {[regexp {^(lab|checkers|tracker)-(.*)$} $name - demo what]} {string cat "the [dict get {lab laboratory checkers {game of draughts} tracker tracker} $demo]: $what"} else {string cat sorma::$name}]
    return "<img src=\"$name$extension\" alt=\"$alt\">"
}

# ---- all of it ----

proc html::make {folder manual source {pictures {}}} {
    variable Style
    variable Tutorials
    variable Demos
    variable Formats
    variable Pages
    variable Words
    variable Shown
    file delete -force $folder
    file mkdir $folder
    write [file join $folder style.css] [string trim $Style]
    set pictures [if {$pictures ne {}} {glob -nocomplain -directory $pictures *.png *.svg}]
    foreach picture $pictures {
        file copy $picture $folder
    }

    # What there is, before the first page is made: pages link to each other.
    dict set Pages README.html {readme SORMA {what it is, and a tour}}
    dict set Pages demos.html {demo {All demos} {what each of them shows, and how they measure}}
    set sources [dict create README.html [read_file [file join $source README.md]] demos.html [read_file [file join $source demos README.md]]]
    file copy [file join $source doc window.svg] $folder
    foreach {kind names where} [list tutorial $Tutorials doc/tutorials/NAME.md demo $Demos demos/NAME/README.md format $Formats doc/NAME.md] {
        foreach name $names {
            set text [read_file [file join $source [string map [list NAME $name] $where]]]
            # A page of the manual may have the name of a format or of a demo.
            set file $name[expr {$kind eq "tutorial" ? {} : "-$kind"}].html
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
    }

    set contents "<h1>SORMA</h1>\n<p><a href=\"README.html\">What it is, and a tour</a></p>"
    foreach {kind heading} {tutorial Tutorials demo Demos manual Manual format {Formats, figures, and how it works inside}} {
        append contents "\n<h2>$heading</h2>\n<table>"
        dict for {file facts} $Pages {
            if {[lindex $facts 0] eq $kind} {
                append contents "\n<tr><td><a href=\"$file\">[Escape [lindex $facts 1]]</a></td><td>[Escape [lindex $facts 2]]</td></tr>"
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
