#include "bus/monitor.h"

#include <algorithm>

#include "bus/requestText.h"
#include "bus/service.h"

namespace sorma {

namespace {

constexpr std::string_view kPrefix = "monitor.";
constexpr std::size_t kMostText = 400, kMostNumbers = 12;

// A message of which people see the beginning. left: what is not in it.
Message abridged(const Message& m, std::string& left) {
    Message out;
    auto note = [&](std::size_t all, std::size_t shown, const char* what) {
        if (all > shown) left += " ... " + std::to_string(all) + " " + what;
    };
    std::size_t size = std::min(m.text.size(), kMostText);
    while (size < m.text.size() && size > 0 && (static_cast<unsigned char>(m.text[size]) & 0xc0) == 0x80) --size;
    out.text = m.text.substr(0, size);
    out.floats.assign(m.floats.begin(), m.floats.begin() + std::ptrdiff_t(std::min(m.floats.size(), kMostNumbers)));
    out.ints.assign(m.ints.begin(), m.ints.begin() + std::ptrdiff_t(std::min(m.ints.size(), kMostNumbers)));
    std::size_t used = 0;
    for (auto& w : m.words) {
        if (used > kMostText) break;
        out.words.push_back(w.substr(0, kMostText));
        used += out.words.back().size();
    }
    out.code = m.code;
    note(m.text.size(), out.text.size(), "bytes of text");
    note(m.floats.size(), out.floats.size(), "floats");
    note(m.ints.size(), out.ints.size(), "ints");
    note(m.words.size(), out.words.size(), "words");
    note(m.any.size(), 0, "bytes");
    return out;
}

std::string partsText(const Message& m) {
    std::string left, text;
    Message shown = abridged(m, left);
    appendParts(text, shown);
    for (auto& w : shown.words) appendWord(text, w, true);
    return text + left;
}

}  // namespace

void Passing::begin(std::uint64_t number, std::string_view service, Method method, const Message& m) {
    started_ = monotonicNow();
    words_ = {std::string(service), toText(method), CallContext::currentCallers(), std::to_string(number)};
    Message event;
    event.text = partsText(m);
    event.words = words_;
    sorm_.monitor("monitor.request", event);
}

void Passing::end(const Message& m, std::int64_t ran) {
    Message event;
    auto* cause = m.code < 0 ? m.trail.cause() : nullptr;
    event.text = cause ? cause->text.substr(0, kMostText) : partsText(m);
    event.words = words_;
    event.words.push_back(std::to_string(m.code));
    event.ints.push_back(ran);
    sorm_.monitor("monitor.reply", event);
}

void Passing::later(const PendingPointer& pending) {
    if (started_ == 0) return;
    // Not the pending itself: it would keep itself.
    pending->whenAnswered([self = *this, p = pending.get()]() mutable {
        std::int64_t ran = (monotonicNow() - self.started_) / 1000;
        if (!p->failed()) return self.end(p->message, ran);
        Message m;
        m.code = -1;
        m.trail = p->failure;
        self.end(m, ran);
    });
}

void tellPassing(const Service& from, std::string_view name, const Message& m) {
    Message event;
    event.text = partsText(m);
    event.words = {from.name(), std::string(name)};
    from.sorm().monitor("monitor.event", event);
}

bool concealed(const Event& event, const Access& access, const PrincipalPointer& author) {
    if (!author || !event.name.starts_with(kPrefix) || event.object != "sorm" || event.message.words.empty()) return false;
    return !(access.rights(author, event.message.words[0]) & Rights(Right::inspect));
}

}  // namespace sorma
