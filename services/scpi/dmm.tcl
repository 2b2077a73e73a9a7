# dmm -- a digital multimeter, as Keysight 34460A and 34461A have it.
#
#     dmm.lab CTRL -to tcp:192.168.0.8:5025 -function RES -poll 1
#     dmm.lab EXEC read
#
# Sources: SCPI 1999.0, volume 4, chapter 4 (digital meters); Keysight Truevolt Series, Operating and Service Guide.

package require sorma
package require sorma::service::scpi

oo::class create ::sorma::service::dmm {
    superclass sorma::service::scpi

    sorma::purpose "drives a digital multimeter"
    sorma::scpi::option -function enum -choices {VOLT CURR RES} -set {FUNC "%s"} -get FUNC? -help "what it measures: voltage, current (both direct), resistance"
    sorma::scpi::option -range double -unit V -range {0.1 1000} -default 10 -set "VOLT:RANG %g" -get VOLT:RANG? -help "of voltages"
    sorma::scpi::option -cycles double -range {0.02 100} -default 10 -set "VOLT:NPLC %g" -get VOLT:NPLC? -help "of the mains that a voltage is averaged over"
    sorma::scpi::option -reading double -get READ? -help "the last one, in V, A or ohm; 9.9e37 is too much for the range"
    sorma::example "dmm.lab EXEC read"
}

package provide sorma::service::dmm 1.0
