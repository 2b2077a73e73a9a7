#include "bus/bookkeeping.h"

#include "bus/serviceParts.h"

namespace sorma {

// The book of an object; null: it is none of this process.
struct Bookkeeping {
    static Service::Record* of(const Passage& p) { return p.service && !p.service->isElsewhere() ? &p.service->record() : nullptr; }
    static void add(Figures& sum, const Service& service) {
        sum.execs += service.calls();
        const Service::Record* book = service.record_.get();
        if (!book) return;
        sum.ctrls += book->ctrls, sum.dbxs += book->dbxs, sum.errors += book->errors;
        sum.times.add(book->times);
    }
    static void found(Service& s, std::size_t option, const Value& value, bool settling) {
        auto& r = s.record();
        auto is = [&](auto& undo) { return undo.option == int(option); };
        auto change = r.undo.end();         // the last of this option
        for (auto at = r.undo.begin(); settling && at != r.undo.end(); ++at)
            if (std::any_of(at->begin(), at->end(), is)) change = at;
        auto before = change == r.undo.end() ? Before() : std::find_if(change->begin(), change->end(), is);
        if (change != r.undo.end() && before->value == value) {
            r.sources[option] = std::move(before->source);
            std::erase_if(*change, is);
            if (change->empty()) r.undo.erase(change);
        } else {
            // The author stays: the object uses what it names with his rights.
            r.sources[option].edit([&](auto& source) {
                source = {Service::Record::Source::Kind::found, {}, source.author, {}, {}, wallNow(), heapOf(value)};
            });
        }
        if (settling) s.remember({&s.type().options()[option]});
    }
    using Audit = Service::Record::Audit;
    using Before = std::vector<Service::Record::Undo>::iterator;
};

namespace {

class Statistics : public Observer {
public:
    Statistics() : Observer(ctrl | dbx | sample) {}

    void came(const Passage& p, const Message&) override {
        auto* book = Bookkeeping::of(p);
        if (book && p.method == Method::ctrl) ++book->ctrls;
        if (book && p.method == Method::dbx) ++book->dbxs;
    }
    void answered(const Passage& p, const Message& reply, std::int64_t ran) override {
        if (p.method != Method::exec || reply.code < 0) return;
        if (auto* book = Bookkeeping::of(p)) book->times.add(ran);
    }
};

class Audit : public Observer {
public:
    explicit Audit(Sorm& sorm) : Observer(ctrl), sorm_(sorm) {}

    void came(const Passage& p, const Message& m) override {
        auto* book = Bookkeeping::of(p);
        if (!book) return;
        if (book->audit.size() == kLength) book->audit.pop_front();
        auto account = sorm_.budget.ofCaller(m.author);
        const bool room = !account || account->fits(2 * kKeptText);
        book->audit.push_back(Charged<Entry>::forced(
            std::move(account), Account::Use::records,
            {p.number, wallNow(), cutText(p.callers(), kKeptName), cutText(joinWords(sorm_.masked(m.words)), room ? kKeptText : 64), Entry::underWay}));
    }
    void answered(const Passage& p, const Message& reply, std::int64_t) override {
        auto* book = Bookkeeping::of(p);
        if (!book) return;
        for (auto entry = book->audit.rbegin(); entry != book->audit.rend(); ++entry)
            if ((*entry)->number == p.number) return void((*entry)->state = reply.code < 0 ? Entry::refused : Entry::done);
    }

private:
    using Entry = Bookkeeping::Audit;
    static constexpr std::size_t kLength = 100;
    Sorm& sorm_;
};

}  // namespace

void addFigures(Figures& sum, const Service& service) { Bookkeeping::add(sum, service); }

void noteFound(Service& service, std::size_t option, const Value& value, bool settling) { Bookkeeping::found(service, option, value, settling); }

std::unique_ptr<Observer> makeStatistics() { return std::make_unique<Statistics>(); }
std::unique_ptr<Observer> makeAudit(Sorm& sorm) { return std::make_unique<Audit>(sorm); }

}  // namespace sorma
