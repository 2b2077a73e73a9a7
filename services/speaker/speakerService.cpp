// speaker -- says things aloud: recorded fragments, and text that a synthesizer speaks.
//
//     speaker EXEC TMSG {power up the robot, please}
//     speaker EXEC "no token at" D 4                  fragments: a file of -folder is played, anything else is spoken
//     speaker EXEC IMSG 2 5 0 alert.wav               priority 5, level 0
//
// One after another, the most urgent first. Programs do the work, as children: a synthesizer turns text into sound, a player makes it
// heard; both get what they need by their standard input. The answer comes when it has been said.
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <fstream>
#include <list>
#include <optional>
#include <system_error>
#include <utility>

#include <sorma.h>

#include <fork/process.h>

namespace {

using sorma::Args;
using sorma::Message;
using sorma::Right;
using sorma::Severity;

const sorma::Prototype kNothing{Severity::error, "SPEAKER NOTHING", 1, "{}: EXEC came without words and without text: there is nothing to say"};
const sorma::Prototype kBusy{Severity::error, "SPEAKER BUSY", 1, "{}: {} messages wait already, and -queue {} allows no more; try again later"};
const sorma::Prototype kLate{Severity::error, "SPEAKER LATE", 1, "{}: \"{}\" waited for {} s for its turn, and was not said; see -patience"};
const sorma::Prototype kLong{Severity::error, "SPEAKER TIMEOUT", 1, "{}: \"{}\" took longer than {} s, and was cut off; see -timeout"};
const sorma::Prototype kQuiet{Severity::error, "SPEAKER QUIET", 1, "{}: \"{}\" was cut off by CTRL -quiet"};
const sorma::Prototype kProgram{Severity::error, "SPEAKER PROGRAM", 2, "{}: {} {} {}{}; -output log needs no sound"};
const sorma::Prototype kFile{Severity::error, "SPEAKER FILE", 2, "{}: {}: {}"};
const sorma::Prototype kOption{Severity::error, "OPTION VALUE", 2, "{}: {} {}"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed; \"{}\" was not said"};

constexpr std::streamoff kMostBytes = 64 << 20;         // of a recorded fragment, and of what a synthesizer writes

template <class... Values> sorma::Error error(const sorma::Prototype& prototype, const Values&... values) {
    return sorma::Error(sorma::makeEntry(prototype, {sorma::MessageArg::of(values)...}));
}

std::int64_t nanoseconds(double seconds) { return std::int64_t(seconds * 1e9); }

struct Piece {
    bool recorded = false;
    std::string what;                       // a file, or text
};

// A message, from EXEC to its answer.
struct Job {
    sorma::Reply reply;
    sorma::KeptCallPointer call;
    std::string shown;                      // what it says, for people
    std::int64_t priority = 0;
    std::vector<Piece> pieces;
    std::size_t at = 0;                     // the piece under way
    std::int64_t since = 0;                 // [ns] when it came
    std::shared_ptr<child::Process> process;
    std::string program, sound, lastError;
    sorma::Timer timer;                     // of -patience, then of -timeout
    std::optional<sorma::Error> why;        // it is being ended
};
using JobPointer = std::shared_ptr<Job>;

class Speaker final : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Speaker>("speaker", "says things aloud: recorded fragments, and spoken text")
            .named("-folder", &Speaker::folder_, {.help = "where recorded fragments are: a word of EXEC that names a file there is played; empty: all is spoken"})
            .choice("-output", &Speaker::output_, {"sound", "files", "log"}, {.help = "sound: by the player; files: numbered files in -to; log: text alone, in the file -to"})
            .named("-to", &Speaker::to_, {.help = "folder of -output files, or file of -output log; empty: the only the event said, no log"})
            .integer("-verbosity", &Speaker::verbosity_, {.unit = "1", .low = 0, .high = 9, .help = "messages of a higher level are not said: 0 alarms alone, 1 what people should know, 2 what goes on"})
            .integer("-max", &Speaker::max_, {.unit = "messages", .low = 1, .high = 100, .help = "that are said at once"})
            .integer("-queue", &Speaker::queue_, {.unit = "messages", .low = 0, .high = 10'000, .help = "that wait meanwhile; more are refused"})
            .real("-patience", &Speaker::patience_, {.unit = "s", .low = 0, .high = 1e6, .help = "a message that has waited longer is not said; 0: no limit"})
            .real("-timeout", &Speaker::timeout_, {.unit = "s", .low = 0, .high = 1e6, .help = "a message that takes longer is cut off; 0: never"})
            .text("-voice", &Speaker::voice_, {.help = "of the synthesizer, as espeak-ng -v takes it"})
            .integer("-speed", &Speaker::speed_, {.unit = "words/min", .low = 80, .high = 450, .help = "of the synthesizer"})
            .integer("-volume", &Speaker::volume_, {.unit = "%", .low = 0, .high = 200, .help = "of the synthesizer"})
            .named("-synthesizer", &Speaker::synthesizer_, {.help = "program and arguments, a list: text comes by its standard input, sound leaves by its standard output. %v, %s and "
                                                                   "%a are voice, speed and volume", .expert = true})
            .named("-player", &Speaker::player_, {.help = "program and arguments, a list: it plays what comes by its standard input", .expert = true})
            .action({"-quiet", "", "cut off the present message, and remove those that wait", 0, 0,
                     [](Service& s, Args, Message& m) { static_cast<Speaker&>(s).quiet(m); }, Right::call})
            .action({"-list", "", "a line for each message that is said or waits: priority, text", 0, 0,
                     [](Service& s, Args, Message& m) { static_cast<Speaker&>(s).list(m); }, Right::inspect})
            .concurrency(sorma::Concurrency::concurrent)
            .words("?fragment ...?")
            .reads(text, {}, "", "text to be spoken, after the fragments")
            .reads(ints, sorma::between(0, 2), "", "priority, higher first, default 0; level, as -verbosity counts, default 1")
            .writes(ints, sorma::exactly(1), "", "1: it has been said; 0: not, its level is above -verbosity")
            .example("speaker CTRL -output log");
    }

    ~Speaker() override { end(); }
    void born() override { check(); }
    void changed(std::span<const sorma::Option* const>) override {
        check();
        startNext();                        // -max may have grown
    }
    void removing() override { end(); }

    void exec(Message& m) override {
        auto job = std::make_shared<Job>();
        job->pieces = pieces(m);
        if (job->pieces.empty()) fail(kNothing, name());
        job->shown = sorma::joinWords(m.words);
        if (!m.text.empty()) job->shown += (job->shown.empty() ? "" : " ") + m.text;
        job->priority = m.ints.empty() ? 0 : m.ints[0];
        const bool silent = (m.ints.size() > 1 ? m.ints[1] : 1) > verbosity_;
        mayRun();
        if (!silent && running_.size() >= std::size_t(max_) && waiting_.size() >= std::size_t(queue_)) fail(kBusy, name(), waiting_.size(), queue_);
        m.clear();
        if (silent) return m.ints.assign(1, 0);
        job->call = sorma::CallContext::keep();
        job->since = sorma::monotonicNow();
        job->reply = later(m);
        job->reply.message().clear();
        job->reply.onCancel([this, weak = std::weak_ptr(job)] {
            if (auto j = weak.lock()) cancelled(j);
        });
        // Behind those of the same priority.
        auto place = std::find_if(waiting_.begin(), waiting_.end(), [&](auto& other) { return other->priority < job->priority; });
        if (patience_ > 0)
            job->timer = sorm().loop().after(job->since + nanoseconds(patience_), [this, weak = std::weak_ptr(job)] {
                if (auto j = weak.lock(); j && drop(j)) j->reply.fail(error(kLate, name(), j->shown, patience_));
            });
        waiting_.insert(place, std::move(job));
        startNext();
    }

    std::string selftest() override {
        if (output_ == "log") return "ok: -output log needs no program";
        std::string found;
        for (auto* option : {"-synthesizer", "-player"}) {
            if (output_ == "files" && option == std::string("-player")) break;
            const auto words = command(option);
            const auto file = child::Process::find(words[0], {});
            if (file.empty()) fail(kProgram, name(), words[0], "cannot be started:", "no such program along PATH", "");
            found += " " + file;
        }
        return "ok:" + found;
    }

    void dumpState(std::string& out) const override {
        out += "# speaking " + std::to_string(running_.size()) + "\n# waiting " + std::to_string(waiting_.size()) + "\n# said " +
               std::to_string(said_) + "\n";
    }

private:
    // ---- what is said ----

    std::vector<Piece> pieces(const Message& m) const {
        std::vector<Piece> out;
        auto spoken = [&](const std::string& text) {
            if (text.find_first_not_of(" \t\n") == std::string::npos) return;
            // Adjacent words are spoken as one text.
            if (!out.empty() && !out.back().recorded) out.back().what += " " + text;
            else out.push_back({false, text});
        };
        for (auto& word : m.words) {
            const std::string file = folder_.use(*this) + "/" + word;
            struct stat status;
            // A plain name: no other folder can be asked for.
            if (!folder_.empty() && word.find('/') == std::string::npos && word.find('\0') == std::string::npos &&
                stat(file.c_str(), &status) == 0 && S_ISREG(status.st_mode))
                out.push_back({true, file});
            else spoken(word);
        }
        spoken(m.text);
        return out;
    }

    // The authors of these options choose programs and files. They are asked before anything is said.
    void mayRun() {
        if (output_ != "log") (void)synthesizer_.permit(*this);
        if (output_ == "sound") (void)player_.permit(*this);
        (void)folder_.permit(*this);
        if (output_ != "sound") (void)to_.permit(*this);
    }

    std::vector<std::string> command(const std::string& option) const {
        const std::string& list = (option == "-player" ? player_ : synthesizer_).use(*this);
        std::vector<std::string> words;
        try {
            words = sorma::splitWords(list);
        } catch (const sorma::Error& e) {
            fail(kOption, name(), option, "is no list of words: " + std::string(e.what()));
        }
        if (words.empty()) fail(kOption, name(), option, "is empty: it must say what to run");
        if (option == "-player") return words;
        for (auto& w : words) {
            if (w == "%v") w = voice_;
            else if (w == "%s") w = std::to_string(speed_);
            else if (w == "%a") w = std::to_string(volume_);
        }
        return words;
    }

    void check() const {
        (void)command("-synthesizer");
        (void)command("-player");
        if (output_ == "files" && to_.empty()) fail(kOption, name(), "-to", "is empty: -output files needs a folder");
    }

    // ---- the life of a message ----

    void startNext() {
        while (running_.size() < std::size_t(max_) && !waiting_.empty()) {
            JobPointer job = std::move(waiting_.front());
            waiting_.pop_front();
            job->timer = {};
            if (timeout_ > 0)
                job->timer = sorm().loop().after(sorma::monotonicNow() + nanoseconds(timeout_), [this, weak = std::weak_ptr(job)] {
                    if (auto j = weak.lock()) cutOff(j, error(kLong, name(), j->shown, timeout_));
                });
            running_.push_back(job);
            proceed(job);
        }
    }

    bool drop(const JobPointer& job) { return std::erase(waiting_, job) > 0; }

    // The next piece, or the end.
    void proceed(const JobPointer& job) {
        try {
            if (output_ == "log" || job->at == job->pieces.size()) return finish(job);
            const Piece& piece = job->pieces[job->at];
            job->sound.clear();
            if (!piece.recorded) return run(job, command("-synthesizer"), piece.what, true);
            std::ifstream file(piece.what, std::ios::binary | std::ios::ate);
            const auto size = file.tellg();
            if (!file || size > kMostBytes) return done(job, error(kFile, name(), piece.what, file ? "is larger than 64 MB" : "cannot be read"));
            job->sound.resize(std::size_t(size));
            file.seekg(0);
            if (!file.read(job->sound.data(), size)) return done(job, error(kFile, name(), piece.what, "cannot be read"));
            play(job);
        } catch (const sorma::Error& e) {
            done(job, e);
        }
    }

    void play(const JobPointer& job) {
        try {
            if (output_ == "sound") return run(job, command("-player"), std::exchange(job->sound, {}), false);
            const std::string file = to_.use(*this) + "/" + std::to_string(++files_) + ".wav";
            std::ofstream out(file, std::ios::binary);
            if (!out.write(job->sound.data(), std::streamsize(job->sound.size())).flush())
                return done(job, error(kFile, name(), file, std::string("cannot be written: ") + std::strerror(errno)));
        } catch (const sorma::Error& e) {       // its author has lost the right
            return done(job, e);
        }
        ++job->at;
        proceed(job);
    }

    void run(const JobPointer& job, std::vector<std::string> words, std::string input, bool synthesizes) {
        job->program = words[0];
        job->lastError.clear();
        Job* j = job.get();                 // lives as long as its process can call back
        job->process = std::make_shared<child::Process>(sorm(), child::Process::Listener{
            [] {},
            [j, synthesizes](std::string_view bytes) {
                if (synthesizes && j->sound.size() + bytes.size() <= std::size_t(kMostBytes)) j->sound += bytes;
            },
            [j](std::string_view bytes) { j->lastError.append(bytes.substr(0, 1000 - std::min<std::size_t>(1000, j->lastError.size()))); },
            [this, j, synthesizes](const child::End& end) { ended(*j, end, synthesizes); }});
        try {
            job->process->start({std::move(words), {}, std::move(input)}, (synthesizes ? synthesizer_ : player_).permit(*this));
        } catch (const std::system_error& e) {
            done(job, error(kProgram, name(), job->program, "cannot be started:", e.what(), ""));
        }
    }

    void ended(Job& j, const child::End& end, bool synthesizes) {
        auto found = std::find_if(running_.begin(), running_.end(), [&](auto& job) { return job.get() == &j; });
        if (found == running_.end()) return;
        const JobPointer job = *found;
        if (job->why) return done(job, *job->why);
        if (end.status() != 0) {
            while (!job->lastError.empty() && job->lastError.back() == '\n') job->lastError.pop_back();
            const std::string last = job->lastError.empty() ? "" : "; its last words: " + job->lastError.substr(job->lastError.rfind('\n') + 1);
            if (end.kind == child::End::Kind::notStarted)
                return done(job, error(kProgram, name(), job->program, "cannot be started:", end.number == ENOENT ? "no such program along PATH" : std::strerror(end.number), ""));
            return done(job, error(kProgram, name(), job->program, "ended with status", std::to_string(end.status()), last));
        }
        if (synthesizes) return play(job);
        ++job->at;
        proceed(job);
    }

    void finish(const JobPointer& job) {
        if (output_ == "log" && !to_.empty()) {
            std::time_t now = std::time(nullptr);
            std::tm local{};
            localtime_r(&now, &local);
            char stamp[32];
            std::strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%S", &local);
            const std::string& file = to_.get(to_.permit(*this));
            std::ofstream log(file, std::ios::app);
            if (!(log << stamp << " " << job->priority << " " << job->shown << std::endl))
                return done(job, error(kFile, name(), file, std::string("cannot be written: ") + std::strerror(errno)));
        }
        ++said_;
        done(job, std::nullopt);
    }

    // The answer, and whose turn is next.
    void done(const JobPointer& job, const std::optional<sorma::Error>& why) {
        running_.remove(job);
        job->timer.cancel();
        job->process.reset();
        Message told;
        told.text = job->shown;
        told.ints = {job->priority};
        {
            sorma::CallContext context(job->call);
            publish(why ? "failed" : "said", told);
        }
        if (why) {
            job->reply.fail(*why);
        } else {
            job->reply.message().ints.assign(1, 1);
            job->reply.complete();
        }
        sorm().mailbox()->post([self = sorma::Reference(this)] { static_cast<Speaker&>(*self).startNext(); });
    }

    // One that is being said. Its process ends, and with it the job.
    void cutOff(const JobPointer& job, sorma::Error why) {
        if (!job->process || job->why) return;
        job->why = std::move(why);
        job->process->kill();
    }

    void cancelled(const JobPointer& job) {
        if (drop(job)) return job->reply.complete();
        cutOff(job, error(kQuiet, name(), job->shown));
    }

    void quiet(Message& m) {
        auto waiting = std::exchange(waiting_, {});
        for (auto& job : waiting) job->reply.fail(error(kQuiet, name(), job->shown));
        for (auto& job : running_) cutOff(job, error(kQuiet, name(), job->shown));
        m.text += std::to_string(running_.size()) + " cut off, " + std::to_string(waiting.size()) + " dropped";
    }

    void list(Message& m) const {
        for (auto* jobs : {&running_, &waiting_})
            for (auto& job : *jobs) m.text += (m.text.empty() ? "" : "\n") + std::to_string(job->priority) + " " + job->shown;
    }

    void end() {
        auto all = std::exchange(running_, {});
        for (auto& job : all)
            if (job->process) job->process->abandon();
        all.splice(all.end(), std::exchange(waiting_, {}));
        for (auto& job : all) job->reply.fail(error(kGone, name(), job->shown));
    }

    sorma::Named<sorma::Kind::folder> folder_;
    sorma::Named<sorma::Kind::file> to_;
    std::string output_ = "sound", voice_ = "en";
    sorma::Named<sorma::Kind::program> synthesizer_ = "espeak-ng -v %v -s %s -a %a --stdin --stdout", player_ = "aplay -q -";
    std::int64_t verbosity_ = 1, max_ = 1, queue_ = 20, speed_ = 150, volume_ = 100;
    double patience_ = 0, timeout_ = 60;
    std::list<JobPointer> running_, waiting_;
    std::int64_t files_ = 0, said_ = 0;
};

}  // namespace

extern "C" SORMA_EXPORT int Speaker_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::speaker", "1.0", {Speaker::describe()});
}
