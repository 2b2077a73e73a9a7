// echo -- gives back what it was sent, at once or after a while: for tests of everything that carries messages.
#include <sorma.h>

namespace {

class Echo : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Echo>("echo", "returns text, floats, ints and any as they came")
            .real("-delay", &Echo::delay_, {.unit = "s", .low = 0, .high = 3600, .help = "wait first"})
            .concurrency(sorma::Concurrency::concurrent)
            .reads(text, {}, "", "anything").reads(floats, {}, "", "").reads(ints, {}, "", "").reads(any, {}, "", "")
            .writes(text, {}, "", "the same").writes(floats, {}, "", "").writes(ints, {}, "", "").writes(any, {}, "", "")
            .example("echo EXEC TMSG hello FMSG 2 1.5 3");
    }

    // At once the message stays as it is: that is the echo. After a while it is the same message, and nobody waits for
    // it but its caller.
    void exec(sorma::Message& m) override {
        if (delay_ <= 0) return;
        sorma::Reply reply = later(m);
        auto timer = std::make_shared<sorma::Timer>(
            sorm().loop().after(sorma::monotonicNow() + std::int64_t(delay_ * 1e9), [reply] { reply.complete(); }));
        reply.onCancel([timer, reply] {
            timer->cancel();
            reply.complete();
        });
    }

private:
    double delay_ = 0;
};

}  // namespace

extern "C" SORMA_EXPORT int Echo_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::echo", "1.0", {Echo::describe()});
}
