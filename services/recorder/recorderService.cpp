// recorder -- all buffers of a run in a file: recorded, played again as if the hardware were there, and as tables.
//
//     recorder.run CTRL -file run.rec -prefix demo. -record       until CTRL -stop
//     recorder.run EXEC play                                      writes the buffers again; answers at the end
//     recorder.run EXEC export tables                             tables/arm.state.csv and so on
#include <sorma.h>
#include <bus/listText.h>

#include <sstream>

#include "busRecording.h"
#include "history.h"
#include "live.h"
#include "tape.h"
#include "timeline.h"

namespace {

using recorder::Figures;
using recorder::Job;
using recorder::Plan;
using sorma::Args;
using sorma::Message;
using sorma::Severity;

const sorma::Prototype kFile{Severity::error, "RECORDER FILE", 1, "{}: {}"};
const sorma::Prototype kNoFile{Severity::error, "OPTION MISSING", 2, "{}: {} is empty: it must name the recording"};
const sorma::Prototype kBuffer{Severity::error, "RECORDER BUFFER", 1,
                               "{}: a buffer cannot be written: {}; -buffers chooses, -prefix keeps runs apart"};
const sorma::Prototype kBusy{Severity::error, "RECORDER BUSY", 1, "{}: it is {} {}; CTRL -stop ends that"};
const sorma::Prototype kIdle{Severity::error, "RECORDER IDLE", 1, "{}: nothing is under way that could be stopped"};
const sorma::Prototype kWord{Severity::error, "RECORDER WORD", 2, "{}: bad words \"{}\": must be about, at TIME REQUEST, export FOLDER, list, now, play, push, records ?OPTION ...?, state, timeline ?WHAT ...?, or as a stream, stream REQUESTS EVENTS ?BYTES NS?"};
const sorma::Prototype kPast{Severity::error, "RECORDER PAST", 1, "{}: {}"};
const sorma::Prototype kTime{Severity::error, "RECORDER WORD", 2, "{}: at expects seconds since 1970, got \"{}\""};
const sorma::Prototype kTimeline{Severity::error, "RECORDER WORD", 2, "{}: timeline: {}"};
const sorma::Prototype kRecords{Severity::error, "RECORDER WORD", 2, "{}: records: {}"};

class Recorder : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Recorder>("recorder", "records requests, events and snapshot buffers in a file, plays buffers again")
            .named("-file", &Recorder::file_, {.help = "the recording"})
            .named("-prefix", &Recorder::prefix_,
                  {.help = "of the buffers' keys; a recording does not contain it, so it may be played with another one"})
            .text("-buffers", &Recorder::buffers_, {.help = "patterns of keys, without the prefix; what fits none is left out"})
            .text("-requests", &Recorder::requests_,
                  {.help = "pattern of objects whose requests and replies are recorded, in place of buffers"})
            .text("-events", &Recorder::events_, {.help = "pattern of objects whose events are recorded, in place of buffers"})
            .flag("-together", &Recorder::together_, {.help = "requests, events: record buffers of this host, too"})
            .text("-from", &Recorder::from_, {.help = "names of recorders at other daemons: their requests and events are recorded, and not those of this process"})
            .integer("-max", &Recorder::max_,
                     {.unit = "byte", .low = 0, .high = 1e15, .help = "requests, events: of the file, which keeps the last ones then; 0: any"})
            .real("-seconds", &Recorder::seconds_, {.unit = "s", .low = 0, .high = 1e9, .help = "requests, events: older ones may go; 0: none"})
            .text("-clock", &Recorder::clock_,
                  {.help = "play: the buffer whose float 0 is the time to play by; empty, or not recorded: the time of writing"})
            .real("-speed", &Recorder::speed_,
                  {.unit = "1", .low = 0, .high = 1000, .help = "play: recorded seconds in a second; 0: as fast as it goes"})
            .flag("-partial", &Recorder::partial_, {.help = "read a file that was cut, up to there"})
            .action("-record", &Recorder::record, "", "begin to record; what is in the file is replaced")
            .action("-stop", &Recorder::stop, "", "end what is under way; says how much that was", 0, 0, sorma::Right::call)
            .concurrency(sorma::Concurrency::concurrent)
            .words("about | at time request | export folder | list | now | play | push | records ?option ...? | state | stream requests events ?bytes ns? | timeline ?what ...?")
            .word("export", &Recorder::makeTables)
            .writes(ints, {}, "", "play, export: records, buffers")
            .writes(text, {}, "", "about, at, list, records, timeline: what is in the file; state: what it does")
            .repeatable({"about", "at", "list", "now", "push", "records", "state", "timeline"})
            .example("recorder.example CTRL -buffers {arm.* lab.clock}");
    }

    ~Recorder() override { removing(); }
    void removing() override {
        job_.reset();
        merge_.reset();
        bus_.reset();
        charge_.clear();
    }

    void exec(Message& m) override {
        if (execWord(m)) return;
        if (m.words.size() == 1 && m.words[0] == "about") return about(m);
        if (m.words.size() == 1 && m.words[0] == "now") return m.clear(), void(m.ints = {sorma::monotonicNow()});
        if (m.words.size() == 1 && m.words[0] == "push") {
            for (auto* stream : *streams_) stream->push();
            return m.clear();
        }
        if (m.words.size() == 1 && m.words[0] == "state") return tellState(m);
        if (m.words.size() >= 3 && m.words[0] == "at") return answerPast(m);
        if (!m.words.empty() && m.words[0] == "timeline") return answerTimeline(m);
        if (auto text = recordText(m)) return gather(*text, m);
        const bool plays = m.words.size() == 1 && m.words[0] == "play";
        if (!plays && !(m.words.size() == 1 && m.words[0] == "list")) {
            std::string all;
            for (auto& word : m.words) all += (all.empty() ? "" : " ") + word;
            fail(kWord, name(), all);
        }
        Plan plan = begin(plays ? "playing" : "reading");
        if (plays) {
            charge_ = sorma::Charge(sorm().budget.ofCaller(), sorma::Account::Use::segments);
            plan.charge = [this](std::size_t bytes) { charge_.need(name(), bytes); };
            return start(m, [plan](Job& job, Message&) { return recorder::play(job, plan); });
        }
        start(m, [plan](Job& job, Message& answer) { return recorder::list(job, plan, answer.text); });
    }

    std::unique_ptr<sorma::Pieces> inPieces(Message& m) override {
        if ((m.words.size() == 3 || m.words.size() == 5) && m.words[0] == "stream") {
            sorma::recording::Selection selection{m.words[1], m.words[2], source(), name(), m.author};
            std::int64_t bytes = 0;
            const bool good = m.words.size() == 3 || (sorma::parseNumber(m.words[3], bytes) && bytes >= 0 && sorma::parseNumber(m.words[4], selection.lookTime) && selection.lookTime >= 0);
            if (!good) return nullptr;
            selection.lookBytes = std::size_t(bytes);
            selection.reader = sorma::CallContext::currentCaller().toText();
            return std::make_unique<recorder::LivePieces>(sorm(), std::move(selection), streams_);
        }
        std::shared_ptr<recorder::RecordText> text = recordText(m);
        if (!text) return nullptr;
        return sorma::piecesOf([text](Message& piece, std::size_t most) { text->next(piece.text, most); });
    }

    void dumpState(std::string& out) const override {
        out += "# state " + (busy() ? what_ : "idle") + "\n";
        if (!bus_) return;
        if (merge_) {
            out += "# connected " + std::to_string(merge_->connected()) + "\n";
            for (auto& [who, why] : merge_->away()) out += "# away " + who + ": " + why + "\n";
        }
        const auto figures = bus_->recorder().figures();
        out += "# records " + std::to_string(figures.records) + "\n# lost " + std::to_string(figures.lost) + "\n";
    }

private:
    void makeTables(Message& m, const sorma::Named<sorma::Kind::folder>& folder) {
        Plan plan = begin("making tables of");
        plan.folder = folder.use(*this);
        start(m, [plan](Job& job, Message&) { return recorder::exportTables(job, plan); });
    }

    // The dict of `state`: what dumpState shows, for programs.
    void tellState(Message& m) const {
        m.clear();
        auto add = [&m](std::string_view key, const std::string& value) { sorma::appendListElement(m.text, key), sorma::appendListElement(m.text, value); };
        add("state", busy() ? what_ : "idle");
        if (bus_) {
            const auto figures = bus_->recorder().figures();
            add("records", std::to_string(figures.records));
            add("lost", std::to_string(figures.lost));
            add("error", figures.error);
        }
        if (!merge_) return;
        std::string away;
        for (auto& [who, why] : merge_->away()) sorma::appendListElement(away, who), sorma::appendListElement(away, why);
        add("connected", std::to_string(merge_->connected()));
        add("away", away);
    }

    bool busy() const { return bus_ || (job_ && !job_->ended()); }

    // ---- requests and events ----

    template <class F> auto reading(F f) -> decltype(f(std::string())) {
        if (file_.empty()) fail(kNoFile, name(), "-file");
        try {
            return f(file_.use(*this));
        } catch (const sorma::recording::FileError& e) {
            fail(kFile, name(), e.what());
        }
    }
    void about(Message& m) {
        const bool names = !sorma::Principal::both(m.author, author("-file"));
        m.clear();
        m.text = reading([&](const std::string& file) { return recorder::describe(file, names); });
    }
    // `at TIME REQUEST`. The reader of a file that nobody writes any more is kept.
    void answerPast(Message& m) {
        std::int64_t time = 0;
        if (!recorder::readSeconds(m.words[1], time)) fail(kTime, name(), m.words[1]);
        const auto question = m.words.size() == 3 ? sorma::splitWords(m.words[2]) : std::vector<std::string>(m.words.begin() + 2, m.words.end());
        const auto mayTell = tellable(m);
        m.clear();
        try {
            history().answer(time, question, mayTell, m);
        } catch (const recorder::Unknown& e) {
            m.clear();
            fail(kPast, name(), e.what());
        }
    }
    recorder::History& history() {
        return reading([&](const std::string& file) -> recorder::History& {
            if (bus_) {
                const std::int64_t now = bus_->recorder().now() - (merge_ ? recorder::Merge::kHold + recorder::Merge::kTurn : 0);
                history_ = std::make_unique<recorder::History>(std::make_unique<sorma::recording::Reader>(file, bus_->index()), now);
                past_.clear();
                return *history_;
            }
            std::string version = recorder::versionOf(file);
            if (!history_ || version != past_) history_ = std::make_unique<recorder::History>(std::make_unique<sorma::recording::Reader>(file));
            past_ = std::move(version);
            return *history_;
        });
    }
    // Of which objects may whoever asks be told, and whoever chose the file? Null: of all.
    std::function<bool(std::string_view)> tellable(const Message& m) const {
        auto reader = sorma::Principal::both(m.author, author("-file"));
        if (!reader) return nullptr;
        return [this, reader](std::string_view object) { return sorma::recording::recordable(object, sorm(), reader); };
    }
    // `timeline ...`. What was read of the file stays until it shall be read again, or -file is another one.
    void answerTimeline(Message& m) {
        const auto mayTell = tellable(m);
        const bool again = m.words.size() == 2 && m.words[1] == "read", more = m.words.size() == 2 && m.words[1] == "more";
        const auto words = again || more ? std::vector<std::string>{"timeline"} : std::move(m.words);
        m.clear();
        reading([&](const std::string& file) {
            if (again || !timeline_ || file != timelineOf_) {
                std::optional<sorma::recording::Index> index;
                if (bus_) index = bus_->index();
                timeline_.reset();
                timeline_ = std::make_unique<recorder::Timeline>(file, std::move(index));
                timelineOf_ = file;
            } else if (more) {
                if (bus_) bus_->recorder().flush();
                timeline_->more();
            }
        });
        if (auto wrong = timeline_->answer(words, 1, mayTell, m.text); !wrong.empty()) fail(kTimeline, name(), wrong);
    }
    // The reader of `records`; null: the words are others.
    std::unique_ptr<recorder::RecordText> recordText(const Message& m) {
        if (m.words.empty() || m.words[0] != "records") return nullptr;
        recorder::Search search;
        if (auto wrong = search.read(m.words, 1); !wrong.empty()) fail(kRecords, name(), wrong);
        search.mayTell = tellable(m);
        return reading([&](const std::string& file) { return std::make_unique<recorder::RecordText>(file, search); });
    }
    void gather(recorder::RecordText& text, Message& m) {
        constexpr std::size_t kMost = 16 << 20;
        m.clear();
        for (std::size_t before = SIZE_MAX; before != m.text.size() && m.text.size() < kMost;) {
            before = m.text.size();
            text.next(m.text, kMost);
        }
        if (m.text.size() >= kMost) fail(kRecords, name(), "more than 16 MB: read them with sorma::stream");
    }
    std::string source() const { return sorm().daemonName.empty() ? sorma::Caller::self().program : sorm().daemonName; }
    void recordBus(const sorma::PrincipalPointer& by) {
        Plan plan = begin("recording");
        const auto from = sorma::splitWords(from_);
        const auto authors = sorma::Principal::both(by, author("-file"));
        sorma::recording::Selection selection{requests_, events_, source(), name(), authors};
        if (!from.empty()) selection.requests.clear(), selection.events.clear();
        // A black box shall have some looks of each source.
        constexpr int kLooks = 4;
        selection.lookBytes = std::size_t(max_) / (kLooks * std::max<std::size_t>(1, from.size()));
        selection.lookTime = std::int64_t(seconds_ * 1e9) / kLooks;
        const sorma::recording::WriterOptions options{.most = std::uint64_t(max_), .keep = std::int64_t(seconds_ * 1e9)};
        bus_ = reading([&](const std::string& file) { return std::make_unique<recorder::BusRecording>(sorm(), selection, file, options); });
        if (together_) recordBuffers(plan);
        if (!from.empty())
            merge_ = std::make_unique<recorder::Merge>(sorm(), from, std::vector<std::string>{"stream", requests_, events_, std::to_string(selection.lookBytes), std::to_string(selection.lookTime)}, sorma::Principal::both(authors, author("-from")),
                                                       bus_->recorder());
    }
    void recordBuffers(Plan& plan) {
        plan.bus = &bus_->recorder();
        auto recording = std::make_shared<recorder::Recording>(plan);
        job_ = std::make_unique<Job>([recording](Job& job) { return recording->run(job); }, [](const Figures&, std::exception_ptr) {});
    }
    // While it drains, other requests find that nothing is under way.
    void stopBus(Message& m) {
        const auto merge = std::move(merge_);
        const auto bus = std::move(bus_);
        auto job = std::move(job_);
        if (merge) merge->drain();
        job.reset();
        const auto figures = bus->stop();
        if (!figures.error.empty() && figures.records == 0) fail(kFile, name(), figures.error);
        m.text += std::to_string(figures.records) + " records, " + std::to_string(figures.lost) + " lost, in " + file_.get(sorma::Permit::owner());
        if (!figures.error.empty()) m.text += "; " + figures.error;
        m.ints = {std::int64_t(figures.records), 0, std::int64_t(figures.lost)};
    }

    // The plan that the options give. Fails when a job is under way.
    Plan begin(const char* what) {
        if (busy()) fail(kBusy, name(), what_, file_.get(sorma::Permit::owner()));
        if (file_.empty()) fail(kNoFile, name(), "-file");
        job_.reset();
        what_ = what;
        Plan plan;
        plan.file = file_.use(*this);
        plan.prefix = prefix_.use(*this);
        plan.program = sorm().daemonName.empty() ? sorma::Caller::self().program : sorm().daemonName;
        std::istringstream patterns(buffers_);
        for (std::string p; patterns >> p;) {
            needKind(sorma::Principal::both(author("-buffers"), maker()), sorma::Kind::segment, plan.prefix + p);
            plan.buffers.push_back(p);
        }
        plan.clock = clock_;
        plan.speed = speed_;
        plan.partial = partial_;
        return plan;
    }

    template <class Work> void start(Message& m, Work work) {
        sorma::Reply reply = later(m);
        reply.message().clear();
        job_ = std::make_unique<Job>(
            [work, reply](Job& job) { return work(job, reply.message()); },
            [this, reply](const Figures& figures, std::exception_ptr error) {
                charge_.clear();
                if (error) return reply.fail(refusal(error));
                if (reply.message().text.empty()) reply.message().ints = {std::int64_t(figures.records), std::int64_t(figures.buffers)};
                reply.complete();
            });
        reply.onCancel([this] {
            if (job_) job_->stop();
        });
    }

    // The exception of a job as an error of this object.
    sorma::Error refusal(std::exception_ptr error) const {
        using sorma::MessageArg;
        try {
            std::rethrow_exception(error);
        } catch (const sorma::Error& e) {
            return e;
        } catch (const shmem::Failure& e) {
            return sorma::Error(sorma::makeEntry(kBuffer, {MessageArg::of(name()), MessageArg::of(std::string(e.what()))}));
        } catch (const std::exception& e) {
            return sorma::Error(sorma::makeEntry(kFile, {MessageArg::of(name()), MessageArg::of(std::string(e.what()))}));
        }
    }

    void record(Args, Message& m) {
        if (!requests_.empty() || !events_.empty()) return recordBus(m.author);
        const Plan plan = begin("recording");
        std::shared_ptr<recorder::Recording> recording;
        try {
            recording = std::make_shared<recorder::Recording>(plan);
        } catch (const recorder::FileError& e) {
            fail(kFile, name(), e.what());
        }
        auto ended = [this, box = sorm().mailbox(), weak = std::weak_ptr<Recorder*>(alive_)](const Figures& figures, std::exception_ptr error) {
            figures_ = figures;
            error_ = error;
            // No request waits for the job, so its end is published.
            if (error) box->post([weak, error] {
                if (auto self = weak.lock()) (*self)->tell(error);
            });
        };
        error_ = nullptr;
        job_ = std::make_unique<Job>([recording](Job& job) { return recording->run(job); }, ended);
    }

    void tell(std::exception_ptr error) {
        Message m;
        m.text = refusal(error).what();
        publishState("broken", m);
        sorm().announce("broken", m.text, {name()});
    }

    void stop(Args, Message& m) {
        if (bus_) return stopBus(m);
        const bool records = what_ == "recording" && job_;
        if (!records && !busy()) fail(kIdle, name());
        job_->stop();
        if (!records) return;
        job_.reset();                       // waits until the file is complete
        if (error_) throw refusal(std::exchange(error_, nullptr));
        m.text += std::to_string(figures_.records) + " records of " + std::to_string(figures_.buffers) + " buffers, " +
                  std::to_string(figures_.lost) + " lost, in " + file_.get(sorma::Permit::owner());
        m.ints = {std::int64_t(figures_.records), std::int64_t(figures_.buffers), std::int64_t(figures_.lost)};
    }

    sorma::Named<sorma::Kind::file> file_;
    sorma::Named<sorma::Kind::segment> prefix_;
    std::string buffers_ = "*", clock_ = "arm.state";
    std::string requests_, events_, from_;
    std::int64_t max_ = 0;
    bool together_ = false;
    double seconds_ = 0, speed_ = 1;
    bool partial_ = false;
    std::string what_;
    Figures figures_;                       // of the recording; written by its thread, read when that has ended
    std::exception_ptr error_;
    std::shared_ptr<Recorder*> alive_ = std::make_shared<Recorder*>(this);      // work in the mailbox asks
    sorma::Charge charge_;                  // for the buffers that are played, on the account of the caller
    std::unique_ptr<recorder::History> history_;        // of the last question
    std::string past_;                      // version of its file
    std::unique_ptr<recorder::Timeline> timeline_;
    std::string timelineOf_;                // its file
    std::unique_ptr<recorder::BusRecording> bus_;
    const recorder::LivePieces::All streams_ = std::make_shared<recorder::LivePieces::All::element_type>();
    std::unique_ptr<recorder::Merge> merge_;
    std::unique_ptr<Job> job_;              // last: its thread uses what is above
};

}  // namespace

extern "C" SORMA_EXPORT int Recorder_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::recorder", "1.0", {Recorder::describe()});
}
