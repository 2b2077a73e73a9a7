# scope -- an oscilloscope, as Rigol DS1000Z and MSO1000Z have it: settings, waveforms with their axes, pictures of the screen.
#
#     scope.lab CTRL -to tcp:192.168.0.7:5555 -timebase 1e-4 -scale 0.5
#     scope.lab EXEC wave                     floats: the voltages; text: start, step and unit of their times
#     scope.lab EXEC screen                   any: a PNG
#
# Source: Rigol MSO1000Z/DS1000Z Series, Programming Guide: :WAVeform:PREamble? has ten numbers, and a byte b of :WAVeform:DATA? is
# (b - yorigin - yreference) * yincrement volts.

package require sorma
package require sorma::service::scpi

oo::class create ::sorma::service::scope {
    superclass sorma::service::scpi

    sorma::purpose "drives an oscilloscope: settings, waveforms, pictures of its screen"
    sorma::scpi::option -timebase double -unit s -range {1e-9 50} -default 1e-4 -set "TIM:SCAL %g" -get TIM:SCAL? -help "of a division"
    sorma::scpi::option -scale double -unit V -range {0.001 100} -default 1 -set "CHAN1:SCAL %g" -get CHAN1:SCAL? -help "of a division of channel 1"
    sorma::option -channel int -range {1 4} -default 1 -help "whose waveform is read"
    sorma::action -run {} "let it run" {my Turn Tell RUN 0; list}
    sorma::action -stop {} "keep what it shows" {my Turn Tell STOP 0; list}
    sorma::action -single {} "take one waveform, then stop" {my Turn Tell SING 0; list}
    sorma::words "wave | screen | query TEXT | values TEXT | write TEXT | read ?-OPTION ...? | status"
    sorma::example "scope.lab EXEC wave"

    method exec message {
        switch -- [lindex [dict get $message words] 0] {
            wave { return [my Turn Wave] }
            screen { return [dict create any [my Block [my Query "DISP:DATA? ON,OFF,PNG"]]] }
        }
        return [next $message]
    }
    method Wave {} {
        my Tell ":WAV:SOUR CHAN[my cget -channel];:WAV:FORM BYTE" 0
        lassign [my AskAll {WAV:PRE? WAV:DATA?}] said data
        lassign [my Numbers $said] format type points count dx x0 xref dy y0 yref
        if {$yref eq {} || [string index $data 0] ne "#"} {
            my Fault ANSWER "expected ten numbers and a block of a waveform, got \"[string range $said 0 100]\""
        }
        binary scan [my Block $data] cu* bytes
        return [dict create floats [lmap byte $bytes {expr {($byte - $y0 - $yref) * $dy}}] text "start $x0 step $dx unit s"]
    }
}

package provide sorma::service::scope 1.0
