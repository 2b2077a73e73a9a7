// fork -- runs a program as a child, without holding up anybody but the caller who waits for its end.
//
//     FORK.sound CTRL -command {aplay -q}
//     FORK.sound EXEC alert.wav
//
// Words are appended to -command; text and any go to standard input. The answer comes when the program has ended: standard output as
// text, exit status as an int, lines of standard error as warnings. The child belongs to its
// request: when the caller cancels or dies, the object is removed, or this process ends, its process group is killed.
//
// Published: started {pid}, output {pid} and error {pid} for each line, ended {pid status}; started and ended with the
// command as text.
#include <sorma.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <deque>
#include <list>
#include <system_error>
#include <utility>

#include "process.h"

namespace {

using sorma::Right;
using sorma::Severity;

const sorma::Prototype kStatus{Severity::error, "FORK STATUS", 2, "{0}: {2} ended with status {1}{3}"};
const sorma::Prototype kKilled{Severity::error, "FORK KILLED", 2, "{0}: {2} was killed by signal {1}, {3}{4}"};
const sorma::Prototype kRefused{Severity::error, "FORK KILLED", 1,
                                "{}: {} was still waiting, and was refused by CTRL -kill"};
const sorma::Prototype kTimeout{Severity::error, "FORK TIMEOUT", 1,
                                "{}: {} had not ended after {} s, and was ended; see -timeout"};
const sorma::Prototype kStart{Severity::error, "FORK START", 2, "{0}: {2} cannot be started: {3}"};
const sorma::Prototype kLost{Severity::error, "FORK LOST", 1,
                             "{}: how {} ended is not known: this process ignores SIGCHLD, or waits for all children"};
const sorma::Prototype kBusy{Severity::error, "FORK BUSY", 1,
                             "{}: running: {}, waiting: {}; -max {} -queue {} allow no more; try again later"};
const sorma::Prototype kNothing{Severity::error, "OPTION MISSING", 2,
                                "{}: {} is empty and EXEC came without words: one of them must say what to run"};
const sorma::Prototype kCommand{Severity::error, "OPTION VALUE", 2, "{}: {} {} is no list of words: {}"};
const sorma::Prototype kFolder{Severity::error, "OPTION VALUE", 2,
                               "{}: {} {} has a zero character, which no folder name can have"};
const sorma::Prototype kZero{Severity::error, "REQUEST SYNTAX", 1,
                             "{}: word {} of the command, {}, has a zero character, which no program can be given"};
const sorma::Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed; {} was {}"};
const sorma::Prototype kStderr{Severity::warning, "FORK STDERR", 1, "{}: {}"};
const sorma::Prototype kCut{Severity::warning, "FORK CUT", 1,
                            "{}: the last {} bytes of its standard output were dropped: it wrote more than -limit {}"};

constexpr std::size_t kLongestLine = 4'000;         // [bytes] of an event or a warning, which are not cut then; longer ones come in pieces

std::int64_t nanoseconds(double seconds) { return std::int64_t(seconds * 1e9); }

// The place of the first byte that begins no whole character, or npos.
std::size_t badByte(std::string_view s, std::size_t from = 0) {
    for (std::size_t at = from; at < s.size();) {
        auto c = static_cast<unsigned char>(s[at]);
        std::size_t n = c < 0x80 ? 1 : c < 0xe0 ? 2 : c < 0xf0 ? 3 : 4;
        if (c >= 0x80 && !sorma::isUtf8(s.substr(at, n))) return at;
        at += n;
    }
    return std::string_view::npos;
}

// Bytes of a program as text: what is no UTF-8 becomes U+FFFD.
std::string cleaned(std::string_view bytes) {
    if (sorma::isUtf8(bytes)) return std::string(bytes);
    std::string out;
    for (std::size_t at = 0, bad; at < bytes.size(); at = bad + 1) {
        bad = badByte(bytes, at);
        out += bytes.substr(at, bad == std::string_view::npos ? bad : bad - at);
        if (bad == std::string_view::npos) break;
        out += "\xef\xbf\xbd";
    }
    return out;
}

// Gathers bytes, and gives away whole lines.
class Lines {
public:
    template <class Sink> void take(std::string_view bytes, Sink sink) {
        rest_ += bytes;
        std::size_t at = 0;
        for (;;) {
            std::size_t end = rest_.find('\n', at), next = end + 1;
            if (std::min(end, rest_.size()) - at > kLongestLine) {
                end = at + kLongestLine;            // ... or before, where a character begins
                while (end > at && (static_cast<unsigned char>(rest_[end]) & 0xc0) == 0x80) --end;
                if (end == at) end = at + kLongestLine;
                next = end;
            } else if (end == std::string::npos) {
                break;
            }
            sink(cleaned(std::string_view(rest_).substr(at, end - at)));
            at = next;
        }
        rest_.erase(0, at);
    }
    // A last line without its end.
    template <class Sink> void flush(Sink sink) {
        if (!rest_.empty()) sink(cleaned(std::exchange(rest_, {})));
    }

private:
    std::string rest_;
};

// A request, from EXEC to its answer. Its options are those of the moment it came.
struct Job {
    sorma::Reply reply;
    sorma::KeptCallPointer call;                // on whose behalf
    child::Command command;
    std::string shown;                          // the command as a message tells it
    double timeout = 0, grace = 0;
    std::size_t limit = 0;
    std::shared_ptr<child::Process> process;    // null while it waits
    sorma::PrincipalPointer author;
    std::int64_t since = 0;                     // [us] since 1970, when it was started
    sorma::Timer timer;
    bool late = false, byOperator = false;      // why it was killed
    std::string output;
    std::int64_t dropped = 0;                   // [bytes] of output
    Lines outputLines, errorLines;
    sorma::Trail trail;
    std::string lastError;                      // line
};
using JobPointer = std::shared_ptr<Job>;

class ForkService : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<ForkService>("fork", "runs a program as a subprocess, and answers when it has ended")
            .named("-command", &ForkService::command_,
                  {.help = "program and first arguments, as a list; no shell reads it. Words of EXEC follow"})
            .integer("-max", &ForkService::max_,
                     {.unit = "children", .low = 1, .high = 1000, .help = "that run at once"})
            .integer("-queue", &ForkService::queue_,
                     {.unit = "requests", .low = 0, .high = 100'000,
                      .help = "that wait while -max children run; 0: none, they are refused"})
            .real("-timeout", &ForkService::timeout_,
                  {.unit = "s", .low = 0, .high = 1e9, .help = "end a child that runs longer; 0: never"})
            .real("-grace", &ForkService::grace_,
                  {.unit = "s", .low = 0, .high = 3600, .help = "between SIGTERM and SIGKILL; 0: SIGKILL at once"})
            .named("-directory", &ForkService::directory_,
                  {.help = "where the program runs; empty: where the daemon is"})
            .integer("-limit", &ForkService::limit_,
                     {.unit = "bytes", .low = 0, .high = 16 << 20,
                      .help = "of standard output kept for the answer; more is dropped, with a warning"})
            .action("-kill", &ForkService::killAll, "", "kill all children now, and refuse the requests that wait", 0, 0, Right::call)
            .danger(sorma::Danger::stop)
            .action("-list", &ForkService::list, "", "a line for each child: process number, since when, command", 0, 0, Right::inspect)
            .execRight(Right::program)
            .actsOnWords()
            .execDanger(sorma::Danger::fire)
            .concurrency(sorma::Concurrency::concurrent)
            .words("?word ...?")
            .reads(text, {}, "", "standard input of the program")
            .reads(any, {}, "", "the same, as bytes, after the text")
            .writes(text, {}, "", "standard output, without a newline at its end")
            .writes(any, {}, "", "standard output when it is not UTF-8; then there is no text")
            .writes(ints, sorma::exactly(1), "", "exit status")
            .example("fork EXEC true");
    }

    ~ForkService() override { end(); }

    void born() override {
        check();
    }

    void changed(std::span<const sorma::Option* const>) override {
        check();
        startNext();                            // -max may have grown
    }

    void exec(sorma::Message& m) override {
        child::Command command{commandWords(), directory_.use(*this), {}};
        command.words.insert(command.words.end(), m.words.begin(), m.words.end());
        if (command.words.empty()) fail(kNothing, name(), "-command");
        for (std::size_t i = 0; i < command.words.size(); ++i)
            if (hasZero(command.words[i])) fail(kZero, name(), i + 1, sorma::shown(command.words[i]));
        bool waits = running_.size() >= std::size_t(max_);
        if (waits && waiting_.size() >= std::size_t(queue_))
            fail(kBusy, name(), running_.size(), waiting_.size(), max_, queue_);

        auto job = std::make_shared<Job>();
        command.input = std::move(m.text);
        command.input.append(m.any.begin(), m.any.end());
        m.clear();
        job->call = sorma::CallContext::keep();
        job->author = m.author;
        job->reply = later(m);
        job->shown = sorma::shown(sorma::joinWords(command.words));
        job->command = std::move(command);
        job->timeout = timeout_, job->grace = grace_, job->limit = std::size_t(limit_);
        job->reply.onCancel([this, weak = std::weak_ptr(job)] {
            if (auto j = weak.lock()) cancelled(*j);
        });
        if (waits) waiting_.push_back(std::move(job));
        else start(job);
    }

    void removing() override { end(); }

    std::string selftest() override {
        auto words = commandWords();
        if (words.empty()) return "ok: no -command, the words of EXEC say what to run";
        std::string file = child::Process::find(words[0], directory_.use(*this));
        if (file.empty()) fail(kStart, name(), "ENOENT", sorma::shown(words[0]), notFound(words[0]));
        return "ok: " + file;
    }

    void dumpState(std::string& out) const override {
        out += "# children " + std::to_string(running_.size()) + "\n";
        out += "# waiting " + std::to_string(waiting_.size()) + "\n";
    }

private:
    std::vector<std::string> commandWords() const {
        const std::string& words = command_.use(*this);
        try {
            return sorma::splitWords(words);
        } catch (const sorma::Error& e) {
            fail(kCommand, name(), "-command", sorma::shown(words), e.what());
        }
    }

    static bool hasZero(const std::string& word) { return word.find('\0') != std::string::npos; }

    void check() const {
        commandWords();
        const std::string& folder = directory_.get(sorma::Permit::owner());
        if (hasZero(folder)) fail(kFolder, name(), "-directory", sorma::shown(folder));
    }

    static std::string notFound(const std::string& program) {
        return program.find('/') == std::string::npos ? "no such program along PATH" : "no such program";
    }

    // ---- the life of a job ----

    void startNext() {
        while (running_.size() < std::size_t(max_) && !waiting_.empty()) {
            JobPointer job = std::move(waiting_.front());
            waiting_.pop_front();
            start(job);
        }
    }

    // Never throws: what goes wrong is the caller's.
    void start(const JobPointer& job) {
        Job* j = job.get();                     // lives as long as its process can call back
        job->process = std::make_shared<child::Process>(sorm(), child::Process::Listener{
            [this, j] { tell("started", *j, j->shown, {}); },
            [this, j](std::string_view bytes) { takeOutput(*j, bytes); },
            [this, j](std::string_view bytes) { takeErrors(*j, bytes); },
            [this, j](const child::End& end) { ended(*j, end); }});
        try {
            // It may have waited.
            job->process->start(job->command, need(job->author, Right::program));
            if (job->timeout > 0)
                job->timer = sorm().loop().after(sorma::monotonicNow() + nanoseconds(job->timeout),
                                                 [weak = std::weak_ptr(job)] {
                                                     if (auto late = weak.lock()) overdue(*late);
                                                 });
        } catch (const std::system_error& e) {
            std::string symbol = errorName(e.code().value());
            auto entry = makeEntry(kStart, {of(name()), of(symbol), of(job->shown), of(e.what())});
            return job->reply.fail(sorma::Error(std::move(entry)));
        } catch (const std::exception& e) {
            return job->reply.fail(e);
        }
        job->since = sorma::wallNow();
        job->command.input = {};                // the process has it
        running_.push_back(job);
    }

    static void overdue(Job& job) {
        job.late = true;
        job.process->terminate(nanoseconds(job.grace));
    }

    void takeOutput(Job& job, std::string_view bytes) {
        std::size_t room = job.limit - job.output.size(), taken = std::min(room, bytes.size());
        if (job.dropped > 0) taken = 0;
        job.output += bytes.substr(0, taken);
        job.dropped += std::int64_t(bytes.size() - taken);
        job.outputLines.take(bytes, [&](std::string line) { tell("output", job, std::move(line), {}); });
    }

    void takeErrors(Job& job, std::string_view bytes) {
        job.errorLines.take(bytes, [&](std::string line) { takeError(job, std::move(line)); });
    }

    void takeError(Job& job, std::string line) {
        if (!line.empty()) {
            job.trail.add(makeEntry(kStderr, {of(name()), of(line)}));
            job.lastError = line;
        }
        tell("error", job, std::move(line), {});
    }

    void ended(Job& ending, const child::End& end) {
        auto found = std::find_if(running_.begin(), running_.end(), [&](auto& j) { return j.get() == &ending; });
        JobPointer job = std::move(*found);
        running_.erase(found);
        job->timer.cancel();
        job->outputLines.flush([&](std::string line) { tell("output", *job, std::move(line), {}); });
        job->errorLines.flush([&](std::string line) { takeError(*job, std::move(line)); });
        tell("ended", *job, job->shown, {end.status()});
        if (end.kind == child::End::Kind::exited && end.number == 0 && !job->late) complete(*job);
        else failed(*job, end);
        startNext();
    }

    void complete(Job& job) {
        auto& m = job.reply.message();
        bool text = sorma::isUtf8(job.output);
        if (!text && job.dropped > 0) {         // the limit may have cut a character
            std::size_t whole = badByte(job.output);
            if (job.output.size() - whole < 4) {
                job.dropped += std::int64_t(job.output.size() - whole);
                job.output.resize(whole);
                text = true;
            }
        }
        if (text) {
            if (job.dropped == 0 && job.output.ends_with('\n')) job.output.pop_back();
            m.text = std::move(job.output);
        } else {
            m.any.assign(job.output.begin(), job.output.end());
        }
        m.ints = {0};
        m.trail = std::move(job.trail);
        if (job.dropped > 0) m.warn(kCut, name(), job.dropped, job.limit);
        job.reply.complete();
    }

    void failed(Job& job, const child::End& end) {
        using enum child::End::Kind;
        std::string last = job.lastError.empty() ? std::string() : "; its last words: " + job.lastError;
        auto entry = [&] {
            switch (end.kind) {
                case notStarted: {
                    std::string why = std::strerror(end.number);
                    if (!end.what.empty()) why = end.what + ", " + sorma::shown(job.command.directory) + ": " + why;
                    else if (end.number == ENOENT) why = notFound(job.command.words[0]);
                    return makeEntry(kStart, {of(name()), of(errorName(end.number)), of(job.shown), of(why)});
                }
                case unknown: return makeEntry(kLost, {of(name()), of(job.shown)});
                default: break;
            }
            if (job.late) return makeEntry(kTimeout, {of(name()), of(job.shown), of(job.timeout)});
            if (end.kind == exited) return makeEntry(kStatus, {of(name()), of(end.number), of(job.shown), of(last)});
            if (job.byOperator) last = "; CTRL -kill";
            const char* description = strsignal(end.number);
            return makeEntry(kKilled, {of(name()), of(end.number), of(job.shown), of(description), of(last)});
        }();
        job.trail.add(std::move(entry));
        job.reply.fail(sorma::Error(std::move(job.trail)));
    }

    // The caller has cancelled or died, or its deadline has passed: the result is not needed.
    void cancelled(Job& job) {
        if (job.process) return job.process->terminate(nanoseconds(job.grace));
        std::erase_if(waiting_, [&](auto& j) {
            if (j.get() == &job) j->reply.complete();
            return j.get() == &job;
        });
    }

    // Without delay: the object goes, or all that is around it.
    void end() {
        auto running = std::exchange(running_, {});
        auto waiting = std::exchange(waiting_, {});
        for (auto& job : running) job->process->kill();
        for (auto& job : running) {
            job->process->abandon();
            try {
                job->timer.cancel();
            } catch (const sorma::Error&) {     // the loop was deleted before
            }
            tell("ended", *job, job->shown, {128 + SIGKILL});
            refuse(*job, "killed");
        }
        for (auto& job : waiting) refuse(*job, "not started");
    }

    void refuse(Job& job, const char* what) {
        job.reply.fail(sorma::Error(makeEntry(kGone, {of(name()), of(job.shown), of(what)})));
    }

    // ---- CTRL ----

    void killAll(sorma::Args, sorma::Message& m) {
        auto waiting = std::exchange(waiting_, {});
        for (auto& job : waiting) job->reply.fail(sorma::Error(makeEntry(kRefused, {of(name()), of(job->shown)})));
        for (auto& job : running_) {
            job->byOperator = true;
            job->process->kill();
        }
        addLine(m, std::to_string(running_.size()) + " killed, " + std::to_string(waiting.size()) + " refused");
    }

    void list(sorma::Args, sorma::Message& m) {
        for (auto& job : running_) {
            std::time_t seconds = job->since / 1'000'000;
            std::tm local{};
            localtime_r(&seconds, &local);
            char since[32];
            std::strftime(since, sizeof since, "%Y-%m-%dT%H:%M:%S", &local);
            addLine(m, std::to_string(job->process->pid()) + " " + since + " " + sorma::joinWords(job->command.words));
        }
    }

    static void addLine(sorma::Message& m, const std::string& line) {
        if (!m.text.empty()) m.text += '\n';
        m.text += line;
    }

    // ---- events and messages ----

    void tell(const char* event, const Job& job, std::string text, std::vector<std::int64_t> more) const {
        sorma::Message m;
        m.text = std::move(text);
        m.ints = {job.process->pid()};
        m.ints.insert(m.ints.end(), more.begin(), more.end());
        sorma::CallContext context(job.call);
        publish(event, m);
    }

    template <class T> static sorma::MessageArg of(const T& value) { return sorma::MessageArg::of(value); }

    static std::string errorName(int number) {
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 32)
        if (const char* symbol = strerrorname_np(number)) return symbol;
#endif
        return std::to_string(number);
    }

    sorma::Named<sorma::Kind::program> command_;
    sorma::Named<sorma::Kind::folder> directory_;
    std::int64_t max_ = 4, queue_ = 100, limit_ = 1 << 20;
    double timeout_ = 0, grace_ = 2;
    std::list<JobPointer> running_;             // each has a process
    std::deque<JobPointer> waiting_;            // none of them has
};

}  // namespace

extern "C" SORMA_EXPORT int Fork_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::fork", "1.0", {ForkService::describe()});
}
