// The object `dict`: the dictionary of its SORM, used like any service object, here or from another process.
#include <algorithm>

#include "bus/call.h"
#include "bus/nearest.h"
#include "bus/requestText.h"
#include "bus/sorm.h"
#include "bus/wholeFile.h"

namespace sorma {

namespace {

const Prototype kUnknown{Severity::error, "DICT UNKNOWN", 1, "dict: there is no entry \"{}\"{}"};

bool hasSecrets(const Class& type) {
    return std::any_of(type.options().begin(), type.options().end(), [](auto& o) { return o.spec.secret; });
}

class DictService : public Service {
public:
    void exec(Message& m) override {
        std::string word = !m.text.empty() ? m.text : m.words.empty() ? std::string() : m.words[0];
        const PrincipalPointer author = m.author;
        m.clear();
        m.text = expansion(word, author);
    }

    void dumpState(std::string& out) const override {
        auto& dictionary = sorm().dictionary();
        out += "# entries " + std::to_string(dictionary.size()) + "\n";
        for (auto& file : dictionary.files()) out += "# file " + file + "\n";
    }

    void add(Args args, Message& m) {
        sorm().access.need(m.author, Right::dictionary, args[0], name());
        sorm().dictionary().add(args[0], {args.begin() + 1, args.end()}, CallContext::currentCallers(), m.author,
                                sorm().budget.ofCaller(m.author));
        sorm().dictionaryChanged(args[0]);
    }

    void remove(Args args, Message& m) {
        for (auto& word : args) sorm().access.need(m.author, Right::dictionary, word, name());
        for (auto& word : args)
            if (!sorm().dictionary().has(word)) failUnknown(word);
        for (auto& word : args) {
            sorm().dictionary().remove(word);
            sorm().dictionaryChanged(word);
        }
    }

    void get(Args args, Message& reply) {
        auto* words = sorm().dictionary().get(args[0]);
        if (!words) failUnknown(args[0]);
        addLine(reply, joinWords(showsSecrets(args[0], reply.author) ? *words : sorm().masked(*words)));
    }

    void list(Args args, Message& reply) {
        for (auto& word : sorm().dictionary().words(args.empty() ? "*" : args[0])) addLine(reply, word);
    }

    void expand(Args args, Message& reply) { addLine(reply, expansion(args[0], reply.author)); }

    void load(Message& m, const Named<Kind::file>& file) {
        sorm().access.need(m.author, Right::dictionary, "*", name());
        const Permit permit = file.permit(*this);
        sorm().dictionary().load(file.get(permit), permit);
        sorm().dictionaryChanged({});
    }

    void reload(Args, Message& m) {
        sorm().access.need(m.author, Right::dictionary, "*", name());
        if (sorm().access.restricted()) needFile("*");
        sorm().dictionary().reload();
        sorm().dictionaryChanged({});
    }

    // Without a file only those are written that the owner has had loaded.
    void save(Message& m, const Named<Kind::file>& file) {
        if (file.empty() && sorm().access.restricted()) needFile("*");
        sorm().access.need(m.author, Right::dictionary, "*", name());
        const Permit permit = file.permit(*this);
        if (file.empty()) sorm().dictionary().save();
        else sorm().dictionary().save(file.get(permit), permit);
    }

    void leftOut(Args, Message& reply) {
        for (auto& line : sorm().dictionary().leftOut()) addLine(reply, line);
    }

private:
    [[noreturn]] void failUnknown(const std::string& word) { fail(kUnknown, word, didYouMean(word, sorm().dictionary().words())); }

    // May the viewer see secrets there? In the recipe of an object he must have the right to set its options.
    bool showsSecrets(const std::string& entry, const PrincipalPointer& viewer) {
        if (!Name::isName(entry) || Name::isElsewhere(entry)) return !viewer;
        auto* type = sorm().findClass(Name::parse(entry).className);
        return (!viewer || (type && hasSecrets(*type))) && mayConfigure(entry, viewer);
    }
    bool mayConfigure(const std::string& entry, const PrincipalPointer& viewer) {
        return sorm().access.rights(viewer, entry) & Rights(Right::configure);
    }

    std::string expansion(const std::string& word, const PrincipalPointer& viewer) {
        if (!sorm().dictionary().has(word)) failUnknown(word);
        std::vector<std::string> words;
        bool may = showsSecrets(word, viewer);
        for (auto& w : sorm().dictionary().expand(word)) {
            words.push_back(w.text);
            for (auto& entry : w.origin.via) may = may && mayConfigure(entry, viewer);
        }
        return joinWords(may ? words : sorm().masked(std::move(words)));
    }

    void needFile(const std::string& file) { sorm().access.need(nullptr, Right::files, realPath(file), name()); }

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
        .action("-load", &DictService::load, "file", "read a file, all of it or nothing", 1, Right::inspect)
        .action("-reload", &DictService::reload, "", "read all files again, and forget what they gave before", 0, 0,
                Right::inspect)
        .action("-leftOut", &DictService::leftOut, "", "what was wrong in SORMA_DICT, or in other variables, and was left out: a line for each", 0, 0,
                Right::inspect)
        .action("-save", &DictService::save, "?file?", "write back to the file that was loaded last, or to another; comments "
                "and order stay", 0, Right::inspect)
        .actsOnWords()
        .reads(Field::text, {}, "", "a word, also without TMSG")
        .writes(Field::text, {}, "", "its expansion")
        .words("?word?")
        .repeatable({"", "-get", "-expand", "-list", "-leftOut"})
        .example("dict CTRL -list");
}

}  // namespace sorma
