#include "measure.h"

#include <dirent.h>
#include <sched.h>
#include <signal.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "bus/glob.h"

namespace bench {

namespace {

volatile sig_atomic_t interrupted = 0;

std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        if (static_cast<unsigned char>(c) < 0x20) c = ' ';
        out += c;
    }
    return out + '"';
}

std::string number(double v, const char* format = "%.4g") {
    if (v == 0 || !std::isfinite(v)) return "null";
    char text[40];
    std::snprintf(text, sizeof text, format, v);
    return text;
}

// Three figures that count, in a unit that people read.
std::string time(double ns) {
    if (ns <= 0) return "-";
    const char* unit = "ns";
    for (const char* larger : {"us", "ms", "s"}) {
        if (ns < 1000) break;
        ns /= 1000;
        unit = larger;
    }
    char text[40];
    std::snprintf(text, sizeof text, ns < 10 ? "%.2f %s" : ns < 100 ? "%.1f %s" : "%.0f %s", ns, unit);
    return text;
}

std::string count(double perSecond) {
    const char* unit = "";
    for (const char* larger : {"k", "M", "G"}) {
        if (perSecond < 1000) break;
        perSecond /= 1000;
        unit = larger;
    }
    char text[40];
    std::snprintf(text, sizeof text, perSecond < 10 ? "%.2f%s" : perSecond < 100 ? "%.1f%s" : "%.0f%s", perSecond, unit);
    return text;
}

std::string target(const Result& r) {
    std::string out;
    auto add = [&](const std::string& text) { out += (out.empty() ? "<= " : ", ") + text; };
    char text[40];
    if (r.of.most > 0) {
        std::snprintf(text, sizeof text, "%.4gx", r.of.most);
        add(text);
    }
    if (r.of.mostNs > 0) add(time(r.of.mostNs));
    if (r.of.mostMore > 0) add("floor + " + time(r.of.mostMore));
    if (r.mostBytes > 0) add(number(r.mostBytes, "%.0f") + " B");
    if (!out.empty()) out += r.met() ? "  yes" : "  NO";
    return out;
}

void print(const Result& r) {
    if (!r.error.empty()) {
        std::printf("%-14s %-46s not measured: %s\n", r.of.row, r.of.what, r.error.c_str());
        return;
    }
    if (r.bytes > 0) {
        std::printf("%-14s %-46s %8.0f B %51s %s\n", r.of.row, r.of.what, r.bytes, "", target(r).c_str());
        return;
    }
    std::string range;
    if (r.ratio > 0) {
        char text[60];
        std::snprintf(text, sizeof text, "%5.2f (%.2f-%.2f)", r.ratio, r.low, r.high);
        range = text;
    }
    std::printf("%-14s %-46s %10s %9s %10s %-18s %s\n", r.of.row, r.of.what, time(r.ns).c_str(), count(1e9 / r.ns).c_str(),
                time(r.floorNs).c_str(), range.c_str(), target(r).c_str());
    if (r.of.floor) std::printf("%14s  floor: %s\n", "", r.of.floor);
}

// Operations that fill a batch.
std::int64_t calibrate(const Body& body, std::int64_t batch) {
    for (std::int64_t n = 1;; n *= 2) {
        std::int64_t took = body(n);
        if (took >= batch / 2 || n > (std::int64_t{1} << 40))
            return std::max<std::int64_t>(1, std::int64_t(double(n) * double(batch) / double(std::max<std::int64_t>(took, 1))));
    }
}

}  // namespace

std::int64_t now() {
    timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

double quantile(std::vector<double> values, double q) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[std::min(values.size() - 1, std::size_t(q * double(values.size())))];
}

double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

bool Result::met() const {
    if (!error.empty()) return false;
    if (mostBytes > 0 && bytes > mostBytes) return false;
    if (of.most > 0 && ratio > of.most) return false;
    if (of.mostNs > 0 && ns > of.mostNs) return false;
    return of.mostMore <= 0 || ns - floorNs <= of.mostMore;
}

Table::Table(std::vector<std::string> patterns, int rounds, bool json)
    : patterns_(std::move(patterns)), matched_(patterns_.size()), rounds_(rounds), json_(json) {}

bool Table::wants(const char* row) const {
    bool wanted = false;
    for (std::size_t i = 0; i < patterns_.size(); ++i) {
        if (!sorma::globMatch(patterns_[i], row)) continue;
        matched_[i] = wanted = true;
    }
    return wanted;
}

bool Table::wantsAny(const std::vector<Case>& cases) const {
    bool any = false;
    for (auto& c : cases) any |= wants(c.row);          // all of them: each notes its pattern
    return any;
}

std::vector<std::string> Table::unmatched() const {
    std::vector<std::string> out;
    for (std::size_t i = 0; i < patterns_.size(); ++i)
        if (!matched_[i]) out.push_back(patterns_[i]);
    return out;
}

void Table::measure(const Case& of, const Body& row, const Body& floor) {
    if (!wants(of.row)) return;
    Result result;
    result.of = of;
    std::int64_t rowCount = calibrate(row, of.batch), floorCount = floor ? calibrate(floor, of.batch) : 0;
    std::vector<double> rows, floors, ratios;
    auto batch = [&](const Body& body, std::int64_t n, std::vector<double>& out) {
        body(n / 16 + 1);
        out.push_back(double(body(n)) / double(n) / of.per);
    };
    for (int round = 0; round < rounds_; ++round) {
        std::vector<double> rowTimes, floorTimes;
        for (int i = 0; i < of.batches; ++i) {
            batch(row, rowCount, rowTimes);
            if (floor) batch(floor, floorCount, floorTimes);
            checkSignals();
        }
        rows.push_back(quantile(rowTimes, 0.25));
        if (!floor) continue;
        floors.push_back(quantile(floorTimes, 0.25));
        ratios.push_back(rows.back() / floors.back());
    }
    result.ns = median(rows);
    if (floor) {
        result.floorNs = median(floors);
        result.ratio = median(ratios);
        result.low = *std::min_element(ratios.begin(), ratios.end());
        result.high = *std::max_element(ratios.begin(), ratios.end());
    }
    add(std::move(result));
}

void Table::size(const Case& of, double bytes, double mostBytes) {
    if (!wants(of.row)) return;
    Result result;
    result.of = of;
    result.bytes = bytes;
    result.mostBytes = mostBytes;
    add(std::move(result));
}

void Table::failed(const std::vector<Case>& cases, const std::string& why) {
    for (auto& c : cases) {
        bool there = std::any_of(results_.begin(), results_.end(), [&](auto& r) { return r.of.row == c.row; });
        if (there || !wants(c.row)) continue;
        Result result;
        result.of = c;
        result.error = why;
        add(std::move(result));
    }
}

void Table::add(Result result) {
    if (!json_) {
        if (!heading_)
            std::printf("%-14s %-46s %10s %9s %10s %-18s %s\n", "row", "what", "a call", "calls/s", "floor", "ratio (min-max)", "target");
        heading_ = true;
        print(result);
        std::fflush(stdout);
    }
    results_.push_back(std::move(result));
}

bool Table::finish() {
    if (json_) {
        std::printf("[");
        for (std::size_t i = 0; i < results_.size(); ++i) {
            auto& r = results_[i];
            std::printf("%s\n {\"row\": %s, \"what\": %s, \"ns\": %s, \"floor\": %s, \"floor_ns\": %s, \"ratio\": %s, \"per_second\": %s",
                        i > 0 ? "," : "", quoted(r.of.row).c_str(), quoted(r.of.what).c_str(), number(r.ns).c_str(),
                        r.of.floor ? quoted(r.of.floor).c_str() : "null", number(r.floorNs).c_str(), number(r.ratio).c_str(),
                        r.ns > 0 ? number(1e9 / r.ns, "%.0f").c_str() : "null");
            std::printf(", \"ratio_min\": %s, \"ratio_max\": %s, \"bytes\": %s, \"met\": %s, \"error\": %s}", number(r.low).c_str(),
                        number(r.high).c_str(), number(r.bytes, "%.0f").c_str(),
                        r.hasTarget() ? r.met() ? "true" : "false" : "null", r.error.empty() ? "null" : quoted(r.error).c_str());
        }
        std::printf("\n]\n");
    }
    std::fflush(stdout);
    return std::none_of(results_.begin(), results_.end(), [](auto& r) { return !r.error.empty(); });
}

const Cpus& cpus() {
    static const Cpus found = [] {
        cpu_set_t set;
        CPU_ZERO(&set);
        sched_getaffinity(0, sizeof set, &set);
        Cpus c{-1, -1};
        for (int i = 0; i < CPU_SETSIZE && c.second < 0; ++i)
            if (CPU_ISSET(i, &set)) (c.first < 0 ? c.first : c.second) = i;
        if (c.second < 0) c.second = c.first;
        return c;
    }();
    return found;
}

void pin(int process, int cpu) {
    cpus();                         // looks at the mask, so before it is changed
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(std::size_t(cpu), &set);
    std::string folder = "/proc/" + (process == 0 ? "self" : std::to_string(process)) + "/task";
    DIR* dir = opendir(folder.c_str());
    if (!dir) return;
    while (dirent* e = readdir(dir))
        if (int thread = std::atoi(e->d_name); thread > 0) sched_setaffinity(thread, sizeof set, &set);
    closedir(dir);
}

void catchSignals() {
    struct sigaction action{};
    action.sa_handler = [](int) { interrupted = 1; };
    for (int number : {SIGINT, SIGTERM}) sigaction(number, &action, nullptr);
}

void checkSignals() {
    if (interrupted) throw Interrupted();
}

}  // namespace bench
