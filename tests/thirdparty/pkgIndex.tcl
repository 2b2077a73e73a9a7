package ifneeded sorma::service::thermostat 2.1 "package require sorma\n[list load [file join $dir thermostat.so] Thermostat]"
