#include "bus/pieces.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "bus/call.h"
#include "bus/kept.h"
#include "bus/requestText.h"
#include "bus/service.h"

namespace sorma {

namespace {

const Prototype kOld{Severity::error, "STREAM UNKNOWN", 1,
                     "{}: its daemon is older than streams, and sends replies as a whole only: call it with EXEC"};
const Prototype kNoNumber{Severity::error, "STREAM UNKNOWN", 1, "{}: its answer has no number of a stream"};

class Made : public Pieces {
public:
    explicit Made(std::function<void(Message&, std::size_t)> next) : next_(std::move(next)) {}
    bool next(Message& piece, std::size_t most) override { return next_(piece, most), true; }

private:
    const std::function<void(Message&, std::size_t)> next_;
};

// A reply that is there as a whole. Text is not cut inside a character.
class Whole : public Pieces {
public:
    explicit Whole(PendingPointer pending) : pending_(std::move(pending)) {}
    explicit Whole(Message&& reply) { reply_.swap(reply); }
    ~Whole() override {
        if (pending_) Future(pending_).cancel();
    }

    bool next(Message& piece, std::size_t most) override {
        if (pending_ && !isThere()) return false;
        piece.code = std::exchange(reply_.code, 0);
        piece.trail = std::exchange(reply_.trail, {});
        std::size_t room = most;
        cut(reply_.text, piece.text, text_, room);
        cut(reply_.floats, piece.floats, floats_, room);
        cut(reply_.ints, piece.ints, ints_, room);
        cut(reply_.any, piece.any, any_, room);
        return true;
    }
    bool works() const override { return false; }
    std::size_t heap() const override { return heapOf(reply_); }

private:
    bool isThere() {
        if (!pending_->answered()) {
            if (!std::exchange(told_, true)) pending_->whenAnswered([this] { wake(); });
            return false;
        }
        auto pending = std::exchange(pending_, nullptr);
        reply_.swap(Future(pending).result());
        reply_.words.clear();
        return true;
    }

    // The next part of a field. Its memory is freed when it was the last.
    template <class V> static void cut(V& from, V& to, std::size_t& at, std::size_t& room) {
        constexpr std::size_t kSize = sizeof(typename V::value_type);
        std::size_t end = std::min(from.size(), at + room / kSize);
        if constexpr (std::is_same_v<V, std::string>)
            while (end > at && end < from.size() && (from[end] & 0xc0) == 0x80) --end;
        if (end < from.size() && end == at) {
            room = 0;                       // a piece that has something already ends here
            return;
        }
        if (at == 0 && end == from.size()) to.swap(from);
        else to.assign(from.begin() + std::ptrdiff_t(at), from.begin() + std::ptrdiff_t(end));
        room -= std::min(room, to.size() * kSize);
        at = end;
        if (at < from.size()) room = 0;
        else freeMemory(from), at = 0;
    }

    PendingPointer pending_;
    Message reply_;
    bool told_ = false;
    std::size_t text_ = 0, floats_ = 0, ints_ = 0, any_ = 0;    // how far each has been read
};

}  // namespace

std::unique_ptr<Pieces> piecesOf(std::function<void(Message&, std::size_t)> next) { return std::make_unique<Made>(std::move(next)); }
std::unique_ptr<Pieces> piecesOf(Message&& reply) { return std::make_unique<Whole>(std::move(reply)); }
std::unique_ptr<Pieces> piecesOf(PendingPointer reply) { return std::make_unique<Whole>(std::move(reply)); }

std::unique_ptr<Pieces> Service::inPieces(Message&) { return nullptr; }

// ---- the reader ----

Reading::Reading(Reference object, const Message& request, How how)
    : object_(std::move(object)), how_{std::clamp(how.most, std::size_t(1024), kMostPiece), std::clamp(how.ahead, std::size_t(1), kMostAhead)},
      context_(CallContext::keep()) {
    Message open;
    std::string text;
    appendRequest(text, "x", Method::exec, request);
    open.words = {"-stream", "open", std::to_string(how_.most), text.substr(2)};
    asked_.push_back(object_->async(Method::dbx, std::move(open)));
}

// Pieces are asked for without a deadline: how long a reader waits is his business.
Future Reading::send(std::string number) const {
    CallContext again(context_);
    Message m;
    m.words = {"-stream", "next", std::to_string(stream_), std::move(number)};
    return object_->async(Method::dbx, std::move(m), Deadline::at(INT64_MAX), true);
}

void Reading::ask() {
    while (asked_.size() < how_.ahead) asked_.push_back(send(std::to_string(next_++)));
}

bool Reading::ready() {
    if (ended_) return true;
    if (!asked_.front().done()) return false;
    auto& open = *asked_.front().pending();
    if (stream_ != 0 || open.failed() || open.message.ints.empty()) return true;
    stream_ = std::uint64_t(open.message.ints[0]);
    asked_.pop_front();
    ask();
    return asked_.front().done();
}

Reading::Taken Reading::take(Message& piece) {
    if (!ready()) return Taken::notYet;
    if (!failure_.empty()) throw Error(failure_);
    if (ended_) return Taken::end;
    try {
        piece.reset();
        piece.swap(asked_.front().result());
        if (stream_ == 0) fail(kNoNumber, object_->name());
    } catch (...) {
        failed();
    }
    asked_.pop_front();
    if (isEnd(piece)) return end(), Taken::end;
    ask();
    return Taken::piece;
}

bool Reading::next(Message& piece, Deadline deadline) {
    for (;;) {
        Taken taken = take(piece);
        if (taken != Taken::notYet) return taken == Taken::piece;
        const Future coming = asked_.front();
        try {
            coming.wait(deadline);
        } catch (const Error&) {
            if (!coming.done()) throw;      // else take() throws it
        }
    }
}

void Reading::failed() {
    Trail trail = trailOfCurrentException(object_->name());
    const Error why(trail);
    if (stream_ == 0 && why.is("OPTION UNKNOWN") && why.code().size() > 3 && why.code()[3] == "-stream")
        trail = Trail(makeEntry(kOld, {MessageArg::of(object_->name())}));
    failure_ = trail;
    end();
    throw Error(std::move(trail));
}

void Reading::close() {
    if (ended_) return;
    // Not open yet: it is closed when its number is there.
    if (stream_ == 0)
        asked_.front().then([object = object_, context = context_](const Future& open) {
            auto& p = *open.pending();
            if (!p.failed() && !p.message.ints.empty()) tellEnd(object, context, std::to_string(p.message.ints[0]));
        });
    end();
}

void Reading::end() {
    ended_ = true;
    for (auto& future : std::exchange(asked_, {}))
        if (stream_ != 0) future.cancel();
    // A daemon that has died knows nothing of it; the next one is not told.
    const bool lost = !failure_.empty() && Error(failure_).is("COMM LOST");
    if (stream_ != 0 && !lost) tellEnd(object_, context_, std::to_string(stream_));
}

// When that fails it ends with the connection, or when nobody has read it for long.
void Reading::tellEnd(const Reference& object, const KeptCallPointer& context, std::string number) {
    CallContext again(context);
    Message m;
    m.words = {"-stream", "close", std::move(number)};
    try {
        object->oneway(Method::dbx, std::move(m));
    } catch (const std::exception&) {
    }
}

}  // namespace sorma
