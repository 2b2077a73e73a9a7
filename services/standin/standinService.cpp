// standin -- answers from a recording of the bus, in place of the object that was recorded.
//
//     standin.psu -file run.rec -object psu.lab       a line of the dictionary; psu.lab leads to it, too
#include <sorma.h>

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <bus/nearest.h>
#include <recording/reader.h>

namespace {

namespace rec = sorma::recording;
using sorma::Message;
using sorma::Method;
using sorma::Severity;

const sorma::Prototype kFile{Severity::error, "STANDIN FILE", 1, "{}: {}"};
const sorma::Prototype kNone{Severity::error, "STANDIN EMPTY", 2, "{}: {} has no answer of {}{}"};
const sorma::Prototype kMissing{Severity::error, "OPTION MISSING", 2, "{}: {} is empty: say which recording it answers from, and for which object"};
const sorma::Prototype kUnknown{Severity::error, "STANDIN UNKNOWN", 2, "{}: \"{}\" was never recorded; the nearest that was is \"{}\""};
const sorma::Prototype kLarge{Severity::error, "STANDIN LARGE", 2, "{}: the answers of {} in the recording are more than {} bytes; -most allows more"};

// How many characters are other ones. Long texts are compared by their beginnings.
std::size_t distance(std::string_view a, std::string_view b) {
    constexpr std::size_t kMost = 200;
    a = a.substr(0, kMost), b = b.substr(0, kMost);
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j < row.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t corner = row[0]++;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t above = row[j];
            row[j] = std::min({above + 1, row[j - 1] + 1, corner + (a[i - 1] != b[j - 1])});
            corner = above;
        }
    }
    return row.back();
}

std::string textOf(Method method, const Message& m) {
    std::string text;
    sorma::appendRequest(text, "x", method, m);
    return text.substr(2);
}

class Standin : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Standin>("standin", "answers from a recording in place of the object that was recorded")
            .named("-file", &Standin::file_, {.help = "the recording, of sorma-record or class recorder"})
            .text("-object", &Standin::object_, {.help = "name of the object that it stands for, as in the recording; NAME@SOURCE when several daemons were recorded"})
            .flag("-inPlace", &Standin::inPlace_, {.help = "the name of that object leads here, too", .fixed = true})
            .integer("-most", &Standin::most_, {.unit = "byte", .low = 0, .high = 1e12, .help = "of all answers, which are in memory"})
            .action("-restart", &Standin::restart, "", "answer from the beginning of the recording")
            .concurrency(sorma::Concurrency::concurrent)
            .words("?word ...?")
            .reads(text, {}, "", "as the object").reads(floats, {}, "", "").reads(ints, {}, "", "").reads(any, {}, "", "")
            .writes(text, {}, "", "as the object").writes(floats, {}, "", "").writes(ints, {}, "", "").writes(any, {}, "", "")
            .example("standin.psu CTRL -file run.rec -object psu.lab");
    }

    // The name can lead here as soon as this object is in the repository, which is after born().
    void born() override {
        if (!inPlace_ || object_.empty()) return;
        sorm().mailbox()->post([this, weak = std::weak_ptr<Standin*>(alive_)] {
            if (weak.lock()) takePlace();
        });
    }
    void changed(std::span<const sorma::Option* const>) override {
        answers_.clear();
        known_.clear();
        loaded_ = false;
        at_ = 0;
    }

    void exec(Message& m) override { answer(Method::exec, m); }
    void ctrl(Message& m) override {
        const bool own = m.words.empty() || type().takes(Method::ctrl, m.words[0]);
        if (own && !has(Method::ctrl, m)) return Service::ctrl(m);
        need(m.author, sorma::Right::configure);
        answer(Method::ctrl, m);
    }
    void dbx(Message& m) override {
        const std::string word = m.words.empty() ? std::string() : m.words[0];
        const bool always = word == "-info" || word == "-stream";
        const bool own = word == "-get" ? m.words.size() > 1 && type().findOption(m.words[1]) >= 0 : m.words.empty() || type().takes(Method::dbx, word);
        if (always || (own && !has(Method::dbx, m))) {
            const bool tellsFacts = m.words.size() == 2 && m.words[0] == "-info" && m.words[1] == "secrets";
            Service::dbx(m);
            // Callers must not check words by the table of this class (bus/ahead.h): it does not have those of the recording.
            if (tellsFacts) m.ints.clear();
            return;
        }
        need(m.author, sorma::Right::inspect);
        answer(Method::dbx, m);
    }
    std::string selftest() override {
        needTold();
        load();
        return "ok: " + std::to_string(answers_.size()) + " answers of " + object_ + (why_.empty() ? "" : "; its name does not lead here: " + why_);
    }
    void dumpState(std::string& out) const override {
        out += "# answers " + std::to_string(answers_.size()) + "\n# at " + std::to_string(at_) + "\n";
        if (!why_.empty()) out += "# notInPlace " + why_ + "\n";
    }

private:
    void takePlace() {
        try {
            sorm().alias(object_.substr(0, object_.find('@')), name(), author("-object"));
        } catch (const sorma::Error& e) {
            why_ = e.what();
            sorm().announce(e.trail);
        }
    }
    void restart(sorma::Args, Message&) { at_ = 0; }

    // The author of -file or -object reads the recording by it. So he needs the right to inspect that object, by its name
    // of then: the name leads here now. sorm and dict may tell of any object.
    sorma::PrincipalPointer chooser() const { return sorma::Principal::both(author("-file"), author("-object")); }
    bool mayTell(const std::string& object) const {
        const auto by = chooser();
        return !by || (object != "sorm" && object != "dict" && sorm().access.rights(by, object) & sorma::Rights(sorma::Right::inspect));
    }
    std::string wanted() const { return object_.substr(0, object_.find('@')); }
    void needTold() {
        if (!mayTell(wanted())) sorm().access.refuse(chooser(), sorma::Right::inspect, wanted(), name());
    }

    // A recording that cannot be read has none. So the words of this class serve to choose another one.
    bool has(Method method, const Message& m) {
        if (!loaded_ && (file_.empty() || object_.empty())) return false;
        if (!mayTell(wanted())) return false;
        try {
            load();
        } catch (const sorma::Error&) {
            return false;
        }
        return known_.contains(textOf(method, m));
    }

    // The answer to the next request of that text; behind the last one, to the first.
    void answer(Method method, Message& m) {
        needTold();
        load();
        const std::string asked = textOf(method, m);
        auto found = known_.find(asked);
        if (found == known_.end()) fail(kUnknown, name(), sorma::cutText(asked), nearestTo(asked));
        const auto& places = found->second;
        auto next = std::lower_bound(places.begin(), places.end(), at_);
        if (next == places.end()) next = places.begin();
        at_ = *next + 1;
        const Message& reply = answers_[*next];
        if (reply.code < 0 && !reply.trail.empty()) throw sorma::Error(reply.trail);
        m = reply;
    }

    std::string nearestTo(const std::string& asked) const {
        std::string nearest;
        std::size_t least = SIZE_MAX;
        int compared = 0;
        constexpr int kMost = 5000;
        for (auto& [text, places] : known_) {
            if (++compared > kMost) break;
            const std::size_t far = distance(asked, text);
            if (far < least) least = far, nearest = text;
        }
        return sorma::cutText(nearest);
    }

    // All requests to the object, with their answers, in the order of the answers.
    void load() {
        if (loaded_) return;
        if (file_.empty() || object_.empty()) fail(kMissing, name(), file_.empty() ? "-file" : "-object");
        const std::size_t at = object_.find('@');
        const std::string wanted = this->wanted(), source = at == std::string::npos ? std::string() : object_.substr(at + 1);
        const std::string& file = file_.use(*this);
        std::set<std::string, std::less<>> others;
        answers_.clear(), known_.clear();
        try {
            rec::Reader reader(file);
            read(reader, wanted, source, others);
        } catch (const rec::FileError& e) {
            fail(kFile, name(), e.what());
        }
        if (answers_.empty()) fail(kNone, name(), file, object_, sorma::didYouMean(wanted, {others.begin(), others.end()}));
        loaded_ = true;
    }
    void read(rec::Reader& reader, const std::string& wanted, const std::string& source, std::set<std::string, std::less<>>& others) {
        constexpr std::size_t kMostOthers = 1000;
        std::map<std::pair<std::string, std::uint64_t>, std::string> open;
        std::size_t bytes = 0;
        Message m;
        for (rec::Record r; reader.next(r);) {
            if (r.kind != rec::Kind::request && r.kind != rec::Kind::reply) continue;
            if (r.object != wanted || (!source.empty() && r.source != source)) {
                if (others.size() < kMostOthers && mayTell(std::string(r.object))) others.emplace(r.object);
                continue;
            }
            if (!r.read(m)) continue;
            const std::pair<std::string, std::uint64_t> key(r.source, r.number);
            if (r.kind == rec::Kind::request) {
                open[key] = textOf(r.method.value_or(Method::exec), m);
                continue;
            }
            auto request = open.find(key);
            if (request == open.end()) continue;
            bytes += r.content.size() + request->second.size();
            if (bytes > std::size_t(most_)) fail(kLarge, name(), object_, most_);
            known_[request->second].push_back(answers_.size());
            answers_.push_back(m);
            open.erase(request);
        }
    }

    sorma::Named<sorma::Kind::file> file_;
    std::string object_;
    std::int64_t most_ = 64 << 20;
    bool inPlace_ = true, loaded_ = false;
    std::vector<Message> answers_;                              // in the order of the recording
    std::map<std::string, std::vector<std::size_t>> known_;     // requests as text, without the name: places of their answers
    std::size_t at_ = 0;                                        // place of the next answer
    std::string why_;                                           // its object's name does not lead here
    std::shared_ptr<Standin*> alive_ = std::make_shared<Standin*>(this);        // work in the mailbox asks
};

}  // namespace

extern "C" SORMA_EXPORT int Standin_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::standin", "1.0", {Standin::describe()});
}
