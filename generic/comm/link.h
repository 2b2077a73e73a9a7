// link.h -- the line from this process to one daemon: it connects, greets, carries records, and connects again.
//
//            begin               connected           upgraded, HELLO       WELCOME            upgraded
//     lost --------> connecting ---------> opening ---------> greeting ----------> joining ----------> live
//      ^                 |                    |                  |                    |                 |
//      |  refused,       |   closed, silent, not a daemon        |                    |   closed,       |
//      |  nobody there   |                    |                  |                    |   broken        |
//      +-----------------+--------------------+------------------+--------------------+-----------------+
//                        ^                                                                              |
//                        +-------------------- share(): again, and with an offer of memory -------------+
//
// In opening, memory is offered (comm/shm.cpp), or TLS begins (comm/tls.cpp); other lines pass it at once. None of our rows has anything to do
// in joining. The example tests/embed/sealed.cpp has.
// There is one way to connect. The reactor moves the machine with its events. A caller that blocks moves it with step(), until it
// has what it wants; step() waits in any state. After a failed attempt the next one waits for 2 ms, and twice
// as long each time, up to 100 ms. An attempt that gets no answer for 5 s ends, and another one begins.
//
// The link tells its user by the functions of Link::User. Bytes leave in the order in which they were queued.
//
// Threads: belongs to the thread of its SORM.
// Owner:   whoever owns the user. While a function of the link runs it holds what User::keep() returns.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "bus/deadline.h"
#include "bus/loop.h"
#include "bus/name.h"
#include "bus/trail.h"
#include "comm/apart.h"
#include "comm/reactor.h"
#include "comm/settings.h"
#include "comm/transport.h"
#include "comm/wire.h"

namespace sorma {

class Link : public Reactor::Watcher {
public:
    enum class State : std::uint8_t { lost, connecting, opening, greeting, joining, live };
    using Tag = std::uint32_t;
    static constexpr Tag kNoTag = UINT32_MAX;           // of bytes whose fate interests nobody
    // Why what was sent will get no reply.
    struct Verdict {
        std::string why, hint;          // "the daemon has ended"; what to do
        bool ended = true;              // it is known to have ended
    };
    // Functions may call the link, but step() only where it says so.
    class User {
    public:
        virtual std::shared_ptr<void> keep() = 0;       // what keeps the user and the link alive
        virtual Address locate() = 0;                   // where the daemon is now; for each attempt. May throw Error
        virtual std::string whom() const = 0;           // the name that error messages begin with
        virtual bool wanted() const = 0;                // is it to connect again by itself, and to be watched by the reactor?
        // It is live.   other: the daemon is not the one of the last time. It is true when there was no last time, too.
        virtual void welcomed(bool other) = 0;
        virtual void replied(XdrReader& r, std::uint32_t xid) = 0;     // a reply has come; not r.good(): it is none
        virtual void event(XdrReader& r) = 0;
        virtual void outdated() = 0;                    // what the daemon has said of objects may be wrong now: see bus/ahead.h
        virtual void traced(XdrReader& r) = 0;         // the event that comes next
        virtual void wrote(Tag tag) = 0;                // the line has taken the last byte
        // The line is gone with this still in the queue, of which it has taken so many bytes. bytes: empty when they were lent.
        virtual void unsent(Tag tag, Buffer& bytes, std::size_t taken) = 0;
        virtual void ended() = 0;                       // the line is gone: all in the queue was unsent
        virtual void unanswered(const Verdict& verdict) = 0;
        virtual void failed(const Error& why, bool final) = 0;      // to connect. final: trying again is of no use
        virtual void turned(bool blocking) = 0;         // an event is dealt with: of the reactor, or in step()

    protected:
        ~User() = default;
    };

    Link(User& user, std::string who, const Settings& settings, std::shared_ptr<Reactor> reactor);
    ~Link() override;
    Link(const Link&) = delete;
    Link& operator=(const Link&) = delete;

    State state() const { return state_; }
    bool live() const { return state_ == State::live; }
    // Can be read when something comes; -1: do not wait for it, something is there, or it is not live.
    int descriptor() const { return live() && !line_.brought(true) ? line_.descriptor() : -1; }

    // Connect, unless it does already. Never blocks but for the name of a host.
    void begin();
    // Block once, in whatever state it is: for an event of the line, or until another attempt has begun. Not beyond the deadline:
    // then false.   left: time to it [ns], when it is known.
    bool step(Deadline deadline) { return step(deadline, deadline.left()); }
    bool step(Deadline deadline, std::int64_t left);
    // Why the last attempt has failed, when it is of no use to try again; else null.
    const Error* hopeless() const { return failure_ && final_ ? &*failure_ : nullptr; }
    // The line broke. Takes what has come before, and connects again if it is wanted. reject: takes nothing, since what came
    // makes no sense.
    void lose(const std::string& how);
    void reject(const std::string& how);
    void close(const std::string& how);                 // without connecting again
    // A line that was quiet may have been closed by the other side, and TCP would still take our bytes. Look, so that "never
    // sent" is true. Only while no reply is awaited.
    void look();
    bool quiet(std::int64_t now) const { return now - lastHeard_ >= kQuiet; }

    // ---- writing; nothing of it blocks unless it says so ----

    // Write it now, or queue it. lent: the bytes must stay as they are until wrote() or unsent().
    void send(Tag tag, const Buffer& lent) { push({tag, {}, &lent}); }
    void send(Buffer bytes, Tag tag = kNoTag) { push({tag, std::move(bytes), nullptr}); }
    bool append(Tag tag, const Buffer& bytes);          // to the last of the queue if it has this tag; false: it has not
    bool forget(Tag tag);                               // take it out of the queue; false: the line has a part of it
    bool begun(Tag tag) const { return !queue_.empty() && queue_.front().tag == tag && (written_ > 0 || line_.row().wants); }
    bool queued() const { return !queue_.empty(); }
    std::size_t backlog() const;                        // [bytes] in the queue, those that are lent not counted
    template <class Each> void eachQueued(Each each) const {
        for (auto& item : queue_) each(item.tag, item.bytes);
    }
    void watch();                                       // have the reactor call, when it is wanted

    // Write all of it, blocking, past the queue, which must be empty. False: the line is lost. taken: counts what it took.
    bool write(const char* data, std::size_t size, Deadline deadline, std::size_t* taken = nullptr);
    // The same with numbers that are lent to the record.
    bool write(const Buffer& record, const record::Lent& lent, Deadline deadline, std::size_t& taken) {
        return lent.data ? writeLong(record, lent, deadline, taken) : write(record.data(), record.size(), deadline, &taken);
    }
    // Write the queue, blocking, until enough() is true.
    template <class Enough> void drainUntil(Deadline deadline, Enough enough) {
        while (live() && !enough()) {
            drain();
            if (live() && !enough() && !waitToWrite(deadline)) return;
        }
    }
    bool drainAll(Deadline deadline);                   // false: the line is lost

    // ---- the daemon, as it said of itself ----

    const wire::Welcome& daemon() const { return daemon_; }     // who answered last; boot 0: nobody yet
    std::uint64_t boots() const { return boots_; }              // daemons seen so far
    std::uint32_t program() const { return program_; }
    bool otherClock() const { return otherClock_; }             // than ours
    const std::string& address() const { return address_; }     // where it was last reached
    std::string how() const { return how_.empty() && failure_ ? failure_->what() : how_; }     // why it was lost, or never there
    std::uint64_t losses() const { return losses_; }
    std::int64_t since() const { return since_; }               // [ns] when it became live
    std::string age() const;
    const std::string& who() const { return who_; }             // its name in messages, what stands after @
    // The epoch of the name, as the directory has told it; 0: it has not.
    std::int64_t epoch() const { return *epoch_; }
    void follow(std::shared_ptr<const std::int64_t> epoch) { epoch_ = std::move(epoch); }
    std::string fullName(std::string_view object) const { return std::string(object) + "@" + who_; }
    Error unconnected(const std::string& whom) const;   // why there is no connection yet, when the deadline comes
    bool inEvents() const { return inEvents_; }         // is the reactor's turn for this link on the stack?

    Trail remarks;                      // warnings about the line, for who comes next
    std::int64_t callTime = 0;          // [ns] when the blocking call under way was made: saves reading the clock; 0: there is none

    bool brought(bool sleep) override { return line_.brought(sleep); }
    void rest() override { line_.rest(); }
    // Connect again, by memory. Nothing may be under way. Where that cannot be, by the socket; then mayShare() is false from now on.
    bool mayShare() const;
    void share();
    std::string_view transport() const { return line_.row().name; }    // of its line; empty: there is none

private:
    struct Item {
        Tag tag;
        Buffer bytes;
        const Buffer* lent;
        const Buffer& all() const { return lent ? *lent : bytes; }
    };
    static constexpr std::int64_t kQuiet = 1'000'000;   // [ns]
    void ready(std::uint32_t events) override;
    void start();
    void push(Item item);
    void drain();
    bool waitToWrite(Deadline deadline);
    void unwatch();
    bool receive(std::int64_t wait);    // false: nothing has come
    ssize_t read(std::int64_t wait);
    ssize_t readApart(std::int64_t wait);
    bool writeLong(const Buffer& record, const record::Lent& lent, Deadline deadline, std::size_t& taken);
    bool takeRecords();
    void takeLong(std::string_view record);
    void take(XdrReader r);
    // The attempt.
    void advance();
    void sayHello();
    bool readWelcome();
    void welcome();
    bool upgrade(Transport::Stage stage);
    void fail(const Error& e);
    std::string whyBroken(int error);
    void disconnect();
    void retry();
    bool absent(const Error& e) const;
    bool mayCome(const Error& e) const;
    void conclude(const Error& e);

    User& user_;
    const std::string who_;
    const Settings& settings_;
    std::shared_ptr<Reactor> reactor_;
    State state_ = State::lost;
    Line line_;
    Buffer in_;                         // bytes that have come
    std::size_t inAt_ = 0;              // of in_: what has been handled
    record::Apart apart_;               // numbers of the record with which in_ begins
    std::deque<Item> queue_;
    std::size_t written_ = 0;           // of the first one: bytes that the line has taken
    bool watched_ = false;
    std::uint32_t interest_ = 0;
    // The attempt, and the one after it.
    Deadline until_;                    // then it is given up
    Timer timer_;                       // lost: begins the next one; else ends this one
    std::int64_t pause_ = 0, retryAt_ = 0;      // [ns] before the next attempt, and when it is due
    std::optional<Error> failure_;      // of the last attempt
    bool final_ = false;                // failure_ is
    bool inEvents_ = false;
    bool hungUp_ = false;               // the last attempt was accepted, then closed before the welcome
    bool shares_ = false;               // the present attempt, or line, is by memory
    bool declined_ = false;             // the daemon does not take it
    bool wait_ = false;                 // the address says -wait: the daemon may come later
    std::int64_t absentSince_ = 0;      // [ns] nothing has listened there since; 0: something does, or did a moment ago
    std::string address_, how_;
    std::string lastWords_;             // reason of a GOODBYE
    std::string unread_;                // beginning of what came and is no record, for the error message
    std::uint64_t client_;
    std::shared_ptr<const std::int64_t> epoch_ = std::make_shared<std::int64_t>(0);
    wire::Welcome daemon_, offered_;    // offered_: by the WELCOME of the attempt
    std::uint64_t boots_ = 0, losses_ = 0;
    std::uint32_t program_ = wire::kProgram;
    bool otherClock_ = false;
    std::int64_t since_ = 0, lastHeard_ = 0;    // [ns]
};

}  // namespace sorma
