// The object `dict`: the dictionary of its SORM, used like any service object, here or from another process.
#include "bus/call.h"
#include "bus/requestText.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

const Prototype kUnknown{Severity::error, "DICT UNKNOWN", 1, "dict: there is no entry \"{}\""};

class DictService : public Service {
public:
    void exec(Message& m) override {
        std::string word = !m.text.empty() ? m.text : m.words.empty() ? std::string() : m.words[0];
        m.clear();
        m.text = expansion(word);
    }

    void dumpState(std::string& out) const override {
        auto& dictionary = sorm().dictionary();
        out += "# entries " + std::to_string(dictionary.size()) + "\n";
        for (auto& file : dictionary.files()) out += "# file " + file + "\n";
    }

    void add(Args args, Message& m) {
        sorm().access.need(m.author, Right::dictionary, args[0], name());
        sorm().dictionary().add(args[0], {args.begin() + 1, args.end()}, CallContext::currentCallers(), m.author);
        sorm().dictionaryChanged(args[0]);
    }

    void remove(Args args, Message& m) {
        for (auto& word : args) sorm().access.need(m.author, Right::dictionary, word, name());
        for (auto& word : args)
            if (!sorm().dictionary().has(word)) fail(kUnknown, word);
        for (auto& word : args) {
            sorm().dictionary().remove(word);
            sorm().dictionaryChanged(word);
        }
    }

    void get(Args args, Message& reply) {
        auto* words = sorm().dictionary().get(args[0]);
        if (!words) fail(kUnknown, args[0]);
        addLine(reply, joinWords(*words));
    }

    void list(Args args, Message& reply) {
        for (auto& word : sorm().dictionary().words(args.empty() ? "*" : args[0])) addLine(reply, word);
    }

    void expand(Args args, Message& reply) { addLine(reply, expansion(args[0])); }

    void load(Args args, Message& m) {
        needFile(m.author, args[0]);
        sorm().access.need(m.author, Right::dictionary, "*", name());
        sorm().dictionary().load(args[0]);
        sorm().dictionaryChanged({});
    }

    void reload(Args, Message& m) {
        sorm().access.need(m.author, Right::dictionary, "*", name());
        if (sorm().access.restricted()) needFile(nullptr, "*");
        sorm().dictionary().reload();
        sorm().dictionaryChanged({});
    }

    // Without a file only those are written that the owner has had loaded.
    void save(Args args, Message& m) {
        if (!args.empty()) needFile(m.author, args[0]);
        else if (sorm().access.restricted()) needFile(nullptr, "*");
        sorm().access.need(m.author, Right::dictionary, "*", name());
        sorm().dictionary().save(args.empty() ? std::string() : args[0]);
    }

private:
    std::string expansion(const std::string& word) {
        if (!sorm().dictionary().has(word)) fail(kUnknown, word);
        std::vector<std::string> words;
        for (auto& w : sorm().dictionary().expand(word)) words.push_back(w.text);
        return joinWords(words);
    }

    void needFile(const PrincipalPointer& author, const std::string& file) {
        if (author || sorm().access.restricted()) sorm().access.need(author, Right::files, realPath(file), name());
    }

    static void addLine(Message& reply, const std::string& line) {
        if (!reply.text.empty()) reply.text += '\n';
        reply.text += line;
    }
};

}  // namespace

// Each action asks for the right to the entry or the file that it concerns.
Class describeDict() {
    return Class::of<DictService>("dict", "recipes, daemon addresses and default locations: one word expands to many")
        .action("-add", &DictService::add, "word ?expansion ...?", "set an entry; one quoted text is split into words", 1, Action::kRest,
                Right::inspect)
        .action("-remove", &DictService::remove, "word ?word ...?", "take entries out", 1, Action::kRest, Right::inspect)
        .action("-get", &DictService::get, "word", "the words of an entry as they were written", 1, 1, Right::inspect)
        .action("-expand", &DictService::expand, "word", "the words of an entry with every -SUBST spliced in", 1, 1, Right::inspect)
        .action("-list", &DictService::list, "?pattern?", "the words that have an entry", 0, 1, Right::inspect)
        .action("-load", &DictService::load, "file", "read a file, all of it or nothing", 1, 1, Right::inspect)
        .action("-reload", &DictService::reload, "", "read all files again, and forget what they gave before", 0, 0,
                Right::inspect)
        .action("-save", &DictService::save, "?file?", "write back to the file that was loaded last, or to another; comments "
                "and order stay", 0, 1, Right::inspect)
        .reads(Field::text, {}, "", "a word, also without TMSG")
        .writes(Field::text, {}, "", "its expansion")
        .words("?word?")
        .example("dict CTRL -list");
}

}  // namespace sorma
