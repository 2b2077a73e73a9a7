#include "comm/oneways.h"

#include <utility>

#include "bus/atEnd.h"
#include "bus/call.h"
#include "comm/errors.h"

namespace sorma {

namespace {

const Prototype kFull{Severity::error, "COMM LIMIT", 1,
    "{}: {} bytes of one-way requests wait for {} already, which does not read them; never sent; see sorma::configure -onewayqueue and -onewaywait"};
const Prototype kDropped{Severity::warning, "COMM LOST", 1, "{}: {} one-way requests were never sent: {}"};

}  // namespace

void Oneways::send(const std::string& name, Method method, const Message& m, const PrincipalPointer& relayFor, bool mayBlock) {
    CallContext* context = CallContext::current();
    const SpanPointer span = context && context->span ? context->span->leave(Span::Kind::oneway, link_.fullName(name), method) : nullptr;
    const AtEnd sent([&] {
        if (span) span->finish();
    });
    calls_.lookIfIdle(monotonicNow());
    try {
        if (!link_.live() && link_.boots() == 0) calls_.connect(Deadline::in(settings_.timeout));
    } catch (const Error& e) {
        return drop(1, e.what());
    }
    const std::size_t most = std::size_t(settings_.onewayQueue);
    if (backlog() > most) {
        if (mayBlock) makeRoom(most, Deadline::at(monotonicNow() + settings_.onewayWait * 1'000'000));
        if (backlog() > most) fail(kFull, link_.fullName(name), backlog(), link_.who());
    }
    Buffer bytes;
    wire::Behalf behalf = wire::behalfOf(relayFor, link_.epoch());
    behalf.trace = span ? span->origin() : TraceOrigin();
    wire::writeCall(bytes, 0, link_.program(), {wire::kNoSlot, 0, 0, method, name}, m, wire::kOneway,
                    relayFor || behalf.epoch != 0 || CallContext::current() ? &behalf : nullptr);
    calls_.proceed();
    if (!calls_.ready()) keep(bytes.data(), bytes.size());
    else if (!link_.append(kTag, bytes)) link_.send(std::move(bytes), kTag);     // those that wait are one piece of bytes
    if (!link_.live()) calls_.connectSoon();
    link_.watch();
}

void Oneways::resume() {
    if (!kept_.empty()) link_.send(std::exchange(kept_, {}), kTag);
}

void Oneways::makeRoom(std::size_t most, Deadline deadline) {
    link_.drainUntil(deadline, [&] { return backlog() <= most; });
    calls_.tellLater();
}

// Keep those whose last byte was not taken.
void Oneways::unsent(const Buffer& records, std::size_t taken) {
    const std::size_t at = record::wholeBefore(records, taken);
    keep(records.data() + at, records.size() - at);
}

void Oneways::keep(const char* records, std::size_t size) {
    if (kept_.empty()) since_ = monotonicNow();
    kept_.append(records, size);
}

void Oneways::drop(std::size_t count, const std::string& why) {
    dropped_ += count;
    why_ = why;
    if (whenDropped) whenDropped(errors::trailOf(kDropped, link_.who(), count, why));
}

void Oneways::dropKept(const std::string& why) {
    const std::size_t count = record::count(kept_);
    kept_.release();
    if (count > 0) drop(count, why);
}

void Oneways::failed(const Error& why, bool final) {
    const bool given = settings_.timeout > 0 && monotonicNow() - since_ > settings_.timeout * 1'000'000;
    if (waiting() && (given || final)) dropKept(why.what());
}

std::string Oneways::finish(Deadline deadline) {
    try {
        if (!link_.live() && waiting()) calls_.connect(deadline);
    } catch (const Error& e) {
        dropKept(e.what());
    }
    makeRoom(0, deadline);
    std::size_t left = record::count(kept_);
    link_.eachQueued([&](Link::Tag tag, const Buffer& bytes) { left += tag == kTag ? record::count(bytes) : 0; });
    if (left + dropped_ == 0) return {};
    return std::to_string(left + dropped_) + " one-way requests to " + link_.who() + " were never sent: " + (left > 0 ? "it does not read them" : why_);
}

}  // namespace sorma
