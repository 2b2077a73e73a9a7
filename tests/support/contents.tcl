# contents.tcl -- the text of a file, which is UTF-8.

proc contents file {
    set in [open $file]
    fconfigure $in -encoding utf-8
    try {
        return [read $in]
    } finally {
        close $in
    }
}
