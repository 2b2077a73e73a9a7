# transform.daemon.tcl -- of daemon transform: the object is made at once. While the robot's daemon makes carry it asks for it, and cannot
# answer what this one asks of it.
transform CTRL -dump
