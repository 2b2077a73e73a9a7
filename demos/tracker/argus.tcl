# argus.tcl -- what the daemon argus does from its start: it looks at each picture.
findball.argus CTRL -stream 1
