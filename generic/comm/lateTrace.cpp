#include "comm/lateTrace.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <string_view>
#include <thread>
#include <utility>

#include "comm/wireSpan.h"

namespace sorma {

namespace {

class Gatherer {
public:
    Gatherer(Comm& comm, Sorm& sorm, Span& root, const std::vector<std::string>& also) : comm_(comm), sorm_(sorm), root_(root) {
        std::set<std::string> names(also.begin(), also.end());
        for (auto& name : comm.known()) names.insert(name);
        for (auto& name : names) lines_.push_back(comm.privateLine(name));
    }

    // Is anything missing?
    bool missing() {
        left_.clear();
        return look(root_, 0);
    }
    void ask(Deadline until) {
        const bool all = until.passed();
        auto take = [&](const std::vector<unsigned char>& bytes) {
            const std::string_view body(reinterpret_cast<const char*>(bytes.data()), bytes.size());
            wire::readLateSpans(body, [&](std::uint64_t cause) { return left_.contains(cause) ? left_[cause] : nullptr; }, seen_, all);
        };
        take(static_cast<Network&>(comm_).lateSpans(root_.share->number, nullptr));
        std::vector<Future> asked;
        const Deadline patience = all ? Deadline::in(100) : until;
        for (auto& line : lines_) {
            auto pending = std::make_shared<Pending>(sorm_, patience, nullptr, nullptr);
            pending->message.words = {"-spans", traceparent(root_.share->number)};
            asked.emplace_back(pending);
            line->begin(pending, "sorm", Method::dbx);
        }
        for (auto& future : asked) {
            try {
                take(future.wait(patience).any);
            } catch (const Error&) {        // it does not know traces, or does not let us
            }
        }
    }

private:
    // Deeper spans are left untold: a daemon may say that its spans cause each other.
    bool look(Span& span, int depth) {
        constexpr int kDeepest = 256;
        bool found = false;
        if (span.told < span.heard && depth < kDeepest) left_[span.cause] = &span, found = true;
        for (auto& c : span.calls) found |= look(*c, depth + 1);
        return found;
    }
    Comm& comm_;
    Sorm& sorm_;
    Span& root_;
    std::vector<std::shared_ptr<Connection>> lines_;        // to each daemon that is asked
    std::map<std::uint64_t, Span*> left_;       // that others have not told yet
    std::set<std::uint64_t> seen_;
};

}  // namespace

void gatherLate(Comm& comm, Sorm& sorm, Span& root, Deadline until, const std::vector<std::string>& also) {
    Gatherer gatherer(comm, sorm, root, also);
    for (auto pause = std::chrono::milliseconds(1); gatherer.missing(); pause = std::min(2 * pause, std::chrono::milliseconds(50))) {
        const bool last = until.passed();
        gatherer.ask(until);
        if (last) return;
        std::this_thread::sleep_for(pause);
    }
}

}  // namespace sorma
