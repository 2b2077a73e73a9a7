// pipe -- requests one after another, each with the result of the one before, in one round trip.
//
//     pipe@robot EXEC {camera EXEC grab} {vision EXEC find}
//
// Each word is the EXEC of an object of this process. A step gets text, floats, ints and any of the result before it, as far
// as its class takes them. Parts that it gives itself stay. The first step gets the parts that came with the pipe. All steps are read, and their
// objects found, before the first one is executed.
//
// A step acts for the one who has sent the pipe: each object is asked for that one's rights, as if it were called alone.
#include <sorma.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

using sorma::Message;
using sorma::Severity;

const sorma::Prototype kNoSteps{Severity::error, "PIPE EMPTY", 1, "{}: expected at least one step, like {{camera EXEC grab}}"};
const sorma::Prototype kMethod{Severity::error, "PIPE STEP", 2, "{}: step {}, {}, is no EXEC; a pipe hands results on, and CTRL and DBX have none"};
const sorma::Prototype kInside{Severity::error, "PIPE STEP", 2, "{}: step {}, {}, is a pipe; write its steps here instead"};
const sorma::Prototype kElsewhere{Severity::error, "PIPE ELSEWHERE", 2,
                                  "{}: step {}, {}, is served elsewhere; all steps of a pipe are at one daemon: ask that one for itself"};
const sorma::Prototype kUnread{Severity::error, "PIPE STEP", 2, "{}: step {} cannot be read: {}"};

const sorma::Prototype kMany{Severity::error, "PIPE STEP", 1, "{}: {} steps; at most {} may be in one pipe"};
constexpr std::size_t kMostSteps = 100;     // steps that are answered at once may be nested
constexpr std::size_t kShown = 200;         // [bytes] of a step, in messages

struct Step {
    std::string object;                     // its name
    sorma::Reference service;
    Message request;
};

// A pipe under way.
struct Run {
    std::vector<Step> steps;
    std::size_t count = 0;                  // of steps
    std::size_t at = 0;                     // the step that comes next
    Message value;                          // the result so far; its trail: warnings of all steps
    sorma::PrincipalPointer author;
};

// Give a step the parts of a result that its class takes, and that it lacks.   all: the others, too; then it refuses them.
void hand(Message& from, Step& step, bool all = false) {
    const auto& reads = step.service->type().reads();
    auto takes = [&](sorma::Field field) {
        return all || !(step.service->type().checks() & sorma::Class::undeclared) || std::any_of(reads.begin(), reads.end(), [&](auto& part) { return part.field == field; });
    };
    Message& to = step.request;
    if (to.text.empty() && takes(sorma::Field::text)) to.text.swap(from.text);
    if (to.floats.empty() && takes(sorma::Field::floats)) to.floats.swap(from.floats);
    if (to.ints.empty() && takes(sorma::Field::ints)) to.ints.swap(from.ints);
    if (to.any.empty() && takes(sorma::Field::any)) to.any.swap(from.any);
}

class Pipe : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Pipe>("pipe", "requests one after another in one round trip, each with the result of the one before")
            .concurrency(sorma::Concurrency::concurrent)
            .actsOnWords()
            .reads(text, {}, "", "for the first step")
            .reads(floats, {}, "", "")
            .reads(ints, {}, "", "")
            .reads(any, {}, "", "")
            .writes(text, {}, "", "result of the last step")
            .writes(floats, {}, "", "")
            .writes(ints, {}, "", "")
            .writes(any, {}, "", "")
            .words("step ?step ...?")
            .example("pipe EXEC {echo EXEC TMSG hello} {echo EXEC}");
    }

    void exec(Message& m) override {
        Run run = read(m);
        m.words.clear();
        hand(m, run.steps.front(), true);
        if (auto pending = goOn(run)) return waitFor(std::make_shared<Run>(std::move(run)), later(m), std::move(pending));
        m.swap(run.value);
    }

private:
    Run read(Message& m) {
        if (m.words.empty()) sorma::fail(kNoSteps, name());
        if (m.words.size() > kMostSteps) sorma::fail(kMany, name(), std::int64_t(m.words.size()), std::int64_t(kMostSteps));
        Run run;
        run.author = m.author;
        run.count = m.words.size();
        for (auto& word : m.words) {
            Step& step = run.steps.emplace_back();
            const auto number = std::int64_t(run.steps.size());
            const std::string shown = sorma::shown(sorma::cutText(word, kShown));
            sorma::Method method;
            try {
                sorma::parseRequest(word, step.object, method, step.request);
            } catch (const sorma::Error& e) {
                sorma::fail(kUnread, name(), number, e.what());
            }
            if (method != sorma::Method::exec) sorma::fail(kMethod, name(), number, shown);
            if (sorma::Name::isElsewhere(step.object)) sorma::fail(kElsewhere, name(), number, shown);
            guarded(run, run.steps.size() - 1, [&] { step.service = sorm().get(step.object, run.author); });
            if (step.service->isElsewhere()) sorma::fail(kElsewhere, name(), number, shown);
            if (dynamic_cast<Pipe*>(step.service.get())) sorma::fail(kInside, name(), number, shown);
        }
        return run;
    }

    // An error in there names the step.
    template <class F> void guarded(const Run& run, std::size_t at, F f) {
        try {
            f();
        } catch (const sorma::Error& e) {
            sorma::Trail trail = e.trail;
            for (auto& entry : trail.entries()) {
                if (entry.severity != Severity::error) continue;
                entry.text = name() + ": step " + std::to_string(at + 1) + " of " + std::to_string(run.count) + ": " + entry.text;
                break;
            }
            throw sorma::Error(std::move(trail));
        }
    }

    // Execute steps until one answers later; null: the value is the result.
    sorma::PendingPointer goOn(Run& run) {
        while (run.at < run.steps.size()) {
            Message& request = run.steps[run.at].request;
            hand(run.value, run.steps[run.at]);
            request.author = run.author;
            bool isLater = false;
            guarded(run, run.at, [&] { isLater = run.steps[run.at].service->start(sorma::Method::exec, request); });
            if (isLater) return std::exchange(request.later, nullptr);
            take(run, request);
        }
        return nullptr;
    }

    static void take(Run& run, Message& result) {
        sorma::Trail trail = std::move(run.value.trail);
        trail.append(result.trail);
        run.value.reset();
        run.value.swap(result);
        run.value.author.reset();
        run.value.trail = std::move(trail);
        ++run.at;
    }

    void waitFor(std::shared_ptr<Run> run, sorma::Reply reply, sorma::PendingPointer pending) {
        reply.onCancel([pending] { sorma::Future(pending).cancel(); });
        pending->whenAnswered([this, self = sorma::Reference(this), run, reply, pending, call = sorma::CallContext::keep()] {
            sorma::CallContext again(call);
            try {
                guarded(*run, run->at, [&] { take(*run, sorma::Future(pending).result()); });
                if (reply.answered()) return;
                if (auto next = goOn(*run)) return waitFor(run, reply, next);
                reply.message().swap(run->value);
                reply.complete();
            } catch (const std::exception& e) {
                reply.fail(e);
            }
        });
    }
};

}  // namespace

extern "C" SORMA_EXPORT int Pipe_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::pipe", "1.0", {Pipe::describe()});
}
