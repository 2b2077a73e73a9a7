# packages.tcl -- which files of this folder are packages: those who need one another require them.

apply {folder {
    foreach {file packages} {
        tokens checkers::tokens   game checkers::game   repair checkers::repair   hands checkers::hands   ponder checkers::ponder   clock checkers::clock
        player checkers::player   boardview checkers::boardview
        dry {sorma::service::drycarry sorma::service::drysight}
        body {sorma::service::humaneye sorma::service::humanhand}   person checkers::person   people sorma::service::human
        judge sorma::service::judge
        plot sorma::service::checkers   boardsight sorma::service::boardsight   porter sorma::service::porter
    } {
        foreach package $packages {
            package ifneeded $package 1.0 [list source -encoding utf-8 [file join $folder $file.tcl]]
        }
    }
}} [file dirname [file normalize [info script]]]
