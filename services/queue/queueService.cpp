// queue -- messages in the order in which they came, each for one taker, and none lost when a taker dies.
//
// An item that get returns is on loan until the client acknowledges it; then it is removed. When the client returns it, or its
// process ends before, it goes back to its old place, before all that came after it. A taker may lose an answer
// (COMM TIMEOUT, a cancelled call that was answered nevertheless). `loans` also lists the item that he has got with it.
//
//     jobs EXEC put TMSG weld         -> ints {17}            waits while the queue is full
//     jobs EXEC get                   -> TMSG weld IMSG 17    waits while it is empty
//     jobs EXEC ack 17
#include <charconv>
#include <map>

#include <sorma.h>

#include "bus/kept.h"
#include "bus/statistics.h"

namespace {

using sorma::ClientPointer;
using sorma::Message;
using sorma::Reply;
using sorma::Severity;
using Id = std::int64_t;

const sorma::Prototype kWord{Severity::error, "QUEUE WORD", 2, "{}: bad word \"{}\": must be ack, get, loans, put, or return"};
const sorma::Prototype kUsage{Severity::error, "QUEUE SYNTAX", 1, "{}: wrong words: should be \"{}\""};
const sorma::Prototype kNumber{Severity::error, "QUEUE NUMBER", 2,
                               "{}: \"{}\" is not the number of an item; get returns it as the first of its ints"};
const sorma::Prototype kFull{Severity::error, "QUEUE FULL", 1,
                             "{}: full: {} items waiting and {} on loan, -max {}; without \"now\" put waits for room"};
const sorma::Prototype kEmpty{Severity::error, "QUEUE EMPTY", 1, "{}: no item; without \"now\" get waits for one"};
const sorma::Prototype kUnknown{Severity::error, "QUEUE UNKNOWN", 2,
                                "{}: item {} is not on loan to this client; it has been acknowledged or returned, or was never taken"};
const sorma::Prototype kEnded{Severity::error, "COMM CANCELLED", 1, "{}: the client that asked has ended"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};

class Queue : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Queue>("queue", "hands messages on, each to one taker who acknowledges it")
            .integer("-max", &Queue::max_, {.unit = "items", .low = 1, .high = 1e9,
                                            .help = "items that it keeps at most, those on loan included: they may come back"})
            .concurrency(sorma::Concurrency::concurrent)
            .words("put ?now? | get ?now? | ack id | return id | loans")
            .reads(text, {}, "", "put: the item, all four parts").reads(floats, {}, "", "").reads(ints, {}, "", "").reads(any, {}, "", "")
            .writes(text, {}, "", "get: the item as it was put").writes(floats, {}, "", "")
            .writes(ints, {}, "", "put: the item's number; get: its number, then the item's ints; loans: numbers, what this client has on loan")
            .writes(any, {}, "", "")
            .repeatable({"loans"})
            .example("queue EXEC put TMSG job");
    }

    ~Queue() override { releaseLoans(); }

    void exec(Message& m) override {
        std::string word = m.words.empty() ? std::string() : m.words[0];
        if (word == "put") put(m);
        else if (word == "get") get(m);
        else if (word == "ack") ack(m);
        else if (word == "return") giveBack(m);
        else if (word == "loans") loans(m);
        else fail(kWord, name(), word);
    }

    void changed(std::span<const sorma::Option* const>) override { serveWaiting(); }

    void removing() override {
        releaseLoans();
        sorma::Error gone(sorma::makeEntry(kGone, {sorma::MessageArg::of(name())}));
        for (auto& [ticket, reply] : std::exchange(getters_, {})) reply.fail(gone);
        for (auto& [ticket, reply] : std::exchange(putters_, {})) reply.fail(gone);
    }

    void dumpState(std::string& out) const override {
        auto line = [&](const char* what, std::size_t n) { out += std::string("# ") + what + " " + std::to_string(n) + "\n"; };
        line("waiting", items_.size());
        line("loans", loans_.size());
        line("getters", getters_.size());
        line("putters", putters_.size());
        line("acknowledged", acknowledged_);
        int shown = 0;
        for (auto& [id, loan] : loans_) {
            if (++shown > 10) break;
            out += "# loan " + std::to_string(id) + " to " + whoIs(loan.client) + " since " + sorma::clockText(loan.since) + "\n";
        }
    }

private:
    struct Item {
        std::string text;
        std::vector<double> floats;
        std::vector<std::int64_t> ints;
        std::vector<unsigned char> any;
        std::size_t heap() const { return sorma::heapOf(text) + sorma::heapOf(floats) + sorma::heapOf(ints) + sorma::heapOf(any); }
    };
    using KeptItem = sorma::Charged<Item>;              // on the account of who has put it
    struct Loan {
        KeptItem item;
        ClientPointer client;               // null: this process, which gives back nothing when it ends
        sorma::Client::Lease lease = 0;
        std::uint64_t number = 0;           // of the loan: the same item may be lent again
        std::int64_t since = 0;
    };
    using Line = std::map<std::uint64_t, Reply>;        // requests that wait, by ticket, served in order

    static const std::string whoIs(const ClientPointer& client) {
        return (client ? client->caller : sorma::Caller::self()).toText();
    }

    // ---- words ----

    bool isNow(const Message& m, const char* usage) const {
        if (m.words.size() > 2 || (m.words.size() == 2 && m.words[1] != "now")) fail(kUsage, name(), usage);
        return m.words.size() == 2;
    }

    void put(Message& m) {
        bool now = isNow(m, "put ?now?");
        if (full() || !putters_.empty()) {
            if (now) fail(kFull, name(), items_.size(), loans_.size(), max_);
            return standIn(putters_, m);
        }
        accept(m, sorm().budget.ofCaller());
        serveWaiting();
    }

    void get(Message& m) {
        bool now = isNow(m, "get ?now?");
        if (items_.empty()) {
            if (now) fail(kEmpty, name());
            return standIn(getters_, m);
        }
        const ClientPointer client = sorma::CallContext::currentClient();
        if (client && client->ended()) fail(kEnded, name());
        lend(client, m);
    }

    void ack(Message& m) {
        auto found = mine(m, "ack id");
        auto [id, client, lease] = std::tuple(found->first, found->second.client, found->second.lease);
        loans_.erase(found);
        if (client) client->release(lease);
        ++acknowledged_;
        m.clear();
        tell("ack", id);
        serveWaiting();
    }

    void giveBack(Message& m) {
        auto found = mine(m, "return id");
        m.clear();
        takeBack(found);
        serveWaiting();
    }

    void loans(Message& m) {
        if (m.words.size() > 1) fail(kUsage, name(), "loans");
        const ClientPointer client = sorma::CallContext::currentClient();
        m.clear();
        for (auto& [id, loan] : loans_)
            if (loan.client == client) m.ints.push_back(id);
    }

    // ---- what moves ----

    bool full() const { return items_.size() + loans_.size() >= std::size_t(max_); }

    // The item of a put becomes the last one; its number is the answer. Fails with COMM LIMIT.
    void accept(Message& m, sorma::AccountPointer account) {
        KeptItem item(name(), std::move(account), sorma::Account::Use::values,
                      {std::move(m.text), std::move(m.floats), std::move(m.ints), std::move(m.any)});
        Id id = ++last_;
        items_.emplace(id, std::move(item));
        m.clear();
        m.ints.push_back(id);
        tell("put", id);
    }

    // The oldest item is lent to a client that has not ended, and is what m answers. The lease comes before the answer:
    // when that reaches nobody any more, the item comes back.
    std::map<Id, Loan>::iterator lend(const ClientPointer& client, Message& m) {
        auto node = items_.extract(items_.begin());
        Id id = node.key();
        auto at = loans_.emplace(id, Loan{std::move(node.mapped()), client, 0, ++numbers_, sorma::wallNow()}).first;
        Loan& loan = at->second;
        if (client) loan.lease = client->hold(name(), [this, client = client.get()] { lost(client); });
        m.clear();
        const Item& item = *loan.item;
        m.text = item.text;
        m.floats = item.floats;
        m.ints.reserve(1 + item.ints.size());
        m.ints.push_back(id);
        m.ints.insert(m.ints.end(), item.ints.begin(), item.ints.end());
        m.any = item.any;
        tell("get", id);
        return at;
    }

    // An item that was lent waits again, at its old place: numbers are the order.
    std::map<Id, Loan>::iterator takeBack(std::map<Id, Loan>::iterator at) {
        auto [id, client, lease] = std::tuple(at->first, at->second.client, at->second.lease);
        items_.emplace(id, std::move(at->second.item));
        auto next = loans_.erase(at);
        if (client) client->release(lease);
        tell("return", id);
        return next;
    }

    // A client has ended: all that it had comes back before the first of it is lent again, so that the order holds.
    void lost(const sorma::Client* client) {
        for (auto at = loans_.begin(); at != loans_.end();) {
            if (at->second.client.get() == client) at = takeBack(at);
            else ++at;
        }
        serveWaiting();
    }

    // Serve those who wait, as far as room and items go. Answers are only posted here: nothing calls back.
    void serveWaiting() {
        while (!putters_.empty() && !full())
            if (Reply reply = first(putters_)) {
                try {
                    auto& client = reply.client();
                    accept(reply.message(), client ? sorm().budget.of(client->principal) : nullptr);
                    reply.complete();
                } catch (const sorma::Error& e) {
                    reply.fail(e);
                }
            }
        while (!getters_.empty() && !items_.empty())
            if (Reply reply = first(getters_)) {
                auto loan = lend(reply.client(), reply.message());
                // Until the answer is delivered the caller may still cancel: then it never had the item.
                reply.onCancel([this, id = loan->first, number = loan->second.number] {
                    auto found = loans_.find(id);
                    if (found == loans_.end() || found->second.number != number) return;
                    takeBack(found);
                    serveWaiting();
                });
                reply.complete();
            }
    }

    // ---- who waits ----

    void standIn(Line& line, Message& m) {
        Reply reply = later(m);
        std::uint64_t ticket = ++tickets_;
        line.emplace(ticket, reply);
        reply.onCancel([&line, ticket] {
            auto found = line.find(ticket);
            if (found == line.end()) return;
            found->second.complete();
            line.erase(found);
        });
    }

    // The next one; null when that client has ended.
    Reply first(Line& line) {
        Reply reply = std::move(line.begin()->second);
        line.erase(line.begin());
        auto& client = reply.client();
        if (!client || !client->ended()) return reply;
        reply.fail(sorma::Error(sorma::makeEntry(kEnded, {sorma::MessageArg::of(name())})));
        return {};
    }

    // The loan that a request names, when it is this client's.
    std::map<Id, Loan>::iterator mine(const Message& m, const char* usage) {
        if (m.words.size() != 2) fail(kUsage, name(), usage);
        auto& given = m.words[1];
        Id id = 0;
        auto [end, error] = std::from_chars(given.data(), given.data() + given.size(), id);
        if (error != std::errc() || end != given.data() + given.size()) fail(kNumber, name(), given);
        auto found = loans_.find(id);
        if (found == loans_.end() || found->second.client != sorma::CallContext::currentClient()) fail(kUnknown, name(), id);
        return found;
    }

    // Clients need not look after loans of a removed object.
    void releaseLoans() {
        for (auto& [id, loan] : std::exchange(loans_, {}))
            if (loan.client) loan.client->release(loan.lease);
    }

    void tell(const char* event, Id id) {
        event_.ints.assign(1, id);
        publish(event, event_);
    }

    std::int64_t max_ = 1000;
    std::map<Id, KeptItem> items_;          // waiting; the first is the next
    std::map<Id, Loan> loans_;              // an item is in one of the two
    // Items and getters never wait at the same time, nor do putters and room (serveWaiting).
    Line getters_, putters_;
    Id last_ = 0;
    std::uint64_t tickets_ = 0, numbers_ = 0, acknowledged_ = 0;
    Message event_;                         // used again and again
};

}  // namespace

extern "C" SORMA_EXPORT int Queue_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::queue", "1.0", {Queue::describe()});
}
