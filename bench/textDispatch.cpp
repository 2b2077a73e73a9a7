// textDispatch.cpp -- a request in text, a reply in text.
#include "rows.h"

#include <charconv>
#include <random>
#include <unordered_map>

#include "interpreter.h"

namespace bench {

namespace {

const std::vector<Case> kCases = {
    {"S", "text dispatch: \"nop EXEC\"", "look-up of the name in a hash table", 4, 200},
    {"S10", "text dispatch: \"echo EXEC FMSG 10 x ...\"", "ten from_chars and ten to_chars, 17 digits", 1.5},
};

struct Hash {
    using is_transparent = void;
    std::size_t operator()(std::string_view s) const { return std::hash<std::string_view>{}(s); }
};
using Directory = std::unordered_map<std::string, int, Hash, std::equal_to<>>;

}  // namespace

void textDispatch(Table& table) {
    if (!table.wantsAny(kCases)) return;
    Interpreter interpreter;
    sorma::Sorm& sorm = interpreter.sorm();
    for (auto name : {"nop", "echo"}) sorm.get(name);
    Directory directory;
    for (auto& name : sorm.names()) directory.emplace(name, 1);

    std::string reply, request = "nop EXEC";
    std::string_view name = "nop";
    table.measure(kCases[0],
                  repeat([&] {
                      keep(request);
                      sorm.dispatch(request, reply);
                      keep(reply);
                  }),
                  repeat([&] {
                      keep(name);
                      auto found = directory.find(name);
                      keep(found);
                  }));
    if (reply != "nop RET 0") throw std::runtime_error("S: unexpected reply " + reply);

    // Numbers that need all their digits, as measured ones do.
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1000);
    std::vector<std::string> texts;
    std::string ten = "echo EXEC FMSG 10", expected = "echo RET 0 FMSG 10";
    while (texts.size() < 10) {
        char text[40];
        std::string digits(text, std::to_chars(text, text + sizeof text, uniform(random)).ptr);
        if (digits.size() < 18) continue;       // 17 digits and the point
        texts.push_back(digits);
        ten += " " + digits;
        expected += " " + digits;
    }
    double values[10];
    char out[40];
    table.measure(kCases[1],
                  repeat([&] {
                      keep(ten);
                      sorm.dispatch(ten, reply);
                      keep(reply);
                  }),
                  repeat([&] {
                      for (int i = 0; i < 10; ++i) {
                          std::from_chars(texts[i].data(), texts[i].data() + texts[i].size(), values[i]);
                          keep(values[i]);
                      }
                      for (double value : values) {
                          auto end = std::to_chars(out, out + sizeof out, value);
                          keep(end);
                      }
                  }));
    if (reply != expected && table.wants("S10")) throw std::runtime_error("S10: unexpected reply " + reply);
}

}  // namespace bench
