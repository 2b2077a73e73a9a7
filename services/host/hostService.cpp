// host -- the machine that a daemon runs on: load, memory, disks, temperatures, clock.
//
// `host EXEC load` answers in floats, and in text what each of them is and in which unit. Without a word: a summary.
#include <sorma.h>

#include "host.h"

namespace {

const sorma::Prototype kWhat{sorma::Severity::error, "HOST WORD", 2, "{}: bad word \"{}\": must be clock, disks, load, memory, or temperatures"};
const sorma::Prototype kCold{sorma::Severity::verbose, "HOST NO_THERMOMETER", 1, "{}: this machine has no thermometer that the kernel knows"};

class HostService : public sorma::Service {
public:
    static sorma::Class describe() {
        return sorma::Class::of<HostService>("host", "figures of the machine it runs on")
            .named("-path", &HostService::path_, {.help = "a file on the disk that the summary tells about"})
            .words("?clock|disks|load|memory|temperatures?")
            .writes(sorma::Field::floats, {}, "1, bytes, K or s",
                    "load [1], memory and disks [bytes], temperatures [K], clock [s]; temperatures: none without a thermometer")
            .writes(sorma::Field::text, {}, "", "a line for each: name, value, unit")
            .repeatable()
            .example("host EXEC load");
    }

    void exec(sorma::Message& m) override {
        std::string what = m.words.empty() ? std::string() : m.words[0];
        m.clear();
        if (what.empty()) summary(m);
        else if (what == "load") load(m);
        else if (what == "memory") memory(m);
        else if (what == "disks") disks(m);
        else if (what == "temperatures") temperatures(m);
        else if (what == "clock") clock(m);
        else fail(kWhat, name(), what);
    }

    std::string selftest() override {
        sorma::Message m;
        load(m), memory(m), disks(m), temperatures(m), clock(m);
        return "ok: " + std::to_string(m.floats.size()) + " figures read";
    }

private:
    // A figure: the number for programs, the line for people.
    static void put(sorma::Message& m, const std::string& name, double value, const char* unit) {
        m.floats.push_back(value);
        if (!m.text.empty()) m.text += '\n';
        m.text += name + " ";
        sorma::appendNumber(m.text, value);
        if (*unit) m.text += std::string(" ") + unit;
    }

    static void load(sorma::Message& m) {
        auto l = host::load();
        put(m, "load-1min", l.oneMinute, "");
        put(m, "load-5min", l.fiveMinutes, "");
        put(m, "load-15min", l.fifteenMinutes, "");
        put(m, "running", l.running, "");
        put(m, "processes", l.processes, "");
        put(m, "processors", l.processors, "");
    }

    static void memory(sorma::Message& m) {
        auto x = host::memory();
        put(m, "memory-total", x.total, "bytes");
        put(m, "memory-available", x.available, "bytes");
        put(m, "swap-total", x.swapTotal, "bytes");
        put(m, "swap-free", x.swapFree, "bytes");
    }

    static void put(sorma::Message& m, const host::Disk& d) {
        put(m, d.path + "-size", d.size, "bytes");
        put(m, d.path + "-available", d.available, "bytes");
    }

    static void disks(sorma::Message& m) {
        for (auto& d : host::disks()) put(m, d);
    }

    void temperatures(sorma::Message& m) const {
        auto all = host::temperatures();
        for (auto& t : all) put(m, t.name, t.kelvin, "K");
        if (!all.empty()) return;
        if (m.text.empty()) m.text = "# this machine has no thermometer that the kernel knows";
        m.warn(kCold, name());
    }

    static void clock(sorma::Message& m) {
        auto c = host::clock();
        put(m, "wall", c.wall, "s");
        put(m, "monotonic", c.monotonic, "s");
        put(m, "uptime", c.uptime, "s");
        put(m, "resolution", c.resolution, "s");
    }

    void summary(sorma::Message& m) const {
        auto l = host::load();
        auto x = host::memory();
        put(m, "load-1min", l.oneMinute, "");
        put(m, "processors", l.processors, "");
        put(m, "memory-total", x.total, "bytes");
        put(m, "memory-available", x.available, "bytes");
        put(m, host::disk(path_.use(*this)));          // says whether the path exists
        put(m, "uptime", host::clock().uptime, "s");
        for (auto& t : host::temperatures()) put(m, t.name, t.kelvin, "K");
    }

    sorma::Named<sorma::Kind::file> path_ = "/";
};

}  // namespace

extern "C" SORMA_EXPORT int Host_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::host", "1.0", {HostService::describe()});
}
