#include "bus/kept.h"

namespace sorma {

namespace {

// "9 999 950"
std::string grouped(std::size_t number) {
    std::string out = std::to_string(number);
    for (std::size_t at = out.size(); at > 3; at -= 3) out.insert(at - 3, 1, ' ');
    return out;
}

}  // namespace

std::string cutText(std::string_view text, std::size_t most) {
    if (text.size() <= most) return std::string(text);
    constexpr std::size_t kNote = 40;               // of which the note takes less
    std::size_t shown = most > kNote ? most - kNote : 0;
    while (shown > 0 && (static_cast<unsigned char>(text[shown]) & 0xc0) == 0x80) --shown;
    return std::string(text.substr(0, shown)) + "... " + grouped(text.size() - shown) + " bytes more";
}

void cutInPlace(std::string& text, std::size_t most) {
    if (text.size() > most) text = cutText(text, most);
}

Trail cutTrail(const Trail& trail) {
    Trail out;
    for (auto& e : trail.entries()) {
        Entry kept;
        kept.severity = e.severity;
        kept.symbol = cutText(e.symbol);
        for (auto& d : e.details) {
            if (kept.details.size() == 16) break;
            kept.details.push_back(cutText(d));
        }
        kept.text = cutText(e.text);
        kept.so = cutText(e.so, kKeptName);
        kept.daemon = cutText(e.daemon, kKeptName);
        kept.file = cutText(e.file, kKeptName);
        kept.line = e.line;
        kept.time = e.time;
        kept.request = cutText(e.request);
        out.add(std::move(kept));
    }
    out.setDropped(out.dropped() + trail.dropped());
    return out;
}

std::size_t heapOf(const std::string& text) {
    const char* inside = reinterpret_cast<const char*>(&text);
    return text.data() >= inside && text.data() < inside + sizeof text ? 0 : text.capacity() + 1;
}

std::size_t heapOf(const Entry& e) {
    return heapOf(e.symbol) + heapOf(e.details) + heapOf(e.text) + heapOf(e.so) + heapOf(e.daemon) + heapOf(e.file) + heapOf(e.request);
}

std::size_t heapOf(const Trail& trail) { return heapOf(trail.entries()); }

std::size_t heapOf(const Message& m) {
    return heapOf(m.text) + heapOf(m.floats) + heapOf(m.ints) + heapOf(m.any) + heapOf(m.words) + heapOf(m.trail);
}

}  // namespace sorma
