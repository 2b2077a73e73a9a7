// busDictionary.cpp -- checks of the dictionary: its entries, its files, and files that others change.
#include <sys/stat.h>
#include <unistd.h>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <random>

#include "busText.h"
#include "bus/dictionary.h"

using namespace sorma;

namespace {

std::string get(const Dictionary& d, std::string_view word) {
    auto* found = d.get(word);
    return found ? brackets(*found) : "none";
}

std::string expanded(const Dictionary& d, std::string_view word) {
    std::vector<std::string> out;
    for (auto& w : d.expand(word)) out.push_back(w.text);
    return brackets(out);
}

// A folder of this test alone, removed with it.
class Folder {
public:
    Folder() {
        char name[] = "/tmp/sorma-busText-XXXXXX";
        path_ = mkdtemp(name);
    }
    ~Folder() {
        std::string command = "rm -rf " + path_;
        if (std::system(command.c_str()) != 0) std::perror("rm");
    }
    std::string write(const std::string& name, std::string_view content) {
        std::ofstream(path_ + '/' + name, std::ios::binary) << content;
        return path_ + '/' + name;
    }
    std::string file(const std::string& name) { return path_ + '/' + name; }
    static std::string read(const std::string& file) {
        std::ifstream in(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

private:
    std::string path_;
};

void testDictionary() {
    Dictionary d;
    d.loadText("\xef\xbb\xbf# comment \"unbalanced\n"
               "carry   -transferSpeed 0.5 \\\n   -greeting 'good morning' # and so on\n"
               "\n  carry.slow\t-SUBST carry -transferSpeed 0.2\r\n"
               "@robot localhost:7014\n"
               "twice a\n"
               "odd a#b '#c' {#d} #e {\n"
               "empty\n"
               "# a comment \\\n goes on\n"
               "dos a\\\\\n"
               "twice b c", "t.dict");
    EQUAL(d.size(), 7u);
    EQUAL(get(d, "carry"), "[-transferSpeed][0.5][-greeting][good morning]");
    EQUAL(get(d, "carry.slow"), "[-SUBST][carry][-transferSpeed][0.2]");
    EQUAL(expanded(d, "carry.slow"), "[-transferSpeed][0.5][-greeting][good morning][-transferSpeed][0.2]");
    EQUAL(get(d, "twice"), "[b][c]");
    EQUAL(get(d, "odd"), "[a#b][#c][#d]");
    EQUAL(get(d, "empty"), "");
    EQUAL(get(d, "dos"), "[a\\\\]");
    EQUAL(get(d, "goes"), "none");
    CHECK(d.has("empty") && !d.has("Empty"));
    EQUAL(expanded(d, "nothing"), "");
    EQUAL(brackets(d.words("carry*")), "[carry][carry.slow]");
    EQUAL(brackets(d.words()), "[@robot][carry][carry.slow][dos][empty][odd][twice]");

    auto origins = d.expand("carry.slow");
    EQUAL(origins[1].origin.toText(), "t.dict:2 via carry");
    EQUAL(origins[5].origin.toText(), "t.dict:5");
    d.add("carry.fast", {"-SUBST carry.slow -x 'a b'"}, "joe@lab sormad[77]");
    origins = d.expand("carry.fast");
    EQUAL(expanded(d, "carry.fast"), "[-transferSpeed][0.5][-greeting][good morning][-transferSpeed][0.2][-x][a b]");
    EQUAL(origins[0].origin.toText(), "t.dict:2 via carry.slow -> carry");
    EQUAL(origins[6].origin.toText(), "added by joe@lab sormad[77]");
    d.add("a", {"-x", "a b"}, "");
    EQUAL(get(d, "a"), "[-x][a b]");
    d.add("a", {"single"}, "");
    EQUAL(get(d, "a"), "[single]");
    d.add("a", {}, "");
    EQUAL(get(d, "a"), "");
    CHECK(d.remove("a") && !d.remove("a"));

    // Refused, and nothing changes.
    FAILS(d.add("carry", {"-SUBST", "carry.fast"}, ""), "DICT LOOP carry",
          "dictionary entry carry: -SUBST leads in a loop: carry -> carry.fast -> carry.slow -> carry");
    EQUAL(get(d, "carry"), "[-transferSpeed][0.5][-greeting][good morning]");
    FAILS(d.add("self", {"-SUBST", "self"}, ""), "DICT LOOP self", "dictionary entry self: -SUBST leads in a loop: self -> self");
    FAILS(d.add("", {}, ""), "DICT SYNTAX", "dictionary entry \"\": the word is empty");
    FAILS(d.add("#a", {}, ""), "DICT SYNTAX #a", "dictionary entry \"#a\": the word begins with #, like a comment");
    FAILS(d.add("\xef\xbb\xbf" "a", {}, ""), "DICT SYNTAX", "dictionary entry \"\xef\xbb\xbf" "a\": the word begins with a byte order mark");
    FAILS(d.add("a b", {}, ""), "DICT SYNTAX {a b}", "dictionary entry \"a b\": the word holds white space");
    FAILS(d.add("a", {"-x", "-SUBST"}, ""), "DICT SYNTAX a", "dictionary entry \"a\": -SUBST needs the word of an entry after it");
    FAILS(d.add("a", {"-x 'b"}, ""), "DICT SYNTAX a", "dictionary entry \"a\": word 2: expected a closing ', got the end of the text");
    FAILS(d.add("a", {"\xff"}, ""), "DICT SYNTAX a", "dictionary entry \"a\": \"\xef\xbf\xbd\" is not UTF-8");
    CHECK(!d.has("a") && !d.has("self"));

    FAILS(d.loadText("ok 1\nbad {a\n", "u.dict"), "DICT SYNTAX u.dict 2", "u.dict:2: word 2: expected a closing }, got the end of the text");
    FAILS(d.loadText("ok 1\n\nbad -SUBST\n", "u.dict"), "DICT SYNTAX u.dict 3", "u.dict:3: -SUBST needs the word of an entry after it");
    FAILS(d.loadText("'a b' c\n", "u.dict"), "DICT SYNTAX u.dict 1", "u.dict:1: the word holds white space");
    FAILS(d.loadText("'#a' c\n", "u.dict"), "DICT SYNTAX u.dict 1", "u.dict:1: the word begins with #, like a comment");
    FAILS(d.loadText("ok 1\nbad \xff\n", "u.dict"), "DICT SYNTAX u.dict 2", "u.dict:2: the line is not UTF-8");
    FAILS(d.loadText("ok 1\np -SUBST p\n", "u.dict"), "DICT LOOP p", "dictionary entry p: -SUBST leads in a loop: p -> p (u.dict:2)");
    CHECK(!d.has("ok") && !d.has("p"));
    FAILS(d.load("/nonexistent/x.dict", Permit::owner()), "DICT FILE /nonexistent/x.dict", "cannot read dictionary file \"/nonexistent/x.dict\": No such file or directory");
    FAILS(d.load("/tmp", Permit::owner()), "DICT FILE /tmp", "cannot read dictionary file \"/tmp\": Is a directory");
}

void testLoops() {
    auto loop = [](std::string_view t, const std::string& word, const std::string& message, int line) {
        Dictionary d;
        fails([&] { d.loadText(t, "l.dict"); }, "DICT LOOP " + word, message, line, "loop");
        note(d.size() == 0, line, "nothing changes");
    };
    loop("a x -SUBST a\n", "a", "dictionary entry a: -SUBST leads in a loop: a -> a (l.dict:1)", __LINE__);
    Dictionary across;
    across.loadText("a -SUBST b\nc 1\n", "1.dict");
    FAILS(across.loadText("b -SUBST a\n", "2.dict"), "DICT LOOP b", "dictionary entry b: -SUBST leads in a loop: b -> a -> b (2.dict:1)");
    CHECK(!across.has("b"));
    across.loadText("b -SUBST c -SUBST c\n", "2.dict");     // twice is no loop
    EQUAL(expanded(across, "a"), "[1][1]");

    // Entries that double at each step are bounded, and so is depth; neither is an error to load.
    Dictionary bomb;
    std::string t = "x0 word\n", chain = "y0 word\n";
    for (int i = 1; i <= 60; ++i) t += "x" + std::to_string(i) + " -SUBST x" + std::to_string(i - 1) + " -SUBST x" + std::to_string(i - 1) + "\n";
    for (int i = 1; i <= 20000; ++i) chain += "y" + std::to_string(i) + " -SUBST y" + std::to_string(i - 1) + "\n";
    bomb.loadText(t + chain, "b.dict");
    FAILS(bomb.expand("x60"), "DICT SYNTAX x60", "dictionary entry x60: its expansion exceeds 10000 words");
    FAILS(bomb.expand("y20000"), "DICT SYNTAX y20000", "dictionary entry y20000: its expansion exceeds 200 levels of -SUBST");
    EQUAL(expanded(bomb, "y200"), "[word]");
    FAILS(bomb.add("y0", {"-SUBST", "y3"}, ""), "DICT LOOP", "dictionary entry y0: -SUBST leads in a loop: y0 -> y3 -> y2 -> y1 -> y0");
}

void testSave() {
    Folder folder;
    const std::string original =
        "# robots\n"
        "carry      -speed 0.5   -grip soft   # keep\n"
        "carry.slow -SUBST carry \\\n"
        "           -speed 0.2   # joined\n"
        "\n"
        "  bar\t\t-tea 1.5 \r\n"
        "gone 1 2\n"
        "# end";
    std::string file = folder.write("a.dict", original);
    chmod(file.c_str(), 0640);
    Dictionary d;
    FAILS(d.save(), "DICT FILE", "no dictionary file is loaded; name the one to write: dict CTRL -save FILE");
    d.load(file, Permit::owner());
    d.save();
    EQUAL(Folder::read(file), original);

    d.add("carry", {"-speed", "0.7", "", "two words", "#x", "a\\", "new\nline"}, "joe");
    d.add("bar", {"-tea", "2"}, "joe");
    d.add("zoo", {"1"}, "joe");
    d.add("new", {"-x", "y"}, "joe");
    d.remove("gone");
    EQUAL(d.expand("carry")[0].origin.toText(), "added by joe");
    d.save();
    EQUAL(Folder::read(file),
          "# robots\n"
          "carry      -speed 0.7 {} {two words} {#x} \"a\\\\\" \"new\\nline\"  # keep\n"
          "carry.slow -SUBST carry \\\n"
          "           -speed 0.2   # joined\n"
          "\n"
          "  bar\t\t-tea 2\r\n"
          "# end\n"
          "new -x y\n"
          "zoo 1\n");
    struct stat s {};
    stat(file.c_str(), &s);
    EQUAL(s.st_mode & 07777, 0640u);
    EQUAL(d.expand("zoo")[0].origin.toText(), file + ":9");
    EQUAL(d.expand("bar")[0].origin.toText(), file + ":6");
    Dictionary again;
    again.load(file, Permit::owner());
    for (auto& w : d.words()) EQUAL(get(again, w), get(d, w));
    EQUAL(again.size(), d.size());

    // A line that was joined becomes one line; an entry removed and added again keeps its place.
    d.add("carry.slow", {"-SUBST", "carry"}, "joe");
    d.remove("bar");
    d.add("bar", {"-tea", "3"}, "joe");
    d.save();
    CHECK(Folder::read(file).find("\ncarry.slow -SUBST carry  # joined\n\n  bar\t\t-tea 3\r\n") != std::string::npos);
}

void testSaveEdited() {
    Folder folder;
    const std::string file = folder.write("a.dict", "carry 1\nnew -x y\nzoo 1\n");
    Dictionary d;
    d.load(file, Permit::owner());
    // Lines that others wrote meanwhile stay, and entries are found again.
    const std::string edited = "# someone was here\nother 1\n" + Folder::read(file) + "spoilt {\n";
    folder.write("a.dict", edited);
    d.add("zoo", {"2"}, "joe");
    d.save();
    std::string wanted = edited;
    wanted.replace(wanted.find("zoo 1"), 5, "zoo 2");
    EQUAL(Folder::read(file), wanted);
    EQUAL(get(d, "other"), "none");
    FAILS(d.reload(), "DICT SYNTAX", file + ":6: word 2: expected a closing }, got the end of the text");
    EQUAL(get(d, "other"), "none");
    folder.write("a.dict", edited.substr(0, edited.size() - 9));
    d.add("runtime", {"1"}, "joe");
    d.add("zoo", {"3"}, "joe");
    d.remove("new");
    d.reload();
    EQUAL(get(d, "other"), "[1]");
    EQUAL(get(d, "zoo"), "[1]");            // as the file says
    EQUAL(get(d, "new"), "[-x][y]");
    EQUAL(get(d, "runtime"), "[1]");        // no file knew it
}

void testSaveFiles() {
    Folder folder;
    std::string first = folder.write("1.dict", "a 1\nshared 1\n"), second = folder.write("2.dict", "b 1\nshared 2\n");
    Dictionary d;
    d.load(first, Permit::owner());
    d.load(second, Permit::owner());
    EQUAL(brackets(d.files()), "[" + first + "][" + second + "]");
    d.add("a", {"2"}, "");
    d.add("n", {"1"}, "");
    d.save();
    EQUAL(Folder::read(first), "a 2\nshared 1\n");
    EQUAL(Folder::read(second), "b 1\nshared 2\nn 1\n");
    // A copy of everything, which is not loaded by that.
    std::string copy = folder.write("copy.dict", "# mine\nb 7\nkept\n");
    d.save(copy, Permit::owner());
    EQUAL(Folder::read(copy), "# mine\nb 1\nkept\na 2\nn 1\nshared 2\n");
    EQUAL(d.files().size(), 2u);
    // A file that has gone is written anew.
    unlink(second.c_str());
    d.add("b", {"2"}, "");
    d.save(second, Permit::owner());
    EQUAL(Folder::read(second), "b 2\nn 1\nshared 2\n");
    // The first file ever becomes the one that -save means; a symbolic link stays one.
    Dictionary fresh;
    std::string target = folder.write("target", "x 1 \\"), link = folder.file("link");
    CHECK(symlink(target.c_str(), link.c_str()) == 0);
    fresh.add("y", {"1"}, "");
    fresh.save(link, Permit::owner());
    EQUAL(Folder::read(target), "x 1 \\\n\ny 1\n");
    struct stat s {};
    CHECK(lstat(link.c_str(), &s) == 0 && S_ISLNK(s.st_mode));
    fresh.add("y", {"2"}, "");
    fresh.save();
    EQUAL(Folder::read(target), "x 1 \\\n\ny 2\n");
    FAILS(fresh.save(folder.file("no/such/folder"), Permit::owner()), "DICT FILE",
          "cannot write dictionary file \"" + folder.file("no/such/folder") + "\": No such file or directory");
    // No temporary file is left.
    std::string list = "ls " + folder.file("") + " | grep -c new-";
    FILE* pipe = popen((list + " || true").c_str(), "r");
    char count[16] = "";
    CHECK(pipe && std::fgets(count, sizeof count, pipe));
    if (pipe) pclose(pipe);
    EQUAL(std::string(count), "0\n");
    // Text that is no file is changed at run time only.
    Dictionary builtin;
    builtin.loadText("c 1\n", "builtin");
    builtin.add("c", {"2"}, "joe");
    builtin.save(folder.file("c.dict"), Permit::owner());
    EQUAL(Folder::read(folder.file("c.dict")), "c 2\n");
}

void testEnvironment() {
    Folder folder;
    std::string first = folder.write("1.dict", "a 1\nb 1\n"), second = folder.write("2.dict", "b 2\n");
    setenv("SORMA_DICT", (first + "::" + second + ":").c_str(), 1);
    setenv("SORMA_ENTRY_carry", "-speed 0.5 'a b'", 1);
    setenv("SORMA_ENTRY_one", "{a b}", 1);
    Dictionary d;
    d.loadEnvironment();
    EQUAL(get(d, "a"), "[1]");
    EQUAL(get(d, "b"), "[2]");
    EQUAL(get(d, "carry"), "[-speed][0.5][a b]");
    EQUAL(get(d, "one"), "[a b]");
    EQUAL(d.expand("one")[0].origin.toText(), "added by environment variable SORMA_ENTRY_one");
    setenv("SORMA_ENTRY_carry", "{", 1);
    d.loadEnvironment();
    EQUAL(d.leftOut().size(), std::size_t{1});
    EQUAL(d.leftOut()[0], std::string("environment variable SORMA_ENTRY_carry: word 1: expected a closing }, got the end of the text"));
    EQUAL(get(d, "one"), "[a b]");
    for (const char* name : {"SORMA_DICT", "SORMA_ENTRY_carry", "SORMA_ENTRY_one"}) unsetenv(name);
}

// Random edits, saved and read again, against a plain map.
void testSaveProperties() {
    Folder folder;
    RandomWords make(1997);
    std::string file = folder.write("r.dict", "# first\nw0 a b # c\nw1\nw2 'x y' \\\n z\n");
    Dictionary d;
    d.load(file, Permit::owner());
    for (int round = 0; round < 300; ++round) {
        for (std::size_t n = make.below(4); n > 0; --n) {
            std::string word = "w" + std::to_string(make.below(12));
            if (make.below(4) == 0) {
                d.remove(word);
                continue;
            }
            std::vector<std::string> expansion;
            for (std::size_t k = make.below(4); k > 0; --k) expansion.push_back(make.word());
            if (expansion.size() == 1) expansion.push_back("");
            d.add(word, expansion, "");
        }
        d.save();
        Dictionary again;
        again.load(file, Permit::owner());
        EQUAL(brackets(again.words()), brackets(d.words()));
        for (auto& w : d.words()) {
            EQUAL(get(again, w), get(d, w));
            if (!d.get(w)->empty()) EQUAL(again.expand(w)[0].origin.toText(), d.expand(w)[0].origin.toText());
        }
    }
    CHECK(Folder::read(file).starts_with("# first\n"));
}

void testManyEntries() {
    std::string t;
    for (int i = 0; i < 10000; ++i) t += "carry." + std::to_string(i) + " -SUBST base -transferSpeed 0." + std::to_string(i) + "\n";
    const std::clock_t start = std::clock();            // of this process: others may be busy
    Dictionary d;
    d.loadText(t + "base -grip soft\n", "big.dict");
    EQUAL(d.size(), 10001u);
    for (int i = 0; i < 10000; ++i) d.add("n" + std::to_string(i), {"-SUBST", "base"}, "");
    std::size_t found = 0;
    for (int i = 0; i < 100; ++i)
        for (int k = 0; k < 10000; k += 10) found += d.has("carry." + std::to_string(k));
    EQUAL(found, 100'000u);
    CHECK(std::clock() - start < 5 * CLOCKS_PER_SEC);   // some 30 ms; anything quadratic takes minutes
}

}  // namespace

const std::vector<Group> kDictionaryGroups{
    {"dictionary", testDictionary}, {"loops", testLoops}, {"save", testSave}, {"saveEdited", testSaveEdited}, {"saveFiles", testSaveFiles},
    {"environment", testEnvironment}, {"saveProperties", testSaveProperties},
    {"manyEntries", testManyEntries},
};
