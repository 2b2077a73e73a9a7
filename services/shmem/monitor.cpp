#include "monitor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <sorma.h>

#include "bus/statistics.h"

namespace shmem {

namespace {

constexpr std::uint64_t kShownRecords = 5, kShownFloats = 8, kShownBytes = 16;
constexpr std::uint64_t kTimedRecords = 1000;       // a cycle may be waiting for us to come to an end

std::string number(double v) {
    std::string s;
    sorma::appendNumber(s, v);
    return s;
}

std::string shapeText(const Shape& s) {
    return std::to_string(s.blocks) + " blocks of " + std::to_string(s.floats) + " floats and " + std::to_string(s.any) +
           " bytes";
}

std::string writerText(const Writing& w) {
    return (w.program.empty() ? "process " : w.program + " ") + "[" + std::to_string(w.process) + "] since " +
           sorma::clockText(w.since);
}

std::string ageText(std::int64_t monotonic) {
    return sorma::durationText(double(std::max<std::int64_t>(0, nanoseconds() - monotonic)));
}

}  // namespace

void appendDump(std::string& out, const Reader& reader) {
    auto& segment = *reader.segment();
    auto line = [&](const std::string& text) { out += "# " + text + "\n"; };
    line("segment " + segment.key() + ": " + shapeText(segment.shape()) +
         (segment.unlinked() ? ", its name has been removed" : "") + (reader.retired() ? ", replaced by a new one" : ""));
    line("writer " + writerText(segment.writing()));
    std::uint64_t newest = reader.count();
    line("records " + std::to_string(newest));
    std::vector<double> floats(segment.shape().floats);
    std::vector<unsigned char> any(segment.shape().any);
    std::uint64_t shown = 0;
    for (std::uint64_t n = newest; n >= reader.oldest(newest) && n > 0 && shown < kShownRecords; --n, ++shown) {
        Stamp stamp;
        if (!reader.read(n, floats.data(), any.data(), stamp)) break;
        std::string text = "record " + std::to_string(n) + " at " + sorma::clockText(stamp.wall) + ", " +
                           ageText(stamp.monotonic) + " old:";
        for (std::size_t i = 0; i < floats.size() && i < kShownFloats; ++i) text += " " + number(floats[i]);
        if (floats.size() > kShownFloats) text += " ... (" + std::to_string(floats.size()) + " floats)";
        if (!any.empty()) text += " any";
        for (std::size_t i = 0; i < any.size() && i < kShownBytes; ++i) {
            const char* digits = "0123456789abcdef";
            text += std::string(" ") + digits[any[i] >> 4] + digits[any[i] & 15];
        }
        if (any.size() > kShownBytes) text += " ... (" + std::to_string(any.size()) + " bytes)";
        line(text);
    }
}

std::string timingText(const Reader& reader) {
    std::vector<std::int64_t> times;        // the oldest first, without a gap
    std::uint64_t newest = reader.count();
    std::uint64_t first = std::max(reader.oldest(newest), newest > kTimedRecords ? newest - kTimedRecords + 1 : 1);
    for (std::uint64_t n = first; n <= newest; ++n) {
        auto view = reader.view(n);
        if (view && view.valid()) times.push_back(view.stamp.monotonic);
        else times.clear();                 // the writer is faster: begin again after it
    }
    std::string out = "records " + std::to_string(newest) + ", of which " + std::to_string(times.size()) + " are looked at";
    if (times.empty()) return out;
    out += "\nage of the newest " + ageText(times.back());
    if (times.size() < 2) return out;
    std::size_t periods = times.size() - 1;
    double mean = double(times.back() - times.front()) / double(periods), squares = 0, least = INFINITY, most = 0;
    for (std::size_t i = 1; i < times.size(); ++i) {
        double period = double(times[i] - times[i - 1]);
        squares += (period - mean) * (period - mean);
        least = std::min(least, period);
        most = std::max(most, period);
    }
    char rate[40];
    std::snprintf(rate, sizeof rate, "%.4g", mean > 0 ? 1e9 / mean : 0.0);
    out += std::string("\nrate ") + rate + " per second\nperiod mean " + sorma::durationText(mean) + ", least " +
           sorma::durationText(least) + ", most " + sorma::durationText(most) + "\njitter " +
           sorma::durationText(std::sqrt(squares / double(periods))) + " (standard deviation of the period)";
    return out;
}

std::string listText() {
    std::string out;
    for (auto& e : Segment::list()) {
        if (!out.empty()) out += '\n';
        out += e.key + ": ";
        if (!e.problem.empty()) {
            out += e.problem;
        } else {
            out += shapeText(e.shape) + ", " + std::to_string(e.count) + " records, ";
            out += e.written ? "written by " + writerText(e.writing) : "no writer, the last was " + writerText(e.writing);
        }
        if (!e.written) out += e.used ? ", in use" : e.size > 0 ? ", nobody uses it" : "";
        if (e.keep) out += ", kept";
    }
    return out;
}

}  // namespace shmem
