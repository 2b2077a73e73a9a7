# tour.tcl -- the main job of ./bootstrap run: a daemon on loopback, and requests to it.
puts "tour"
