// dictionaryFuzz.cpp -- any text as a dictionary file.
//
// It is refused and changes nothing, or all its words expand in bounded time, and addresses are followed to an end. A file that is written
// from the entries has the same entries again.
//
// Build with -fsanitize=fuzzer,address,undefined together with
// generic/bus/{trail,catalogue,deadline,message,requestText,name,dictionary,glob}.cpp
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "bus/catalogue.h"
#include "bus/dictionary.h"
#include "bus/name.h"

using namespace sorma;

namespace {

void demand(bool condition, const char* what, const std::string& text) {
    if (condition) return;
    std::fprintf(stderr, "%s: %s\n", what, text.c_str());
    std::abort();
}

bool same(const Dictionary& a, const Dictionary& b) {
    if (a.words() != b.words()) return false;
    for (auto& word : a.words())
        if (*a.get(word) != *b.get(word)) return false;
    return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const std::string file = "/tmp/sorma-dictionaryFuzz-" + std::to_string(getpid());
    std::string_view text(reinterpret_cast<const char*>(data), size);
    Dictionary d;
    d.add("base", {"-x", "1"}, "fuzz");
    try {
        d.loadText(text, "fuzz.dict");
    } catch (const Error& e) {
        demand(e.is("DICT SYNTAX") || e.is("DICT LOOP"), "another error", e.what());
        demand(d.size() == 1 && d.get("base")->size() == 2, "a refused text changed something", e.what());
        return 0;
    }
    for (auto& word : d.words()) {
        try {
            d.expand(word);
        } catch (const Error& e) {
            demand(e.is("DICT SYNTAX") || e.is("DICT UNKNOWN"), "another error", e.what());
        }
        std::string name = word.starts_with('@') ? "nop" + word : word;
        if (!Name::isName(name)) continue;
        try {
            Name parsed = Name::parse(name);
            demand(Name::parse(parsed.toText()).toText() == parsed.toText(), "a name changes", name);
            Address address = resolve(parsed, d);
            // The text does not say what stands beside it in the entry.
            const Address again = Address::parse(address.toText());
            demand(again.kind == address.kind && again.host == address.host && again.number == address.number, "an address changes", address.toText());
        } catch (const Error& e) {
            demand(e.is("ADDRESS UNRESOLVED") || e.is("DICT LOOP") || e.is("DICT SYNTAX"), "another error", e.what());
        }
    }
    if (size % 16 != 0) return 0;       // files are slow: some will do
    // The same text as a file, with one entry changed, one new and one removed.
    {
        std::ofstream out(file, std::ios::binary | std::ios::trunc);
        out << text;
    }
    Dictionary edited;
    edited.load(file, Permit::owner());
    auto words = edited.words();
    if (!words.empty()) edited.add(words[size / 16 % words.size()], {"changed", "#\\", "a b\n"}, "fuzz");
    if (words.size() > 1) edited.remove(words[(size / 16 + 1) % words.size()]);
    edited.add("brand.new", {"1"}, "fuzz");
    edited.save();
    Dictionary back;
    back.load(file, Permit::owner());
    demand(same(edited, back), "a saved file differs", std::string(text));
    std::remove(file.c_str());
    return 0;
}
