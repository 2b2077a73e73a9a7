#include "comm/wireSpan.h"

#include <algorithm>

#include "bus/kept.h"
#include "bus/requestText.h"

namespace sorma::wire {

namespace {

constexpr std::uint32_t kDbx = 2, kFinished = 4, kFailed = 8, kSent = 16, kAnswered = 32, kKindShift = 6;
constexpr std::size_t kMostLate = 1 << 20;     // [bytes]
constexpr std::size_t kMostName = 256, kMostError = 256, kMostDepth = 256;
constexpr std::int64_t kLongest = std::int64_t{1} << 60;       // [ns]

bool leaves(const Span& s) { return s.kind == Span::Kind::oneway || s.kind == Span::Kind::event; }

class Writer {
public:
    Writer(Buffer& out, const std::function<bool(const std::string&)>& shown, bool foreign) : w_(out), out_(out), shown_(shown), foreign_(foreign) {}

    // The calls of a span. Returns how many are left out, with those that were so before.
    std::uint32_t calls(const Span& of, std::uint32_t depth, bool mayShow) {
        std::uint32_t lost = of.lost;
        for (auto& c : of.calls) {
            if (depth > kMostDepth || out_.size() > kMostSpanBytes) {
                ++lost;
                continue;
            }
            const bool show = mayShow && shown_(c->name);
            w_.u32(depth);
            w_.u32(std::uint32_t(c->method) | (c->finished && !c->underway ? kFinished : 0) | (c->failed ? kFailed : 0) | (c->sent ? kSent : 0) | (c->answered ? kAnswered : 0) |
                   std::uint32_t(c->kind) << kKindShift);
            w_.text(show ? cutText(c->name, kMostName) : std::string());
            w_.text(show ? cutText(c->event.empty() ? c->error : c->event, kMostError) : std::string());
            w_.i64(c->offset);
            w_.i64(c->lasted());
            w_.i64(c->waited);
            w_.i64(c->far);
            w_.i64(c->farWaited);
            const std::size_t place = out_.size();
            w_.u32(0);
            if (leaves(*c)) w_.u64(c->cause), w_.u32(c->heard);
            const std::uint32_t left = calls(*c, depth + 1, show && (foreign_ || !c->sent));
            XdrWriter::put(out_.data() + place, left);
        }
        return lost;
    }

private:
    XdrWriter w_;
    Buffer& out_;
    const std::function<bool(const std::string&)>& shown_;
    const bool foreign_;
};

std::string oneLine(std::string_view text) {
    std::string out(text);
    for (char& c : out)
        if (static_cast<unsigned char>(c) < ' ' || c == 0x7f) c = '?';
    return out;
}

bool sane(std::initializer_list<std::int64_t> times) {
    return std::all_of(times.begin(), times.end(), [](auto t) { return t >= 0 && t < kLongest; });
}

}  // namespace

Buffer spansOf(const Span& root, const std::function<bool(const std::string&)>& shown, bool foreign) {
    Buffer out;
    XdrWriter w(out);
    w.i64(root.waited);
    w.i64(root.lasted());
    w.u32(0);
    const std::uint32_t lost = Writer(out, shown, foreign).calls(root, 1, true);
    XdrWriter::put(out.data() + 16, lost);
    return out;
}

bool readSpans(std::string_view body, Span& into) {
    XdrReader r(body);
    Span read(into.share, into.name, into.method, 0);
    read.waited = r.i64();
    read.whole = r.i64();
    read.lost = r.u32();
    std::vector<Span*> path{&read};             // the open spans, the outermost first; null: it found no room
    std::uint32_t room = TraceShare::kMostSpans - std::min(into.share->spans, TraceShare::kMostSpans), made = 0;
    if (!r.good() || !sane({read.waited, read.whole})) return false;
    while (!r.atEnd()) {
        const std::uint32_t depth = r.u32(), flags = r.u32();
        const auto name = r.text(), error = r.text();
        std::int64_t times[5];
        for (auto& t : times) t = r.i64();
        const std::uint32_t lost = r.u32(), kind = flags >> kKindShift & 3;
        const bool leaves = kind == std::uint32_t(Span::Kind::oneway) || kind == std::uint32_t(Span::Kind::event);
        const std::uint64_t cause = leaves ? r.u64() : 0;
        const std::uint32_t heard = leaves ? r.u32() : 0;
        if (!r.good() || depth == 0 || depth > path.size() || depth > kMostDepth || (flags & 3) > kDbx || !isUtf8(name) || !isUtf8(error) ||
            name.size() > 2 * kMostName || error.size() > 2 * kMostError || !sane({times[0], times[1], times[2], times[3], times[4]}))
            return false;
        path.resize(depth);
        Span* above = path.back();
        if (!above || made >= room) {
            if (above) ++above->lost;
            path.push_back(nullptr);
            continue;
        }
        ++made;
        auto span = std::make_shared<Span>(into.share, oneLine(name), Method(flags & 3), 0);
        span->kind = Span::Kind(kind);
        (kind < std::uint32_t(Span::Kind::event) ? span->error : span->event) = oneLine(error);
        span->cause = cause;
        span->heard = heard;
        span->finished = true;                  // its times do not grow here
        span->underway = !(flags & kFinished);
        span->failed = flags & kFailed;
        span->sent = flags & kSent;
        span->answered = flags & kAnswered;
        span->offset = times[0];
        span->whole = times[1];
        span->waited = times[2];
        span->far = times[3];
        span->farWaited = times[4];
        span->lost = lost;
        path.push_back(span.get());
        above->calls.push_back(std::move(span));
    }
    into.share->spans += made;
    into.answered = true;
    into.farWaited += read.waited;
    into.far += read.whole;
    into.lost += read.lost;
    for (auto& c : read.calls) into.calls.push_back(std::move(c));
    return true;
}

// ---- late ones: number, cause, is it over, its spans ----

Buffer lateSpansOf(const LateSpans& late, TraceNumber number, const std::function<bool(const std::string&)>& shown, bool foreign) {
    Buffer out;
    XdrWriter w(out);
    for (auto& k : late.kept()) {
        if (k.span->share->number != number || out.size() > kMostLate) continue;
        Span above(k.span->share, {}, k.span->method, 0);
        above.finished = true;
        above.calls.push_back(k.span);
        const Buffer spans = spansOf(above, shown, foreign);
        w.u64(k.number);
        w.u64(k.cause);
        w.u32(isOver(*k.span));
        w.bytes(spans.data(), spans.size());
    }
    return out;
}

bool readLateSpans(std::string_view body, const std::function<Span*(std::uint64_t cause)>& find, std::set<std::uint64_t>& seen, bool all) {
    XdrReader r(body);
    while (!r.atEnd()) {
        const std::uint64_t number = r.u64(), cause = r.u64();
        const bool over = r.u32() != 0;
        const auto spans = r.text();
        if (!r.good()) return false;
        Span* into = seen.contains(number) || !(over || all) ? nullptr : find(cause);
        if (!into || into->told >= into->heard) continue;
        Span read(into->share, {}, into->method, 0);
        if (!readSpans(spans, read)) return false;
        seen.insert(number);
        ++into->told;
        into->lost += read.lost;
        for (auto& c : read.calls) into->calls.push_back(std::move(c));
    }
    return true;
}

}  // namespace sorma::wire
