// thermostat -- a service class from outside: it knows SORMA by its installed header and library alone.
#include <sorma.h>

#include <algorithm>

namespace {

const sorma::Prototype kBroken{sorma::Severity::error, "THERMOSTAT SENSOR", 1, "{}: {} K is no temperature of a room; is the sensor connected?"};
const sorma::Prototype kHot{sorma::Severity::warning, "THERMOSTAT HOT", 1, "{}: {} K is above the setpoint by more than 10 K"};

class Thermostat : public sorma::Service {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Thermostat>("thermostat", "holds a temperature with a heater")
            .real("-setpoint", &Thermostat::setpoint_, {.unit = "K", .low = 250, .high = 350, .help = "temperature to hold"})
            .real("-gain", &Thermostat::gain_, {.unit = "W/K", .low = 0, .high = 1000, .help = "heating power for each kelvin missing"})
            .action("-off", &Thermostat::off, "", "heat no more until -setpoint is set again")
            .reads(sorma::Field::floats, sorma::exactly(1), "K", "measured temperature", 0, 10000)
            .writes(sorma::Field::floats, sorma::exactly(1), "W", "heating power")
            .example("thermostat EXEC FMSG 1 291.15");
    }

    void exec(sorma::Message& m) override {
        double measured = m.floats[0];
        if (measured < 200 || measured > 400) fail(kBroken, name(), measured);
        if (measured > setpoint_ + 10) m.warn(kHot, name(), measured);
        m.floats[0] = on_ ? std::max(0.0, gain_ * (setpoint_ - measured)) : 0;
    }

    void changed(std::span<const sorma::Option* const>) override { on_ = true; }
    void off(sorma::Args, sorma::Message&) { on_ = false; }
    void dumpState(std::string& out) const override { out += on_ ? "# on\n" : "# off\n"; }

private:
    double setpoint_ = 293.15, gain_ = 100;
    bool on_ = true;
};

}  // namespace

extern "C" SORMA_EXPORT int Thermostat_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::thermostat", "2.1", {Thermostat::describe()});
}
