#include "figuresText.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <vector>

#include "bus/network.h"
#include "bus/statistics.h"

namespace metrics {

namespace {

using sorma::Figures;
using sorma::Sorm;

// Edges of the histogram's buckets: powers of 4 from 1 us to 17 s [log2 of ns].
constexpr int kFirst = 10, kLast = 34;

std::string number(double value) {
    std::string out;
    sorma::appendNumber(out, value);
    return out;
}

void head(std::string& out, const char* name, const char* type, const char* help) {
    out += std::string("# HELP ") + name + " " + help + "\n# TYPE " + name + " " + type + "\n";
}

void line(std::string& out, const std::string& name, const std::string& labels, const std::string& value) {
    out += name + (labels.empty() ? "" : "{" + labels + "}") + " " + value + "\n";
}

void single(std::string& out, const char* name, const char* type, const char* help, double value) {
    head(out, name, type, help);
    line(out, name, {}, number(value));
}

double resident() {
    std::size_t all = 0, pages = 0;
    std::ifstream("/proc/self/statm") >> all >> pages;
    return double(pages) * double(sysconf(_SC_PAGESIZE));
}

void merge(Figures& sum, const Figures& f) {
    sum.objects += f.objects, sum.underWay += f.underWay;
    sum.execs += f.execs, sum.ctrls += f.ctrls, sum.dbxs += f.dbxs, sum.errors += f.errors;
    sum.times.add(f.times);
}

void histogram(std::string& out, const std::string& label, const sorma::Histogram& times) {
    const std::string name = "sorma_call_duration_seconds";
    for (int i = kFirst; i <= kLast; i += 2) line(out, name + "_bucket", label + ",le=\"" + number(double(std::int64_t{1} << i) / 1e9) + "\"", std::to_string(times.below(i)));
    line(out, name + "_bucket", label + ",le=\"+Inf\"", std::to_string(times.count()));
    line(out, name + "_sum", label, number(double(times.sum()) / 1e9));
    line(out, name + "_count", label, std::to_string(times.count()));
}

// A cycle's DBX -stats. False: it says nothing now.
bool ask(sorma::Service& cycle, sorma::Message& m) {
    m.words = {"-stats"};
    try {
        return !cycle.start(sorma::Method::dbx, m) && m.ints.size() == 2 && m.floats.size() == 3;
    } catch (const sorma::Error&) {
        return false;
    }
}

}  // namespace

std::string Labels::of(const std::string& name) {
    if (!known_.contains(name)) {
        if (known_.size() >= most_) return "other";
        known_.insert(name);
    }
    std::string out;
    for (char c : name) {
        if (c == '\\' || c == '"') out += '\\';
        if (c == '\n') out += "\\n";
        else out += c;
    }
    return out;
}

bool FiguresText::classes(std::string& out, Sorm& sorm) {
    std::map<std::string, Figures> sums;
    const auto all = sorm.figures();
    for (auto& [name, figures] : all) merge(sums["class=\"" + classes_.of(name) + "\""], figures);
    auto each = [&](const char* name, const char* type, const char* help, std::uint64_t Figures::*member) {
        head(out, name, type, help);
        for (auto& [label, f] : sums) line(out, name, label, std::to_string(f.*member));
    };
    each("sorma_objects", "gauge", "Objects in this process.", &Figures::objects);
    each("sorma_requests_under_way", "gauge", "Requests that objects have taken over or keep waiting.", &Figures::underWay);
    each("sorma_errors_total", "counter", "Requests that objects have refused.", &Figures::errors);
    head(out, "sorma_calls_total", "counter", "Requests that came to objects.");
    for (auto& [label, f] : sums) {
        line(out, "sorma_calls_total", label + ",method=\"exec\"", std::to_string(f.execs));
        line(out, "sorma_calls_total", label + ",method=\"ctrl\"", std::to_string(f.ctrls));
        line(out, "sorma_calls_total", label + ",method=\"dbx\"", std::to_string(f.dbxs));
    }
    head(out, "sorma_call_duration_seconds", "histogram", "Time of one EXEC in 64, until its answer.");
    for (auto& [label, f] : sums) histogram(out, label, f.times);
    auto found = all.find("cycle");
    return found != all.end() && found->second.objects > 0;
}

void FiguresText::cycles(std::string& out, Sorm& sorm) {
    struct Sum {
        double ticks = 0, skipped = 0, late[3] = {0, 0, 0};
    };
    std::map<std::string, Sum> sums;
    for (auto& name : sorm.names("cycle*")) {
        sorma::Service* object = sorm.find(name);
        if (!object || object->isElsewhere() || object->type().name() != "cycle" || object->name() != name) continue;
        sorma::Message m;
        if (!ask(*object, m)) continue;
        Sum& sum = sums["cycle=\"" + cycles_.of(name) + "\""];
        sum.ticks += double(m.ints[0]), sum.skipped += double(m.ints[1]);
        for (int i = 0; i < 3; ++i) sum.late[i] = std::max(sum.late[i], m.floats[std::size_t(i)]);
    }
    head(out, "sorma_cycle_ticks_total", "counter", "Ticks of a cycle since it was started or reset.");
    for (auto& [label, s] : sums) line(out, "sorma_cycle_ticks_total", label, number(s.ticks));
    head(out, "sorma_cycle_ticks_skipped_total", "counter", "Ticks that were left out, since the one before was not over.");
    for (auto& [label, s] : sums) line(out, "sorma_cycle_ticks_skipped_total", label, number(s.skipped));
    head(out, "sorma_cycle_lateness_seconds", "gauge", "How late ticks began: this share of them was not later.");
    for (auto& [label, s] : sums)
        for (int i = 0; i < 3; ++i) line(out, "sorma_cycle_lateness_seconds", label + ",share=\"" + (i == 0 ? "0.5" : i == 1 ? "0.99" : "1") + "\"", number(s.late[i]));
}

std::string FiguresText::make(Sorm& sorm) {
    std::string out;
    out.reserve(1 << 16);
    if (classes(out, sorm)) cycles(out, sorm);
    double kept = 0;
    for (auto& account : sorm.budget.accounts()) kept += double(account->used());
    single(out, "sorma_kept_bytes", "gauge", "Memory that this process keeps for others.", kept);
    single(out, "process_resident_memory_bytes", "gauge", "Memory of the process that is in use.", resident());
    single(out, "sorma_denials_total", "counter", "Requests that the policy has refused.", double(sorm.access.denials()));
    const auto n = sorm.network ? sorm.network->figures() : sorma::Network::Figures{};
    single(out, "sorma_connections", "gauge", "Connections of clients.", double(n.connections));
    single(out, "sorma_sessions", "gauge", "Sessions of clients.", double(n.sessions));
    single(out, "sorma_served_total", "counter", "Requests that came from other processes.", double(n.served));
    single(out, "sorma_connections_refused_total", "counter", "Connections that were refused.", double(n.refused));
    single(out, "sorma_oneways_dropped_total", "counter", "One-way requests that were dropped.", double(n.dropped));
    single(out, "sorma_events_lost_total", "counter", "Events that subscribers did not get.", double(n.eventsLost));
    return out;
}

}  // namespace metrics
