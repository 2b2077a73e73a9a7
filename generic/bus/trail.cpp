#include "bus/trail.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <ctime>
#include <iterator>
#include <utility>

#include "bus/enumText.h"

namespace sorma {

namespace {

std::atomic<std::size_t> theLimit{Trail::kDefaultLimit};

// Clear text on one line: whatever would move a terminal's cursor becomes a space.
void appendLine(std::string& out, std::string_view text) {
    for (char c : text) out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? ' ' : c;
}

void appendTime(std::string& out, std::int64_t microseconds) {
    std::int64_t seconds = microseconds / 1'000'000, rest = microseconds % 1'000'000;
    if (rest < 0) {
        rest += 1'000'000;
        --seconds;
    }
    std::time_t t = static_cast<std::time_t>(seconds);
    std::tm local{};
    localtime_r(&t, &local);
    char text[48];
    std::snprintf(text, sizeof text, "%02d:%02d:%02d.%03d", local.tm_hour, local.tm_min, local.tm_sec, static_cast<int>(rest / 1000));
    out += text;
}

}  // namespace

const char* toText(Severity severity) {
    switch (severity) {
        case Severity::verbose: return "verbose";
        case Severity::warning: return "warning";
        case Severity::error: break;
    }
    return "error";
}

bool fromText(std::string_view text, Severity& out) {
    return findText(text, Severity::verbose, Severity::error, out);
}

void Trail::setLimit(std::size_t entries) { theLimit.store(entries > 0 ? entries : 1, std::memory_order_relaxed); }

// Relaxed: the number stands alone, nothing else is read on the strength of it.
std::size_t Trail::limit() { return theLimit.load(std::memory_order_relaxed); }

void Trail::add(Entry entry) {
    entries_.push_back(std::move(entry));
    trim();
}

void Trail::append(const Trail& other) {
    const std::size_t count = other.entries_.size();        // other may be this
    entries_.reserve(entries_.size() + count);
    std::copy_n(other.entries_.begin(), count, std::back_inserter(entries_));
    dropped_ += other.dropped_;
    trim();
}

// One pass for any number, so that a peer's trail of a million entries only costs as much as reading it.
void Trail::trim() {
    const std::size_t most = limit();
    if (entries_.size() <= most) return;
    const std::size_t excess = entries_.size() - most;
    std::array<std::size_t, 3> have{}, drop{};
    for (auto& e : entries_) ++have[static_cast<std::size_t>(e.severity)];
    std::size_t left = excess;
    for (std::size_t s = 0; s < have.size(); ++s) {
        drop[s] = std::min(have[s], left);
        left -= drop[s];
    }
    bool first = true;      // the first error is the cause: of the errors it goes last
    auto goes = [&](const Entry& e) {
        auto s = static_cast<std::size_t>(e.severity);
        if (e.severity == Severity::error && std::exchange(first, false)) return false;
        if (drop[s] == 0) return false;
        --drop[s];
        return true;
    };
    std::size_t kept = 0;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
        if (goes(entries_[i])) continue;
        if (kept != i) entries_[kept] = std::move(entries_[i]);
        ++kept;
    }
    entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(kept), entries_.end());
    dropped_ += excess;
}

const Entry* Trail::cause() const {
    for (auto& e : entries_)
        if (e.severity == Severity::error) return &e;
    return entries_.empty() ? nullptr : &entries_.back();
}

std::vector<std::string> Entry::code() const {
    if (symbol == kForeign && details.size() > 1) return {details.begin() + 1, details.end()};
    std::vector<std::string> words{"SORMA"};
    std::string_view rest = symbol;
    while (!rest.empty()) {
        auto space = std::min(rest.find(' '), rest.size());
        if (space > 0) words.emplace_back(rest.substr(0, space));
        rest.remove_prefix(std::min(space + 1, rest.size()));
    }
    words.insert(words.end(), details.begin(), details.end());
    return words;
}

std::string Trail::toText() const {
    std::string out;
    if (dropped_ > 0) out = std::to_string(dropped_) + " older messages were dropped";
    for (auto& e : entries_) {
        if (!out.empty()) out += '\n';
        out += sorma::toText(e.severity);
        out += " SORMA ";
        appendLine(out, e.symbol);
        out += ": ";
        appendLine(out, e.text);
        out += "  (";
        if (!e.so.empty() || !e.daemon.empty()) {
            appendLine(out, e.so);
            if (!e.daemon.empty()) {
                out += '@';
                appendLine(out, e.daemon);
            }
            out += ", ";
        }
        if (!e.file.empty()) {
            appendLine(out, e.file);
            out += ':' + std::to_string(e.line) + ", ";
        }
        appendTime(out, e.time);
        out += ')';
    }
    return out;
}

}  // namespace sorma
