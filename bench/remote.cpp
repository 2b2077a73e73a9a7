#include "remote.h"

#include <stdexcept>

namespace bench {

namespace {

constexpr const char* kText = "sixteen letters!";
constexpr int kFloats = 10;

sorma::Connection& connectionOf(const sorma::Reference& service) {
    auto* proxy = dynamic_cast<sorma::Proxy*>(service.get());
    if (!proxy) throw std::runtime_error(service->name() + " is served by this process");
    return proxy->connection();
}

}  // namespace

Remote::Remote(Bus& bus, const std::string& address, bool record)
    : record_(record), service_(bus.sorm.get((record ? "echo@" : "nop@") + address)), connection_(connectionOf(service_)) {
    if (!record_) return;
    sent_.text = kText;
    for (int i = 0; i < kFloats; ++i) sent_.floats.push_back(1 / (i + 3.0));
    message_ = sent_;
}

void Remote::check(const sorma::Message& m) const {
    if (m.code != 0 || m.text != sent_.text || m.floats != sent_.floats) throw std::runtime_error("wrong reply");
}

void Remote::call() {
    service_.exec(message_);
    check(message_);
}

std::size_t Remote::requestSize() const {
    sorma::Buffer out;
    sorma::wire::Request request{0, 1, 25'000, sorma::Method::exec, record_ ? "echo" : "nop"};
    sorma::wire::writeCall(out, 1, sorma::wire::kProgram, request, sent_);
    return out.size();
}

std::size_t Remote::replySize() const {
    sorma::Buffer out;
    sorma::wire::writeReply(out, 1, {}, sent_);
    return out.size();
}

}  // namespace bench
