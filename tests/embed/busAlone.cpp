// busAlone.cpp -- the bus in a program of its own: no Tcl, no COMM. Links libsormabus alone; exits 0 when all is well.
#include <cstdio>

#include "sorma.h"

namespace {

class Gain : public sorma::Service {
public:
    static sorma::Class describe() {
        return sorma::Class::of<Gain>("gain", "multiplies each float by a factor")
            .real("-factor", &Gain::factor_, {.unit = "1", .low = -100, .high = 100, .help = "multiplier"})
            .reads(sorma::Field::floats, sorma::atLeast(1), "1", "values")
            .writes(sorma::Field::floats, sorma::atLeast(1), "1", "values times factor")
            .example("gain EXEC FMSG 2 1.5 3");
    }
    void exec(sorma::Message& m) override {
        for (double& x : m.floats) x *= factor_;
    }

private:
    double factor_ = 1;
};

int failures = 0;

void expect(const char* request, const std::string& came, const std::string& wanted) {
    if (came == wanted) return;
    std::printf("%s\n  gave   %s\n  wanted %s\n", request, came.c_str(), wanted.c_str());
    ++failures;
}

}  // namespace

int main() {
    sorma::Sorm sorm;
    sorm.add(Gain::describe());
    std::string reply;
    auto ask = [&](const char* request, const std::string& wanted) {
        sorm.dispatch(request, reply);
        expect(request, reply, wanted);
    };
    ask("dict CTRL -add gain.double '-factor 2'", "dict RET 0");
    ask("gain.double EXEC FMSG 2 1.5 3", "gain.double RET 0 FMSG 2 3 6");
    ask("gain.double DBX -get -factor", "gain.double RET 0 TMSG 2");
    sorm.dispatch("gain.double CTRL -factor 200", reply);
    if (reply.find("-factor 200 is outside -100 .. 100") == std::string::npos) expect("range", reply, "an OPTION RANGE");
    sorm.dispatch("gain@robot EXEC FMSG 1 1", reply);
    if (reply.find("RET -1") == std::string::npos) expect("no COMM", reply, "an error");

    // By reference: the same object, without text.
    sorma::Reference gain = sorm.get("gain.double");
    sorma::Message m;
    m.floats = {5};
    gain.exec(m);
    if (m.floats[0] != 10) expect("by reference", std::to_string(m.floats[0]), "10");
    sorm.remove("gain.double", sorma::Permit::owner());
    try {
        gain.exec(m);
        expect("a removed object", "went on", "SERVICE GONE");
    } catch (const sorma::Error& e) {
        if (!e.is("SERVICE GONE")) expect("a removed object", e.what(), "SERVICE GONE");
    }
    return failures == 0 ? 0 : 1;
}
