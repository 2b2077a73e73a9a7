#include "bus/monitor.h"

#include <algorithm>

#include "bus/access.h"
#include "bus/call.h"
#include "bus/requestText.h"
#include "bus/service.h"
#include "bus/sorm.h"

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

class Monitor : public Observer {
public:
    explicit Monitor(Sorm& sorm) : sorm_(sorm) {}

    void came(const Passage& p, const Message& m) override {
        Message event;
        const bool hidden = p.method == Method::ctrl && p.service && sorm_.awaitsSecrets(p.service->name());
        event.text = hidden ? std::string(kMask) : sorm_.masked(partsText(m));
        event.words = wordsOf(p);
        sorm_.monitor("monitor.request", event);
    }
    void answered(const Passage& p, const Message& m, std::int64_t ran) override {
        Message event;
        auto* cause = m.code < 0 ? m.trail.cause() : nullptr;
        event.text = cause ? cause->text.substr(0, kMostText) : mayTellSecrets(p) ? std::string(kMask) : partsText(m);
        event.words = wordsOf(p);
        event.words.push_back(std::to_string(m.code));
        event.ints.push_back(ran / 1000);
        sorm_.monitor("monitor.reply", event);
    }

private:
    // The reply to words of CTRL and DBX may hold the values of options.
    bool mayTellSecrets(const Passage& p) const {
        Service* object = p.method == Method::exec && p.object != "sorm" ? nullptr : sorm_.find(p.object);
        return object && sorm_.holdsSecrets(*object);
    }
    static std::vector<std::string> wordsOf(const Passage& p) {
        return {std::string(p.object), toText(p.method), p.callers(), std::to_string(p.number)};
    }
    Sorm& sorm_;
};

}  // namespace

std::unique_ptr<Observer> makeMonitor(Sorm& sorm) { return std::make_unique<Monitor>(sorm); }

void tellPassing(const Service& from, std::string_view name, const Message& m) {
    Message event;
    event.text = partsText(m);
    event.words = {from.name(), std::string(name)};
    from.sorm().monitor("monitor.event", event);
}

bool concealed(const Event& event, const Sorm& sorm, const PrincipalPointer& author) {
    if (!author || event.object != "sorm" || event.message.words.empty() || event.message.words[0].empty()) return false;
    bool tells = event.name == "object.changed" || event.name.starts_with("trail.") || event.name.starts_with(kPrefix);
    if (!tells) return false;
    // Requests to sorm and their answers may hold values of any object.
    const std::string& about = event.message.words[0];
    return (about == "sorm" && event.name.starts_with(kPrefix)) || !tellable(about, sorm, author);
}

bool tellable(const std::string& object, const Sorm& sorm, const PrincipalPointer& author) {
    std::string about = object;
    try {
        about = sorm.canonical(about);
    } catch (const Error&) {            // a request for what is no name: nobody's
    }
    return sorm.access.rights(author, about) & Rights(Right::inspect);
}

// The words of a monitor are no contents; those of other events may be.
std::vector<std::string> bareWords(const Event& event) {
    auto& words = event.message.words;
    if (event.name.starts_with(kPrefix)) return words;
    return {words.begin(), words.begin() + 1};
}

}  // namespace sorma
