#include "bus/openPieces.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "bus/atEnd.h"
#include "bus/call.h"
#include "bus/serviceParts.h"

namespace sorma {

namespace {

const Prototype kWords{Severity::error, "STREAM SYNTAX", 1,
                       "{}: bad words after -stream: must be open BYTES {{EXEC word ...}}, next STREAM NUMBER, close STREAM, or list"};
const Prototype kMethod{Severity::error, "STREAM SYNTAX", 1, "{}: a stream is the answer of an EXEC, not of {}"};
const Prototype kNone{Severity::error, "STREAM GONE", 2,
                      "{}: this client has no stream {} here: it was closed, nobody has read it for long, its right was taken away, or the object was made anew"};
const Prototype kMany{Severity::error, "COMM LIMIT", 1, "{}: this client has {} streams open here, and may not have more; close one"};
const Prototype kFar{Severity::error, "COMM LIMIT", 1, "{}: piece {} is asked for, and piece {} is the next; at most {} may be asked for in advance"};
const Prototype kPast{Severity::error, "STREAM GONE", 1, "{}: piece {} was made already; the next is {}"};
const Prototype kTwice{Severity::error, "STREAM GONE", 1, "{}: piece {} is asked for already"};
const Prototype kIdle{Severity::error, "STREAM IDLE", 1, "{}: nobody has read the stream for {} s, so it has ended; sorma::configure -streamtime sets the time"};
const Prototype kClosed{Severity::error, "STREAM GONE", 1, "{}: the stream was closed"};
const Prototype kCode{Severity::error, "SERVICE FAILED", 1, "{}: EXEC returned code {}"};

constexpr std::size_t kOver = 1024;         // [bytes] what one that is over is charged with

std::uint64_t numberOf(const std::string& object, const std::string& word) {
    std::int64_t n = 0;
    if (!parseNumber(word, n) || n < 0) fail(kWords, object);
    return std::uint64_t(n);
}

}  // namespace

struct OpenPieces::One {
    std::uint64_t number = 0;
    std::unique_ptr<Pieces> pieces;
    Trail failure;                          // why, unless that was the end
    std::size_t most = 0;                   // [bytes] of a piece
    ClientPointer client;                   // null: this process
    Client::Lease lease = 0;
    std::string by;                         // the client, for people
    Message request;                        // its words and author: the rights to them are asked for at each piece
    std::uint64_t made = 0;                 // pieces so far
    std::map<std::uint64_t, PendingPointer> asked;      // pieces that are not there yet
    Charge charge;
    Timer timer;
    std::int64_t used = monotonicNow();
    bool making = false;                    // a piece, further down the stack
    bool over = false;                      // there will be no more
    bool turn = false, waits = false;       // a serial object makes its piece; will make it later
};

void OpenPieces::request(Args args, Message& m) {
    const std::string& verb = args[0];
    if (verb == "open" && args.size() == 3) return open(args, m);
    if (verb == "next" && args.size() == 3) return next(args, m);
    if (verb == "close" && args.size() == 2) {
        if (auto one = find(args[1], m)) erase(one->number, closed());
        return m.clear();
    }
    if (verb != "list" || args.size() != 1) fail(kWords, service_.name_);
    service_.need(m.author, Right::inspect);
    addLine(m, list());
}

std::string OpenPieces::list() const {
    std::string text;
    for (auto& [number, one] : all_) {
        text += (text.empty() ? "" : "\n") + std::to_string(number) + " of " + one->by + ": " + std::to_string(one->made) + " pieces";
        if (one->over) text += ", over";
        else if (!one->asked.empty()) text += ", the next is asked for";
    }
    return text;
}

// A neighbour passes requests of many authors on: none of them reads what another one has opened.
OpenPieces::Pointer OpenPieces::find(const std::string& number, const Message& m) const {
    const auto found = all_.find(numberOf(service_.name_, number));
    if (found == all_.end()) return nullptr;
    const One& one = *found->second;
    return one.client == CallContext::currentClient() && one.request.author == m.author ? found->second : nullptr;
}

// ---- from its beginning to its end ----

void OpenPieces::open(Args args, Message& m) {
    auto one = std::make_shared<One>();
    one->most = std::clamp(std::size_t(numberOf(service_.name_, args[1])), std::size_t(1024), Reading::kMostPiece);
    one->client = CallContext::currentClient();
    const auto open = std::count_if(all_.begin(), all_.end(), [&](auto& entry) { return entry.second->client == one->client; });
    if (std::size_t(open) >= kMostStreams) fail(kMany, service_.name_, std::int64_t(open));
    Message request;
    std::string text, name;
    Method method;
    appendWord(text, service_.name_);
    parseRequest(text + ' ' + args[2], name, method, request);
    if (method != Method::exec) fail(kMethod, service_.name_, toText(method));
    one->request.words = request.words;
    one->request.author = request.author = m.author;
    one->charge = Charge(service_.sorm_->budget.ofCaller(m.author), Account::Use::requests);
    one->charge.need(service_.name_, kStream + heapOf(one->request));
    one->by = CallContext::currentCallers();
    {
        // It has the context of its request, but no deadline.
        const auto outer = CallContext::keep();
        CallContext context(std::make_shared<KeptCall>(one->client, Deadline(), CallContext::currentRequest(), outer ? outer->behalf : std::string()));
        one->pieces = begin(std::move(request));
    }
    one->number = CallContext::newRequest();        // so a reader never meets a stream of a later object or daemon by its number
    one->pieces->wake_ = [this, weak = std::weak_ptr(one), box = service_.sorm_->mailbox()] {
        box->post([this, weak] {
            if (auto one = weak.lock()) serve(one);
        });
    };
    all_.emplace(one->number, one);
    if (one->client)
        one->lease = one->client->hold(service_.name_, [this, weak = std::weak_ptr(one)] {
            if (auto one = weak.lock()) clientLost(one);
        }, service_.class_->execRight());
    watchIdle(one);
    m.ints = {std::int64_t(one->number)};
}

std::unique_ptr<Pieces> OpenPieces::begin(Message request) {
    const PrincipalPointer author = request.author;
    service_.admitStream(request);
    if (service_.class_->checks() & Class::undeclared) service_.class_->checkNamed(service_.name_, request);
    if (auto pieces = service_.inPieces(request)) return service_.count(), std::move(pieces);
    request.author = author;
    if (service_.startHeld(Method::exec, request)) return piecesOf(std::exchange(request.later, nullptr));
    return piecesOf(std::move(request));
}

// May it go on? As for EXEC.
void Service::admitStream(Message& m) {
    const PrincipalPointer author = m.author;
    admit(Method::exec, m);
    if (guard() & kFencedBit) needFence(author);
    if (guard() & kPartsBit) needParts();
    if (guard() & kLockBits) checkLock();
}

// The writer is deleted at once, unless it is at work.
void OpenPieces::over(One& one, Trail why) {
    one.over = true;
    one.failure = std::move(why);
    if (one.making) return;
    one.pieces.reset();
    one.charge.force(kOver);
    giveTurn(one);
}

void OpenPieces::leave(One& one, const Trail& why) {
    one.timer.cancel();
    if (one.client) one.client->release(std::exchange(one.lease, 0));
    if (!one.over) over(one, why);
    for (auto& [piece, pending] : std::exchange(one.asked, {})) pending->answer(why);
}

void OpenPieces::erase(std::uint64_t number, const Trail& why) {
    const Pointer one = std::move(all_.at(number));
    all_.erase(number);
    leave(*one, why);
}

Trail OpenPieces::closed() const { return Trail(makeEntry(kClosed, {MessageArg::of(service_.name_)})); }

void OpenPieces::endAll(const Trail& why) {
    for (auto& [number, one] : std::exchange(all_, {})) leave(*one, why);
}

// It has ended, or it has lost the right.
void OpenPieces::clientLost(const Pointer& one) {
    one->lease = 0;
    Trail why = closed();
    try {
        if (!one->client->ended()) admit(*one);
    } catch (...) {
        why = trailOfCurrentException(service_.name_);
    }
    erase(one->number, why);
}

// Twice the time: first it ends, and then nothing of it is left. A writer may take as long as it likes.
void OpenPieces::watchIdle(const Pointer& one) {
    Sorm& sorm = *service_.sorm_;
    if (!sorm.hasLoop()) return;
    one->timer = sorm.loop().after(one->used + sorm.streamTime * 1'000'000'000, [this, weak = std::weak_ptr(one)] {
        auto one = weak.lock();
        if (!one) return;
        const std::int64_t now = monotonicNow(), time = service_.sorm_->streamTime;
        if (!one->over && (!one->asked.empty() || one->making)) one->used = now;
        if (now - one->used >= time * 1'000'000'000) {
            if (one->over) return erase(one->number, closed());
            over(*one, Trail(makeEntry(kIdle, {MessageArg::of(service_.name_), MessageArg::of(time)})));
            one->used = now;
        }
        watchIdle(one);
    });
}

// ---- pieces ----

void OpenPieces::admit(const One& one) {
    Message request;
    request.words = one.request.words;
    request.author = one.request.author;
    service_.admitStream(request);
}

// Like an EXEC, which waits until the object has answered others.
bool OpenPieces::takeTurn(const Pointer& one) {
    if (one->turn || service_.class_->concurrency() == Concurrency::concurrent) return true;
    auto& record = service_.record();
    if (!(service_.guard() & Service::kBusyBit)) {
        ++record.underWay;
        service_.setGuard(Service::kBusyBit, true);
        return one->turn = true;
    }
    if (!std::exchange(one->waits, true)) {
        record.waiting.push_back(nullptr);
        turns_.push_back(one);
    }
    return false;
}

void OpenPieces::nextTurn() {
    const auto one = turns_.front().lock();
    turns_.pop_front();
    if (!one) return;
    one->waits = false;
    serve(one);
}

// Those who wait begin when the piece is on its way.
void OpenPieces::giveTurn(One& one) {
    if (!std::exchange(one.turn, false)) return;
    if (service_.record().waiting.empty()) return service_.released();
    service_.sorm_->mailbox()->post([keep = Reference(&service_)] { keep->released(); });
}

bool OpenPieces::make(const Pointer& pointer, Message& piece) {
    One& one = *pointer;
    try {
        if (!one.over) {
            admit(one);
            if (one.pieces->works() && !takeTurn(pointer)) return false;
            const AtEnd made([&] {
                one.making = false;
                if (one.over) over(one, std::move(one.failure));
            });
            one.making = true;
            if (!one.pieces->next(piece, one.most) && !one.over) return false;
        }
        if (!one.failure.empty()) throw Error(one.failure);
        piece.words.clear();
        if (one.over) return piece.clear(), true;
        if (piece.code < 0) fail(kCode, service_.name_, piece.code);
        one.charge.need(service_.name_, kStream + heapOf(one.request) + one.pieces->heap());
        ++one.made;
        if (isEnd(piece)) over(one);
        else giveTurn(one);
        return true;
    } catch (...) {
        Trail trail = trailOfCurrentException(service_.name_);
        if (!one.over) over(one, std::move(trail));
        throw Error(one.failure.empty() ? trail : one.failure);
    }
}

void OpenPieces::next(Args args, Message& m) {
    const auto one = find(args[1], m);
    if (!one) fail(kNone, service_.name_, args[1]);
    const std::uint64_t number = numberOf(service_.name_, args[2]);
    one->used = monotonicNow();
    m.clear();
    if (!one->over) {
        if (number < one->made) fail(kPast, service_.name_, number, one->made);
        if (number - one->made >= Reading::kMostAhead) fail(kFar, service_.name_, number, one->made, Reading::kMostAhead);
    }
    if (one->over || (number == one->made && !one->making && !one->asked.contains(number))) {
        const AtEnd others([&] {            // that have come meanwhile
            if (!one->asked.empty()) serveLater(one);
        });
        if (make(one, m)) return;
        m.clear();
    }
    auto pending = std::make_shared<Pending>(*service_.sorm_, CallContext::currentDeadline(), nullptr, CallContext::keep());
    pending->who = service_.name_;
    pending->onCancel([weak = std::weak_ptr(one), number] {
        if (auto one = weak.lock()) one->asked.erase(number);
    });
    if (!one->asked.emplace(number, pending).second) fail(kTwice, service_.name_, number);
    m.later = std::move(pending);
}

void OpenPieces::serveLater(const Pointer& one) {
    service_.sorm_->mailbox()->post([this, weak = std::weak_ptr(one)] {
        if (auto one = weak.lock()) serve(one);
    });
}

void OpenPieces::serve(const Pointer& one) {
    const Reference keep(&service_);
    while (!one->making && !one->asked.empty()) {
        const auto [number, pending] = *one->asked.begin();
        if (number != one->made && !one->over) return;
        CallContext context(pending->own);
        Message piece;
        try {
            const BetweenTicks between(service_);
            if (!make(one, piece)) return;
            one->asked.erase(number);
            service_.review(piece);
            pending->message.swap(piece);
            pending->answer();
        } catch (...) {
            Trail trail = trailOfCurrentException(service_.name_);
            one->asked.erase(number);
            service_.noteFailure(trail);
            pending->answer(std::move(trail));
        }
        one->used = monotonicNow();
    }
}

}  // namespace sorma
