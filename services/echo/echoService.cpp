// echo -- gives back what it was sent, at once or after a while: for tests of everything that carries messages.
#include <sorma.h>

namespace {

class Echo : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Echo>("echo", "returns text, floats, ints and any as they came")
            .real("-delay", &Echo::delay_, {.unit = "s", .low = 0, .high = 3600, .help = "wait first"})
            .integer("-times", &Echo::times_, {.low = 1, .high = 1e15, .help = "as a stream: give the message so many times"})
            .concurrency(sorma::Concurrency::concurrent)
            .reads(text, {}, "", "anything").reads(floats, {}, "", "").reads(ints, {}, "", "").reads(any, {}, "", "")
            .writes(text, {}, "", "the same").writes(floats, {}, "", "").writes(ints, {}, "", "").writes(any, {}, "", "")
            .repeatable()
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

    // Bytes are filled up to the size of a piece; of other parts each piece has one message.
    std::unique_ptr<sorma::Pieces> inPieces(sorma::Message& request) override {
        if (times_ == 1) return nullptr;
        sorma::Message one;
        one.swap(request);
        one.author.reset();
        const bool bytes = sorma::isEnd(one) ? false : one.text.empty() && one.floats.empty() && one.ints.empty();
        return sorma::piecesOf([one = std::move(one), bytes, left = times_](sorma::Message& piece, std::size_t most) mutable {
            if (left == 0) return;
            if (!bytes) {
                --left;
                piece.text = one.text;
                piece.floats = one.floats;
                piece.ints = one.ints;
            }
            do {
                piece.any.insert(piece.any.end(), one.any.begin(), one.any.end());
                if (bytes) --left;
            } while (bytes && left > 0 && piece.any.size() + one.any.size() <= most);
        });
    }

private:
    double delay_ = 0;
    std::int64_t times_ = 1;
};

}  // namespace

extern "C" SORMA_EXPORT int Echo_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::echo", "1.0", {Echo::describe()});
}
