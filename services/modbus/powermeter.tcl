# powermeter -- an energy meter of one phase, as Eastron SDM120-Modbus and SDM230-Modbus have it.
#
#     powermeter.lab CTRL -to rtu:/dev/ttyUSB0,9600,8n1 -unit 1 -poll 1
#     powermeter.lab EXEC read
#
# Source: Eastron, SDM120-Modbus and SDM230-Modbus, Modbus Protocol Implementation: parameters are float32 in two input registers, the high word
# first. The line is RS-485.

package require sorma
package require sorma::service::modbus

oo::class create ::sorma::service::powermeter {
    superclass sorma::service::modbus

    sorma::purpose "reads an energy meter of one phase"
    sorma::modbus::option -voltage double -unit V -register 30001 -as float32 -help "between line and neutral"
    sorma::modbus::option -current double -unit A -register 30007 -as float32 -help "of the line"
    sorma::modbus::option -power double -unit W -register 30013 -as float32 -help "active power; below 0 it is exported"
    sorma::modbus::option -apparent double -unit VA -register 30019 -as float32 -help "apparent power"
    sorma::modbus::option -reactive double -unit var -register 30025 -as float32 -help "reactive power"
    sorma::modbus::option -factor double -register 30031 -as float32 -help "power factor"
    sorma::modbus::option -frequency double -unit Hz -register 30071 -as float32 -every 10 -help "of the mains"
    sorma::modbus::option -imported double -unit kWh -register 30073 -as float32 -every 10 -help "active energy, since the meter was made"
    sorma::modbus::option -exported double -unit kWh -register 30075 -as float32 -every 10 -help "active energy, since the meter was made"
    sorma::example "powermeter.lab EXEC read"
}

package provide sorma::service::powermeter 1.0
