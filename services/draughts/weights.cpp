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

// First the two weights of each count, in tenths of a point, and ';'. Then the fields' tables and the kings' squares, with many
// pieces and with few, one character an entry: 'O' for 0, its neighbours for 1, 2 and more points. A '!' or '}' before it stands for 45
// points less or more. A '~', a number and ';' stand for as many entries of 0.
template <const Rules& R> void read(std::string_view text, Weights& w) {
    using L = Fields<R>;
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
    int n = 0;
    std::int32_t value = 0;
    for (; at < end && n < 2 * L::weights; ++at) {
        if (*at == '~') {
            ++at;
            n += number();
        } else if (*at == '!' || *at == '}') {
            value += *at == '!' ? -45 : 45;
        } else if (*at > ' ') {
            value = (value + *at - 'O') * (n < L::weights ? 1 : 65536);
            int entry = n % L::weights, table = entry / kFieldSize, index = entry % kFieldSize;
            if (table == L::stored) {
                w.kings[std::size_t(index)] += value;
            } else {
                int field = L::field(table), partner = L::partner(field);
                w.fields[std::size_t(field * kFieldSize + index)] += value;
                if (partner != field) w.fields[std::size_t(partner * kFieldSize + turnedIndex(index))] -= value;
            }
            value = 0;
            ++n;
        }
    }
}

template <const Rules& R> Weights make(std::string_view text, bool plain) {
    Weights w{};
    w.fields.assign(std::size_t(Fields<R>::count) * kFieldSize, 0);
    if (plain) {
        w.counts[men] = {100, 100};
        w.counts[kings] = R.flying ? std::array<float, 2>{300, 300} : std::array<float, 2>{150, 150};
        w.counts[advance] = {2, 2};
    } else {
        read<R>(text, w);
    }
    return w;
}

}  // namespace

const Weights& weightsOf(const Rules& rules, bool plain) {
    static std::mutex mutex;
    static Weights made[3][2];
    std::lock_guard lock(mutex);
    int game = &rules == &kIntl ? 0 : &rules == &kBraz ? 1 : 2;
    Weights& w = made[game][plain];
    if (w.fields.empty()) {
        constexpr std::string_view texts[] = {kIntlText, kBrazText, kEnglText};
        w = forGame(rules, [&](auto g) { return make<decltype(g)::rules>(texts[game], plain); });
    }
    return w;
}

}  // namespace draughts
