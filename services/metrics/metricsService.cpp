// metrics -- the figures of this process for Prometheus: by EXEC, and by HTTP when it has a port.
//
//     sormad -name robot -metrics 9101            curl http://127.0.0.1:9101/metrics
//
// An answer is used again for a tenth of a second, so a client that asks more often takes no time from others.
#include <memory>

#include <sorma.h>

#include "figuresText.h"
#include "http.h"

namespace {

using sorma::Message;

const sorma::Prototype kNoPort{sorma::Severity::error, "METRICS PORT", 1, "{}: it has no port; make it with -port"};

class MetricsService : public sorma::Service {
public:
    static sorma::Class describe() {
        return sorma::Class::of<MetricsService>("metrics", "figures of this process for Prometheus")
            .integer("-port", &MetricsService::port_, {.low = -1, .high = 65535, .help = "on 127.0.0.1; 0: a free one; -1: none", .fixed = true})
            .execRight(sorma::Right::inspect)
            .inspection({"-address", "", "where it answers", 0, 0,
                         [](sorma::Service& s, sorma::Args, Message& m) { m.text += static_cast<MetricsService&>(s).address(); }})
            .writes(sorma::Field::text, {}, "", "the figures, in the text format of Prometheus")
            .repeatable()
            .example("metrics EXEC");
    }

    void born() override {
        if (port_ < 0) return;
        http_ = std::make_unique<metrics::Http>(sorm().loop(), int(port_), [this](const std::string& path, const sorma::PrincipalPointer& author) { return answer(path, author); });
    }

    void exec(Message& m) override {
        m.clear();
        m.text = figures();
    }

    void removing() override { http_.reset(); }

private:
    const std::string& figures() {
        const std::int64_t now = sorma::monotonicNow();
        if (now - made_ > kFresh || text_.empty()) {
            text_ = writer_.make(sorm());
            made_ = sorma::monotonicNow();
        }
        return text_;
    }

    metrics::Answer answer(const std::string& path, const sorma::PrincipalPointer& author) {
        if (path != "/metrics") return {404, "the figures are at /metrics\n"};
        try {
            need(author, sorma::Right::inspect);
            return {200, figures()};
        } catch (const sorma::Error& e) {
            return {403, std::string(e.what()) + "\n"};
        }
    }

    std::string address() const {
        if (!http_) fail(kNoPort, name());
        return "127.0.0.1:" + std::to_string(http_->port());
    }

    static constexpr std::int64_t kFresh = 100'000'000;         // [ns]
    std::int64_t port_ = -1, made_ = 0;
    metrics::FiguresText writer_;
    std::string text_;
    std::unique_ptr<metrics::Http> http_;
};

}  // namespace

extern "C" SORMA_EXPORT int Metrics_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::metrics", "1.0", {MetricsService::describe()});
}
