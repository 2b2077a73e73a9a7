// blockingLine.h -- an object with a line to a device whose library or driver blocks. One EXEC at a time has the line, and runs on a thread of its
// own, so nobody else in the daemon waits.
//
// Line has where() (the -to that it was made for), isOpen() from any thread, and close(). With interrupt(), from any thread, what is under way ends
// soon when nobody waits for it any more. It throws Failure, a std::exception that is made of a trouble and a text; a trouble is `lost`.
//
// Threads: the SORM's, but for the work.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include <sorma.h>

#include "bus/detached.h"

namespace line {

template <class Line, class Failure>
class BlockingLine : public sorma::Service {
public:
    ~BlockingLine() override { BlockingLine::removing(); }

    // The thread ends by itself: it knows the line and the mailbox, and nothing of the object.
    void removing() override {
        static const sorma::Prototype kGone{sorma::Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};
        if constexpr (kInterrupts)
            if (line_) line_->interrupt();
        if (auto job = std::exchange(job_, nullptr)) job->reply.fail(sorma::Error(sorma::makeEntry(kGone, {sorma::MessageArg::of(name())})));
    }

    void dumpState(std::string& out) const override { out += "# line " + state() + "\n"; }

protected:
    virtual sorma::Error errorOf(const Failure& failure) const = 0;

    // Take the request over. work(line) runs on the thread, and returns what fills in the answer: a function of the message, called on the SORM's
    // thread. The line belongs to this request until then. It fails with COMM LIMIT beyond the threads of the caller.
    template <class Work> void onThread(sorma::Message& m, Work work) {
        sorma::Charge charge(sorm().budget.ofCaller(), sorma::Account::Use::threads);
        charge.need(name(), sorma::Account::kThread);
        auto job = std::make_shared<Job>();
        job->charge = std::move(charge);
        job->reply = later(m);
        job->reply.message().clear();
        if constexpr (kInterrupts) job->reply.onCancel([line = line_] { line->interrupt(); });
        auto run = [this, box = sorm().mailbox(), weak = std::weak_ptr(job), line = line_, work = std::move(work)] {
            auto result = std::make_shared<Result>();
            try {
                result->fill = work(*line);
            } catch (const Failure& f) {
                result->failure = std::make_unique<Failure>(f);
            } catch (const std::exception& e) {
                result->failure = std::make_unique<Failure>(decltype(Failure::trouble)::lost, e.what());
            }
            // The job is ours while the object lives; it goes before the object does.
            box->post([this, weak, result] {
                if (weak.lock()) ended(*result);
            });
        };
        job_ = job;
        try {
            sorma::startDetached(std::move(run));
        } catch (const std::system_error& e) {
            job_ = nullptr;
            job->reply.fail(e);
        }
    }

    // The action -close: when the line is free.
    void closeAction(sorma::Args, sorma::Message&) {
        if (job_) closes_ = true;
        else if (line_) line_->close();
    }
    std::string state() const { return line_ && line_->isOpen() ? "open to " + line_->where() : "closed"; }

    std::shared_ptr<Line> line_;            // null: nobody has needed it yet

private:
    static constexpr bool kInterrupts = requires(Line& line) { line.interrupt(); };
    struct Job {
        sorma::Reply reply;
        sorma::Charge charge;               // for its thread
    };
    struct Result {
        std::function<void(sorma::Message&)> fill;
        std::unique_ptr<Failure> failure;
    };

    void ended(const Result& result) {
        auto job = std::exchange(job_, nullptr);
        job->charge.clear();
        if (std::exchange(closes_, false)) line_->close();
        if (job->reply.cancelled()) return job->reply.complete();       // nobody waits for it
        if (result.failure) return job->reply.fail(errorOf(*result.failure));
        result.fill(job->reply.message());
        job->reply.complete();
    }

    std::shared_ptr<Job> job_;              // the request under way
    bool closes_ = false;                   // when that has ended
};

}  // namespace line
