# psu -- a power supply with one output, as Keysight E36100 and Rigol DP700 have it.
#
#     psu.lab CTRL -to tcp:192.168.0.9:5025 -voltage 3.3 -current 0.5 -output 1
#     psu.lab EXEC read
#
# Sources: SCPI 1999.0, volume 4, chapter 7 (power supplies); the programming guides of these two families. Others of one output often understand
# the same.

package require sorma
package require sorma::service::scpi

oo::class create ::sorma::service::psu {
    superclass sorma::service::scpi

    sorma::purpose "drives a power supply with one output"
    sorma::scpi::option -voltage double -unit V -range {0 60} -danger power -set "VOLT %g" -get VOLT? -help "to be kept"
    sorma::scpi::option -current double -unit A -range {0 30} -danger power -set "CURR %g" -get CURR? -help "not to be exceeded"
    sorma::scpi::option -protection double -unit V -range {0 66} -default 66 -danger power -set "VOLT:PROT %g" -get VOLT:PROT? -help "beyond it the output goes off"
    sorma::scpi::option -output flag -danger power -set "OUTP %d" -get OUTP? -help "is it switched on"
    sorma::scpi::option -volts double -unit V -get MEAS:VOLT? -help "measured at the output"
    sorma::scpi::option -amperes double -unit A -get MEAS:CURR? -help "measured at the output"
    sorma::example "psu.lab EXEC read"
}

package provide sorma::service::psu 1.0
