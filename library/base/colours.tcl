# colours.tcl -- the colours of all that SORMA draws: Tk's theme, charts, and pages; each has a value on a light ground and one on a dark one.
#
# Text keeps a contrast of at least 4.5:1 to each ground that it stands on, edges of controls 3:1 (WCAG 2.2, 1.4.3 and 1.4.11). Tests judge it.

package provide sorma::colours 1.0

namespace eval ::sorma::colours {
    # token: light, dark
    variable Tokens {
        ground  {#f3f5f8 #12161c}
        surface {#ffffff #1b212a}
        hover   {#eef2f8 #252d39}
        line    {#d9dee6 #2f3845}
        edge    {#7d8898 #77849a}
        text    {#1a2230 #e7ebf1}
        quiet   {#566172 #a7b1c0}
        off     {#8a93a3 #6f7b8c}
        accent  {#1d63d8 #6aa6ff}
        press   {#154ba6 #9bc3ff}
        on      {#ffffff #0d1420}
        tint    {#e3edfd #223553}
        ok      {#13764a #5ccb98}
        warn    {#8a5a00 #e3b04b}
        error   {#b3261e #ff8a80}
        stale   {#5f6b7a #98a3b3}
        moves   {#7a3fc4 #c29bff}
        mine    {#1d5cc8 #7fb2ff}
    }
    # Ground is that of a window, surface that of a card and a field. A line stands between things, an edge around a control. Units, ages and
    # help are quiet. On is text on the accent. Tint shows a selection, or a button that is pressed. Moves is a change by somebody else.
    # state of a value: mark, token. Neither is alone, for those who do not see the one or the other.
    variable States {
        asking  {… stale}
        live    {{} {}}
        mine    {● mine}
        theirs  {◆ moves}
        sending {… mine}
        stale   {? warn}
        refused {✕ error}
        gone    {∅ stale}
        locked  {⊘ stale}
        alarm   {■ error}
        warn    {▲ warn}
        good    {✓ ok}
    }
    # of lines beside each other, from the first on; in a chart, the second and later also differ by dash
    variable Series {
        {#0072b2 #56b4e9} {#b84a08 #f0a04b} {#00795a #4fd1a5} {#a3437f #e58fc0} {#8a6500 #e8d24a} {#4b4fc4 #a6a8ff}
    }
}

# ::sorma::colours::of light|dark -- a dictionary: token -> #rrggbb.
proc ::sorma::colours::of shade {
    variable Tokens
    set index [Index $shade]
    return [dict map {token pair} $Tokens {lindex $pair $index}]
}
# ::sorma::colours::one TOKEN light|dark -- one of them.
proc ::sorma::colours::one {token shade} {
    variable Tokens
    return [lindex [dict get $Tokens $token] [Index $shade]]
}
proc ::sorma::colours::Index shade {
    set index [lsearch -exact {light dark} $shade]
    if {$index < 0} {
        return -code error -errorcode {SORMA REQUEST SYNTAX} "bad shade \"$shade\": must be light or dark"
    }
    return $index
}

# ::sorma::colours::states -- a dictionary: state of a value -> {mark token}; an empty token: the colour of other text.
proc ::sorma::colours::states {} {
    variable States
    return $States
}

# ::sorma::colours::series light|dark -- colours of lines beside each other.
proc ::sorma::colours::series shade {
    variable Series
    set index [Index $shade]
    return [lmap pair $Series {lindex $pair $index}]
}

# ::sorma::colours::css -- all of them as variables of CSS, by the shade that a reader wants: --ground, --text ...; --series1 ...
proc ::sorma::colours::css {} {
    lassign [lmap shade {light dark} {
        set n 0
        string cat ":root { color-scheme: $shade; " \
            [join [concat [lmap {token colour} [of $shade] {string cat -- $token ": " $colour}] [lmap colour [series $shade] {string cat --series [incr n] ": " $colour}]] {; }] " }"
    }] light dark
    return "$light\n@media (prefers-color-scheme: dark) { $dark }\n"
}

# ::sorma::colours::mix A B PART -- between two colours: A where PART is 0, B where it is 1.
proc ::sorma::colours::mix {a b part} {
    scan $a #%2x%2x%2x r g bl
    scan $b #%2x%2x%2x R G B
    return [format #%02x%02x%02x [expr {round($r + ($R - $r) * $part)}] [expr {round($g + ($G - $g) * $part)}] [expr {round($bl + ($B - $bl) * $part)}]]
}

# ::sorma::colours::contrast A B -- 1 to 21, as WCAG 2.2 computes it from relative luminance.
proc ::sorma::colours::contrast {a b} {
    lassign [lsort -real [list [Luminance $a] [Luminance $b]]] low high
    return [expr {($high + 0.05) / ($low + 0.05)}]
}
proc ::sorma::colours::Luminance colour {
    scan $colour #%2x%2x%2x r g b
    lassign [lmap part [list $r $g $b] {
        set part [expr {$part / 255.0}]
        expr {$part <= 0.04045 ? $part / 12.92 : (($part + 0.055) / 1.055) ** 2.4}
    }] r g b
    return [expr {0.2126 * $r + 0.7152 * $g + 0.0722 * $b}]
}
