// weights.cpp -- reads the weights that train/ has made, and completes the half that follows by symmetry.
#include <charconv>
#include <mutex>
#include <string_view>

#include "draughts/evaluate.h"

namespace draughts {
namespace {

constexpr std::string_view kIntlText =
#include "draughts/weights/intl.inc"
    ;
constexpr std::string_view kBrazText =
#include "draughts/weights/braz.inc"
    ;
constexpr std::string_view kEnglText =
#include "draughts/weights/engl.inc"
    ;

// First the two weights of each count, in tenths of a point, and ';'. Then the fields' tables, with many pieces and with few, one character an entry, 'O' for 0,
// its successors for 1, 2 ... points; '~', a number and ';' stand for as many entries of 0.
void read(std::string_view text, int stored, int fields, Weights& w) {
    const char *at = text.data(), *end = at + text.size();
    auto number = [&] {
        while (at < end && *at <= ' ') ++at;
        int n = 0;
        at = std::from_chars(at, end, n).ptr;
        return n;
    };
    for (auto& pair : w.counts)
        for (auto& x : pair) x = float(number()) / 10;
    while (at < end && *at++ != ';') {}
    std::size_t n = 0, half = std::size_t(stored) * kFieldSize;
    for (; at < end && n < 2 * half; ++at) {
        if (*at == '~') {
            ++at;
            n += std::size_t(number());
        } else if (*at > ' ') {
            std::int32_t value = (*at - 'O') * (n < half ? 1 : 65536);
            std::size_t field = n % half / kFieldSize, index = n % half % kFieldSize;
            w.fields[n % half] += value;
            std::size_t partner = std::size_t(fields) - 1 - field;
            if (partner != field) w.fields[partner * kFieldSize + std::size_t(turnedIndex(int(index)))] -= value;
            ++n;
        }
    }
}

Weights make(const Rules& rules, bool plain) {
    Weights w{};
    int side = rules.half() - 1, fields = side * side;
    w.fields.assign(std::size_t(fields) * kFieldSize, 0);
    if (plain) {
        w.counts[men] = {100, 100};
        w.counts[kings] = rules.flying ? std::array<float, 2>{300, 300} : std::array<float, 2>{150, 150};
        w.counts[advance] = {2, 2};
    } else {
        read(&rules == &kIntl ? kIntlText : &rules == &kBraz ? kBrazText : kEnglText, (fields + 1) / 2, fields, w);
    }
    return w;
}

}  // namespace

const Weights& weightsOf(const Rules& rules, bool plain) {
    static std::mutex mutex;
    static Weights made[3][2];
    std::lock_guard lock(mutex);
    Weights& w = made[&rules == &kIntl ? 0 : &rules == &kBraz ? 1 : 2][plain];
    if (w.fields.empty()) w = make(rules, plain);
    return w;
}

}  // namespace draughts
