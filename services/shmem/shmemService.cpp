// shmem_w, shmem_r -- snapshot buffers as service objects (report 1.7.2): one writes, any number read, in any processes.
//
//     shmem_w.arm CTRL ...             the flavor names the segment, or -key does
//     shmem_w.arm EXEC FMSG 2 0.5 1    appends a record
//     shmem_r.arm EXEC                 the latest; words ask for more than that, see doc/snapshot.man
//
// Both may be steps of a cycle: EXEC of the writer, and of the reader without words, neither allocates nor locks, once it
// has been called. The reader's words are kept apart from that: the SORM's thread answers `next` while
// another thread may be stepping the object.
#include <algorithm>
#include <map>
#include <optional>

#include <sorma.h>

#include "follower.h"
#include "monitor.h"
#include "ring.h"

namespace {

using sorma::Message;
using sorma::Severity;
using shmem::Outcome;
using shmem::Reason;

const sorma::Prototype kKey{Severity::error, "SHMEM KEY", 1, "{}: key {}"};
const sorma::Prototype kAbsent{Severity::error, "SHMEM ABSENT", 1, "{}: {}"};
const sorma::Prototype kForeign{Severity::error, "SHMEM FOREIGN", 1, "{}: {}"};
const sorma::Prototype kTruncated{Severity::error, "SHMEM TRUNCATED", 1, "{}: {}"};
const sorma::Prototype kOlder{Severity::error, "SHMEM OLDER", 1, "{}: {}"};
const sorma::Prototype kNewer{Severity::error, "SHMEM NEWER", 1, "{}: {}"};
const sorma::Prototype kDenied{Severity::error, "SHMEM DENIED", 1, "{}: {}"};
const sorma::Prototype kFull{Severity::error, "SHMEM FULL", 1, "{}: {}"};
const sorma::Prototype kBusy{Severity::error, "SHMEM BUSY", 1, "{}: {}"};
const sorma::Prototype kSystem{Severity::error, "SHMEM SYSTEM", 1, "{}: {}"};

const sorma::Prototype kNoKey{Severity::error, "OPTION MISSING", 2,
                              "{}: {} is empty and the name has no flavor: one of them must name the segment"};
const sorma::Prototype kNothing{Severity::error, "OPTION MISSING", 2, "{}: {} 0 and -any 0: a record must have something"};
const sorma::Prototype kSize{Severity::error, "SHMEM SIZE", 2, "{}: {} must be {}, as {} says, not {}"};
const sorma::Prototype kWord{Severity::error, "SHMEM WORD", 2,
                             "{}: bad word \"{}\": must be history, latest, nearestTo, next, or since"};
const sorma::Prototype kUsage{Severity::error, "SHMEM SYNTAX", 1, "{}: wrong words: should be \"{}\""};
const sorma::Prototype kNumber{Severity::error, "SHMEM NUMBER", 2, "{}: \"{}\" must be {}"};
const sorma::Prototype kEmpty{Severity::error, "SHMEM EMPTY", 1, "{}: segment {} has no record yet"};
const sorma::Prototype kOverrun{Severity::error, "SHMEM OVERRUN", 1,
                                "{}: the newest record of segment {} was overwritten {} times in a row while it was read; use more -blocks"};
const sorma::Prototype kDamaged{Severity::error, "SHMEM DAMAGED", 1,
                                "{}: the record of segment {} is not what its checksum was made of: another program has written there; start its writer anew"};
const sorma::Prototype kTimeout{Severity::error, "SHMEM TIMEOUT", 4,
                                "{}: no new record of segment {} in {} s, the newest is number {}"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};

[[noreturn]] void raise(const sorma::Service& s, const shmem::Failure& f) {
    const std::string text = f.what();
    switch (f.reason) {
        case Reason::key: fail(kKey, s.name(), text);
        case Reason::absent: fail(kAbsent, s.name(), text);
        case Reason::foreign: fail(kForeign, s.name(), text);
        case Reason::truncated: fail(kTruncated, s.name(), text);
        case Reason::older: fail(kOlder, s.name(), text);
        case Reason::newer: fail(kNewer, s.name(), text);
        case Reason::denied: fail(kDenied, s.name(), text);
        case Reason::full: fail(kFull, s.name(), text);
        case Reason::busy: fail(kBusy, s.name(), text);
        case Reason::system: break;
    }
    fail(kSystem, s.name(), text);
}

// Common to both classes: the key, and requests about all segments.
class Snapshot : public sorma::Service {
protected:
    template <class S> static void describe(sorma::Class& c) {
        using Args = sorma::Args;
        c.named("-key", &S::key_, {.help = "name of the segment, for all who write and read it; empty: the flavor", .fixed = true})
            .concurrency(sorma::Concurrency::concurrent)
            .flavors(sorma::Flavors::any)
            .realtime()
            .action({"-list", "", "all segments of this machine: shape, writer, and whether anybody uses them", 0, 0,
                     [](sorma::Service&, Args, Message& m) { m.text += shmem::listText(); }, sorma::Right::inspect})
            .action({"-clean", "?key?", "remove segments that nobody uses, or the one of that key; returns their keys", 0, 1,
                     [](sorma::Service& s, Args args, Message& m) {
                         // They may be anybody's of this user.
                         s.sorm().access.need(m.author, sorma::Right::files, "/dev/shm/" + (args.empty() ? std::string("*") : args[0]), s.name());
                         try {
                             for (auto& key : shmem::Segment::clean(args.empty() ? std::string() : args[0]))
                                 m.text += (m.text.empty() ? "" : "\n") + key;
                         } catch (const shmem::Failure& f) {
                             raise(s, f);
                         }
                     }})
            .inspection({"-timing", "", "age of the newest record, rate and jitter of those in the buffer", 0, 0,
                         [](sorma::Service& s, Args, Message& m) { m.text += shmem::timingText(static_cast<S&>(s).look()); }});
    }

    using Key = sorma::Named<sorma::Kind::segment>;
    // The segment's name. A key that the flavor gives is chosen by whoever has made the object.
    Key segment() const {
        auto dot = name().find('.');
        return !key_.empty() || dot == std::string::npos ? key_ : Key(name().substr(dot + 1), maker());
    }
    // To open it. Fails with OPTION MISSING.
    std::string key() const {
        if (segment().empty()) fail(kNoKey, name(), "-key");
        return segment().use(*this);
    }
    std::string keyText() const { return segment().get(sorma::Permit::owner()); }

    Key key_;
};

// ---- shmem_w ----

class ShmemWriter final : public Snapshot {
public:
    static sorma::Class describe() {
        auto c = sorma::Class::of<ShmemWriter>("shmem_w", "writes records into a snapshot buffer in shared memory");
        Snapshot::describe<ShmemWriter>(c);
        c.integer("-blocks", &ShmemWriter::blocks_, {.unit = "records", .low = 2, .high = double(shmem::kMostBlocks),
                                                     .help = "records that the buffer holds", .fixed = true})
            .integer("-floats", &ShmemWriter::floats_, {.unit = "1", .low = 0, .high = double(shmem::kMostFloats),
                                                        .help = "floats of each record", .fixed = true})
            .integer("-any", &ShmemWriter::any_, {.unit = "bytes", .low = 0, .high = double(shmem::kMostAny),
                                                  .help = "bytes of any of each record", .fixed = true})
            .choice("-access", &ShmemWriter::access_, {"owner", "group", "all"}, {.help = "which users may read", .fixed = true})
            .flag("-keep", &ShmemWriter::keep_, {.help = "keep the segment when its last user has closed it"})
            .flag("-unchecked", &ShmemWriter::unchecked_,
                  {.help = "EXEC takes any size: what is too much is dropped, what is missing stays as it was in that block"})
            .flag("-checksum", &ShmemWriter::checksum_, {.help = "give each record a checksum; a reader refuses a record that another program has changed"})
            .reads(sorma::Field::floats, {}, "", "the record's floats, as many as -floats")
            .reads(sorma::Field::any, {}, "", "the record's bytes, as many as -any")
            .execDanger(sorma::Danger::move)
            .example("shmem_w.example EXEC FMSG 1 0.5");
        return c;
    }

    void born() override {
        (void)segment().permit(*this);
        if (!segment().empty()) open();
    }

    void changed(std::span<const sorma::Option* const>) override {
        if (!writer_) return;
        writer_->segment()->setKeep(keep_);
        writer_->checksums(checksum_);
    }

    void removing() override {
        writer_.reset();
        charge_.clear();
    }

    // The message stays as it came: a row of steps goes on with it.
    void exec(Message& m) override {
        if (!writer_) [[unlikely]] open();
        if (unchecked_) {
            writer_->write(m.floats.data(), std::min(m.floats.size(), std::size_t(floats_)) * sizeof(double), m.any.data(),
                           std::min(m.any.size(), std::size_t(any_)));
            return;
        }
        if (m.floats.size() != std::size_t(floats_) || m.any.size() != std::size_t(any_)) [[unlikely]] refuse(m);
        writer_->write(m.floats.data(), m.any.data());
    }

    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override {
        return {{"in", true, 0, std::size_t(floats_), "", "the record's floats"}};
    }

    std::string selftest() override {
        if (!writer_) return "ok: no segment yet, for want of a key";
        return "ok: segment " + keyText() + ", " + std::to_string(writer_->count()) + " records";
    }

    void dumpState(std::string& out) const override {
        if (writer_) shmem::appendDump(out, writer_->reader());
    }

    shmem::Reader look() {
        if (!writer_) open();
        return writer_->reader();
    }

private:
    friend class Snapshot;

    void open() {
        if (floats_ == 0 && any_ == 0) fail(kNothing, name(), "-floats");
        auto access = access_ == "owner" ? shmem::Access::owner : access_ == "group" ? shmem::Access::group : shmem::Access::all;
        std::string program = sorm().daemonName.empty() ? sorma::Caller::self().program : sorm().daemonName;
        const shmem::Shape shape{std::uint64_t(blocks_), std::uint64_t(floats_), std::uint64_t(any_)};
        sorma::Charge charge(sorm().budget.ofCaller(), sorma::Account::Use::segments);
        charge.need(name(), shmem::segmentBytes(shape));
        try {
            writer_.emplace(key(), shape, program, access, keep_);
            writer_->checksums(checksum_);
            charge_ = std::move(charge);
        } catch (const shmem::Failure& f) {
            raise(*this, f);
        }
    }

    [[noreturn]] void refuse(const Message& m) const {
        if (m.floats.size() != std::size_t(floats_)) fail(kSize, name(), "floats", floats_, "-floats", m.floats.size());
        fail(kSize, name(), "any", any_, "-any", m.any.size());
    }

    std::int64_t blocks_ = 16, floats_ = 1, any_ = 0;
    std::string access_ = "owner";
    bool keep_ = false, unchecked_ = false, checksum_ = false;
    sorma::Charge charge_;                  // on the account of the first caller that needed the segment
    std::optional<shmem::Writer> writer_;
};

// ---- shmem_r ----

class ShmemReader final : public Snapshot {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        auto c = sorma::Class::of<ShmemReader>("shmem_r", "reads records of a snapshot buffer in shared memory");
        Snapshot::describe<ShmemReader>(c);
        c.text("-owner", &ShmemReader::owner_,
               {.help = "another user whose segment may be read; trust that user, who can end this process by truncating the segment",
                .fixed = true});
        c.words("?latest | since ?counter? | nearestTo time ?wall? | history n | next ?timeout ?counter???")
            .writes(floats, {}, "", "the record's floats; of several records one after another, the oldest first")
            .writes(any, {}, "", "the record's bytes, likewise")
            .writes(ints, {}, "1, ns, us",
                    "counter, time by the monotonic clock [ns], by the wall clock [us] of each record; since: before them how "
                    "many were overwritten unread")
            .repeatable({"latest", "nearestTo", "history"})
            .example("shmem_r.example EXEC");
        return c;
    }

    ~ShmemReader() override { forget(); }

    void born() override {
        (void)segment().permit(*this);
        if (segment().empty()) return;
        try {
            attach();
        } catch (const sorma::Error& e) {
            if (e.is("SHMEM KEY")) throw;       // everything else may be otherwise when it is read
        }
    }

    void exec(Message& m) override {
        if (m.words.empty()) [[likely]] {
            if (!reader_ || reader_->retired()) [[unlikely]] attach();
            return latest(m);
        }
        // Not in each call, since it is slow: a user may have removed the segment's file.
        if (!reader_ || reader_->retired() || reader_->segment()->unlinked()) attach();
        const std::string word = m.words[0];
        if (word == "latest") take(m, 0, 0, "latest"), latest(m);
        else if (word == "since") since(m);
        else if (word == "nearestTo") nearestTo(m);
        else if (word == "history") history(m);
        else if (word == "next") next(m);
        else fail(kWord, name(), word);
    }

    void removing() override {
        forget();
        sorma::Error gone(sorma::makeEntry(kGone, {sorma::MessageArg::of(name())}));
        for (auto& [ticket, waiter] : std::exchange(waiters_, {})) waiter.reply.fail(gone);
        follower_.reset();
        followed_.reset();
        reader_.reset();
    }

    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override {
        std::size_t length = sorma::Pin::kOpen;
        try {
            length = reader_ && !reader_->retired() ? reader_->shape().floats : shmem::Reader(key(), owner_).shape().floats;
        } catch (const std::exception&) {       // there is no writer yet
        }
        return {{"out", false, 0, length, "", "the latest record's floats"}};
    }

    std::string selftest() override {
        if (segment().empty()) return "ok: no segment, for want of a key";
        try {
            return "ok: segment " + keyText() + ", " + std::to_string(look().count()) + " records";
        } catch (const sorma::Error& e) {
            if (!e.is("SHMEM ABSENT")) throw;
            return "ok: nobody writes segment " + keyText() + " yet";
        }
    }

    void dumpState(std::string& out) const override {
        if (reader_) shmem::appendDump(out, *reader_);
        out += "# waiting " + std::to_string(waiters_.size()) + "\n";
    }

    shmem::Reader look() {
        if (!reader_ || reader_->retired() || reader_->segment()->unlinked()) attach();
        return *reader_;
    }

private:
    friend class Snapshot;

    std::string owner_;

    struct Waiter {
        sorma::Reply reply;
        std::uint64_t after;                    // wants a record later than this
        std::int64_t until;                     // [ns] its own timeout
        double timeout;                         // [s] as given
    };
    struct Last {                               // how far a client has read by `since`
        std::uint64_t counter = 0;
        sorma::ClientPointer client;            // null: this process
        sorma::Client::Lease lease = 0;
    };

    void attach() {
        try {
            reader_.emplace(key(), owner_);
        } catch (const shmem::Failure& f) {
            raise(*this, f);
        }
    }

    // ---- words ----

    // The words after the first one: at least and at most so many.
    sorma::Args take(const Message& m, std::size_t least, std::size_t most, const char* usage) const {
        sorma::Args args = sorma::Args(m.words).subspan(1);
        if (args.size() < least || args.size() > most) fail(kUsage, name(), usage);
        return args;
    }

    template <class T> T number(const std::string& text, T low, T high, const char* what) const {
        T value{};
        if (!sorma::parseNumber(text, value) || !(value >= low && value <= high)) fail(kNumber, name(), text, what);
        return value;
    }
    std::uint64_t counter(const std::string& text) const {
        return std::uint64_t(number<std::int64_t>(text, 0, INT64_MAX, "the counter of a record, 0 or more"));
    }

    static void put(Message& m, const shmem::Stamp& s) {
        m.ints.push_back(std::int64_t(s.counter));
        m.ints.push_back(s.monotonic);
        m.ints.push_back(s.wall);
    }

    // Makes room for one record in m, and has `get(floats, any, stamp)` fill it.
    template <class Get> static Outcome fill(Message& m, const shmem::Reader& r, Get get) {
        m.text.clear();
        m.floats.resize(r.shape().floats);
        m.any.resize(r.shape().any);
        m.ints.clear();
        shmem::Stamp stamp;
        Outcome outcome = get(m.floats.data(), m.any.data(), stamp);
        if (outcome == Outcome::read) [[likely]] put(m, stamp);
        return outcome;
    }

    void check(Outcome outcome) const {
        if (outcome == Outcome::read) [[likely]] return;
        if (outcome == Outcome::empty) fail(kEmpty, name(), keyText());
        if (outcome == Outcome::damaged) fail(kDamaged, name(), keyText());
        fail(kOverrun, name(), keyText(), shmem::Reader::kTries);
    }

    void latest(Message& m) const {
        const shmem::Reader& r = *reader_;
        check(fill(m, r, [&](double* floats, void* any, shmem::Stamp& stamp) { return r.latest(floats, any, stamp); }));
    }

    void nearestTo(Message& m) const {
        auto args = take(m, 1, 2, "nearestTo time ?wall?");
        bool wall = args.size() == 2;
        if (wall && args[1] != "wall") fail(kUsage, name(), "nearestTo time ?wall?");
        auto time = number<std::int64_t>(args[0], INT64_MIN, INT64_MAX,
                                         "a whole number: [ns] of the monotonic clock, or with \"wall\" [us] since 1970");
        const shmem::Reader& r = *reader_;
        check(fill(m, r, [&](double* floats, void* any, shmem::Stamp& stamp) {
            return r.nearestTo(time, wall, floats, any, stamp);
        }));
    }

    // Appends records first .. last, as far as they are still there; returns how many.
    static std::uint64_t append(Message& m, const shmem::Reader& r, std::uint64_t first, std::uint64_t last) {
        std::uint64_t got = 0;
        for (std::uint64_t n = std::max(first, r.oldest(last)); n <= last; ++n) {
            std::size_t floats = m.floats.size(), any = m.any.size();
            m.floats.resize(floats + r.shape().floats);
            m.any.resize(any + r.shape().any);
            shmem::Stamp stamp;
            if (r.read(n, m.floats.data() + floats, m.any.data() + any, stamp)) {
                put(m, stamp);
                ++got;
            } else {
                m.floats.resize(floats);
                m.any.resize(any);
            }
        }
        return got;
    }

    void since(Message& m) {
        auto args = take(m, 0, 1, "since ?counter?");
        const shmem::Reader& r = *reader_;
        const std::uint64_t newest = r.count();
        std::uint64_t after = 0, promised = 0;      // records after `promised` that are not there any more count as overwritten
        Last* last = nullptr;
        if (!args.empty()) {
            promised = after = counter(args[0]);
            if (after > newest) fail(kNumber, name(), args[0], "the counter of a record that has been written");
        } else {
            last = &lastOf(sorma::CallContext::currentClient());
            after = last->counter > newest ? 0 : last->counter;     // the buffer has begun again
            promised = after > 0 ? after : r.oldest(newest) - 1;
        }
        m.clear();
        m.ints.push_back(0);
        std::uint64_t got = append(m, r, after + 1, newest);
        m.ints[0] = std::max<std::int64_t>(0, std::int64_t(newest - promised - got));
        if (last) last->counter = newest;
    }

    void history(Message& m) {
        auto args = take(m, 1, 1, "history n");
        const std::int64_t most = shmem::kMostBlocks;
        auto n = std::uint64_t(number<std::int64_t>(args[0], 1, most, "a number of records, 1 or more"));
        const shmem::Reader& r = *reader_;
        const std::uint64_t newest = r.count();
        m.clear();
        append(m, r, newest > n ? newest - n + 1 : 1, newest);
    }

    // ---- since: how far each client has read ----

    Last& lastOf(const sorma::ClientPointer& client) {
        auto [at, fresh] = lasts_.try_emplace(client.get());
        if (fresh && client) {
            at->second.client = client;
            at->second.lease = client->hold(this->name(), [this, who = client.get()] { lasts_.erase(who); });
        }
        return at->second;
    }

    void forget() {
        for (auto& [who, last] : std::exchange(lasts_, {}))
            if (last.client) last.client->release(last.lease);
    }

    // ---- next: those who wait, served by the SORM's thread. What is below is not touched by EXEC without words ----

    void next(Message& m) {
        auto args = take(m, 0, 2, "next ?timeout ?counter??");
        double timeout = args.empty() ? 0 : number<double>(args[0], 0, 1e9, "a time [s], 0 for none");
        const std::uint64_t newest = reader_->count();
        std::uint64_t after = args.size() < 2 ? newest : counter(args[1]);
        if (after > newest) after = 0;          // the buffer has begun again
        if (newest > after) return latest(m);
        if (!follower_) {
            follower_ = std::make_unique<shmem::Follower>(
                [box = sorm().mailbox(), weak = std::weak_ptr<ShmemReader*>(alive_)] {
                    box->post([weak] {
                        if (auto self = weak.lock()) (*self)->serve();
                    });
                });
        }
        followed_ = reader_;
        sorma::Reply reply = later(m);
        const std::uint64_t ticket = ++tickets_;
        const std::int64_t until = timeout > 0 ? shmem::nanoseconds() + std::int64_t(timeout * 1e9) : INT64_MAX;
        waiters_.emplace(ticket, Waiter{reply, after, until, timeout});
        reply.onCancel([this, ticket] {
            auto found = waiters_.find(ticket);
            if (found == waiters_.end()) return;
            found->second.reply.complete();
            waiters_.erase(found);
            follow();
        });
        follow();
    }

    // The follower has seen something: answer whom it concerns.
    void serve() {
        if (!follower_) return;                 // the object has left meanwhile
        bool followable = !followed_->retired() && !followed_->segment()->unlinked();
        if (!followable) {
            try {
                followed_.emplace(followed_->segment()->key());
                followable = true;
                for (auto& [ticket, waiter] : waiters_) waiter.after = 0;       // whatever is there is new
            } catch (const shmem::Failure&) {                                   // there is no writer now
            }
        }
        const shmem::Reader& r = *followed_;
        std::int64_t now = shmem::nanoseconds();
        for (auto at = waiters_.begin(); at != waiters_.end();) {
            auto& [reply, after, until, timeout] = at->second;
            bool done = false;
            if (followable && r.count() > after) {
                done = fill(reply.message(), r, [&](double* floats, void* any, shmem::Stamp& stamp) {
                           return r.latest(floats, any, stamp);
                       }) == Outcome::read;
                if (done) reply.message().words.clear(), reply.complete();
            }
            if (!done && now >= until) {
                using Arg = sorma::MessageArg;
                reply.fail(sorma::Error(sorma::makeEntry(kTimeout, {Arg::of(name()), Arg::of(r.segment()->key()), Arg::of(timeout),
                                                                    Arg::of(r.count())})));
                done = true;
            }
            at = done ? waiters_.erase(at) : std::next(at);
        }
        follow(followable);
    }

    // Have the follower look out for what comes first. At least each second: the name may have been removed by hand.
    void follow(bool followable = true) {
        if (waiters_.empty()) return follower_->rest();
        std::uint64_t after = UINT64_MAX;
        std::int64_t until = shmem::nanoseconds() + (followable ? 1'000'000'000 : 20'000'000);
        for (auto& [ticket, waiter] : waiters_) {
            after = std::min(after, waiter.after);
            until = std::min(until, waiter.until);
        }
        follower_->watch(followable ? followed_ : std::nullopt, after, until);
    }

    std::optional<shmem::Reader> reader_;       // of EXEC
    std::map<const sorma::Client*, Last> lasts_;
    std::optional<shmem::Reader> followed_;     // of those who wait
    std::map<std::uint64_t, Waiter> waiters_;
    std::uint64_t tickets_ = 0;
    std::unique_ptr<shmem::Follower> follower_;
    std::shared_ptr<ShmemReader*> alive_ = std::make_shared<ShmemReader*>(this);        // work in the mailbox asks
};

}  // namespace

extern "C" SORMA_EXPORT int Shmem_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::shmem", "1.0", {ShmemWriter::describe(), ShmemReader::describe()});
}
