// busNames.cpp -- checks of names, patterns and addresses.
#include <unistd.h>

#include "busText.h"
#include "bus/dictionary.h"
#include "bus/glob.h"
#include "bus/name.h"

using namespace sorma;

namespace {

void testNames() {
    Name n = Name::parse("carry.slow@robot");
    EQUAL(n.service, "carry.slow");
    EQUAL(n.className, "carry");
    EQUAL(n.flavor, "slow");
    EQUAL(n.where, "robot");
    CHECK(!n.local() && !n.byDefault);
    n = Name::parse("CARRY.Slow");
    EQUAL(n.service, "carry.Slow");
    EQUAL(n.className, "carry");
    CHECK(n.byDefault && !n.local());
    EQUAL(n.toText(), "CARRY.Slow");
    CHECK(Name::parse("carry").local());
    for (const char* good : {"a", "z", "Z", "a_1", "carry.slow", "carry.a.b", "carry.%*!?#'<>|=+-~^&(),/:", "carry.gr\xc3\xbcn", "A", "carry@a", "carry@localhost:7014",
                             "carry.x@host:0x14", "carry@/run/user/1000/robot.sock", "carry@[::1]:7014", "carry@[fe80::1%eth0]:0x1f", "carry@self"}) {
        EQUAL(Name::parse(good).toText(), good);
        CHECK(Name::isName(good));
    }
    EQUAL(Name::parse("findBall.Main@Robot").toText(), "findball.Main@Robot");
    auto bad = [&](std::string_view name, const std::string& why, int line) {
        fails([&] { Name::parse(name); }, "NAME SYNTAX", "bad name " + shown(name) + ": " + why, line, "Name::parse");
        note(!Name::isName(name), line, "isName");
    };
    bad("", "at character 1, the class is missing", __LINE__);
    bad(".a", "at character 1, \".\", must be a letter: a name begins with its class", __LINE__);
    bad("@robot", "at character 1, \"@\", must be a letter: a name begins with its class", __LINE__);
    bad("1a", "at character 1, \"1\", must be a letter: a name begins with its class", __LINE__);
    bad("_a", "at character 1, \"_\", must be a letter: a name begins with its class", __LINE__);
    bad("car-ry", "at character 4, \"-\", must not be in a class (letters, digits, _)", __LINE__);
    bad("Carry", "at character 2, \"a\", mixes cases: a class begins in lower case (served here or behind @) or is all upper case (at its default location)", __LINE__);
    bad("carry.", "at character 7, the flavor is missing after the dot", __LINE__);
    bad("carry..slow", "at character 7, a part of the flavor between dots is empty", __LINE__);
    bad("carry.slow.", "at character 11, a part of the flavor between dots is empty", __LINE__);
    bad("carry.a..b@robot", "at character 9, a part of the flavor between dots is empty", __LINE__);
    bad("carry.@a", "at character 7, the flavor is missing after the dot", __LINE__);
    bad("carry.gr\xc3\xbc$", "at character 10, \"$\", must not be in a flavor (it is special to Tcl)", __LINE__);
    for (char c : std::string("[]{}$\"\\;"))
        bad(std::string("carry.a") + c, "at character 8, " + shown(std::string(1, c)) + ", must not be in a flavor (it is special to Tcl)", __LINE__);
    bad("carry.a b", "at character 8, \" \", must not be in a flavor (white space and control characters)", __LINE__);
    bad("carry.a\n", "at character 8, \"\\x0a\", must not be in a flavor (white space and control characters)", __LINE__);
    bad(std::string_view("carry.\0", 7), "at character 7, \"\\x00\", must not be in a flavor (white space and control characters)", __LINE__);
    bad("gr\xc3\xbcn", "at character 3, \"\xc3\xbc\", must not be in a class (letters, digits, _)", __LINE__);
    bad("CARRY@robot", "at character 6, \"@\", must not follow a class in upper case, which is served at its default location", __LINE__);
    bad("carry@", "at character 7, an address is missing: HOST:PORT, HOST:0xPROGRAM, /PATH or an alias", __LINE__);
    bad("carry.\xff", "at character 7, the flavor is not UTF-8", __LINE__);
    bad("carry.a@\xff", "at character 9, " + shown("\xff") + ", must not be in an alias (letters, digits, _ - .)", __LINE__);
    bad("carry@a@b", "at character 8, \"@\", must not be in an alias (letters, digits, _ - .)", __LINE__);
    bad("carry@host:99999", "at character 12, the port must be 1 to 65535", __LINE__);
}

// One ? stands for one character, and each byte that belongs to none is one.
void testPatterns() {
    auto characters = [](const std::string& text) {
        for (std::size_t n = 0; n <= text.size(); ++n)
            if (globMatch(std::string(n, '?'), text)) return int(n);
        return -1;
    };
    for (const char* one : {"\x7f", "\xc2\x80", "\xdf\xbf", "\xe0\xa0\x80", "\xef\xbf\xbf", "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbf"})
        note(characters(one) == 1, __LINE__, "not one character: " + shown(one));
    for (const char* bytes : {"\x80", "\xc3", "\xc3" "a", "\xc0\x80", "\xe2\x82", "\xe2" "a\x82", "\xe0\x80\x80", "\xbf\xbf\xbf", "\xf0\x80\x80\x80",
                              "\xf4\x90\x80\x80", "\x81\x80\x80\x80", "\xf8\x90\x80\x80"})
        note(characters(bytes) == int(std::strlen(bytes)), __LINE__, "not as many characters as bytes: " + shown(bytes));
    CHECK(globMatch("\xff", "\xff") && !globMatch("\x80", "\xc2\x80"));
    CHECK(!globMatch("\xc3\xa4", "\xc2\xa4") && !globMatch("\xc3\xa4", "\xc3\xa5"));
    // A byte that belongs to none is no character either, in whatever order they are counted.
    CHECK(!globMatch("\xf4\x8f\xbe\x80", "\x80") && !globMatch("\x80", "\xf4\x8f\xbe\x80"));
    // Brackets that end with a range to ] reach to the next ] only for what is in the range, and take the second * with them.
    CHECK(globMatch("*[ba-]*]", "b^") && globMatch("*[ba-]*]", "bb]") && !globMatch("*[ba-]*]", "bb"));
}

void testAddresses() {
    auto parsed = [](std::string_view t) {
        Address a = Address::parse(t);
        static const char* const kKinds[] = {"self", "tcp", "program", "path", "alias"};
        return std::string(kKinds[static_cast<int>(a.kind)]) + ' ' + a.host + ' ' + std::to_string(a.number) + ' ' + a.toText();
    };
    EQUAL(parsed("self"), "self  0 self");
    EQUAL(parsed("lab-1.uni.de:7014"), "tcp lab-1.uni.de 7014 lab-1.uni.de:7014");
    EQUAL(parsed("127.0.0.1:00080"), "tcp 127.0.0.1 80 127.0.0.1:80");
    EQUAL(parsed("h:65535"), "tcp h 65535 h:65535");
    EQUAL(parsed("h:0x1FFFFFFF"), "program h 536870911 h:0x1fffffff");
    EQUAL(parsed("h:0x0"), "program h 0 h:0x0");
    EQUAL(parsed("[::1]:7014"), "tcp ::1 7014 [::1]:7014");
    EQUAL(parsed("[::ffff:10.0.0.1]:0x14"), "program ::ffff:10.0.0.1 20 [::ffff:10.0.0.1]:0x14");
    EQUAL(parsed("/a:b@c.sock"), "path /a:b@c.sock 0 /a:b@c.sock");
    EQUAL(parsed("robot_2.arm-left"), "alias robot_2.arm-left 0 robot_2.arm-left");
    FAILS(Address::parse(":7014"), "NAME SYNTAX :7014", "bad address \":7014\": at character 1, the host before the colon is missing");
    FAILS(Address::parse("h:"), "NAME SYNTAX", "bad address \"h:\": at character 3, a port (1 to 65535) or a program (0x0 to 0x1fffffff) is missing after the colon");
    FAILS(Address::parse("h:0"), "NAME SYNTAX", "bad address \"h:0\": at character 3, the port must be 1 to 65535");
    FAILS(Address::parse("h:99999999999999"), "NAME SYNTAX", "bad address \"h:99999999999999\": at character 3, the port must be 1 to 65535");
    FAILS(Address::parse("h:70x"), "NAME SYNTAX", "bad address \"h:70x\": at character 5, \"x\", must be a digit of a port");
    FAILS(Address::parse("h:0x"), "NAME SYNTAX", "bad address \"h:0x\": at character 5, the hexadecimal digits of a program are missing after 0x");
    FAILS(Address::parse("h:0x1g"), "NAME SYNTAX", "bad address \"h:0x1g\": at character 6, \"g\", must be a hexadecimal digit of a program");
    FAILS(Address::parse("h:0x20000000"), "NAME SYNTAX", "bad address \"h:0x20000000\": at character 5, the program must be less than 0x20000000");
    FAILS(Address::parse("::1:7014"), "NAME SYNTAX", "bad address \"::1:7014\": at character 1, the host before the colon is missing");
    FAILS(Address::parse("fe80::1:7014"), "NAME SYNTAX", "bad address \"fe80::1:7014\": at character 1, an IPv6 host is written in brackets: [::1]:7014");
    FAILS(Address::parse("[::1"), "NAME SYNTAX", "bad address \"[::1\": at character 5, the closing bracket of an IPv6 host is missing");
    FAILS(Address::parse("[::1]"), "NAME SYNTAX", "bad address \"[::1]\": at character 6, a colon and the port are missing after the IPv6 host");
    CHECK(Name::isName("carry@[A::F]:1"));
    FAILS(Address::parse("[::1]7014"), "NAME SYNTAX", "bad address \"[::1]7014\": at character 6, a colon and the port are missing after the IPv6 host");
    FAILS(Address::parse("[::g]:1"), "NAME SYNTAX", "bad address \"[::g]:1\": at character 4, \"g\", must not be in an IPv6 host");
    FAILS(Address::parse("[abc]:1"), "NAME SYNTAX", "bad address \"[abc]:1\": at character 2, brackets are for IPv6 hosts, which have colons");
    FAILS(Address::parse("h_ost$:1"), "NAME SYNTAX", "bad address \"h_ost$:1\": at character 6, \"$\", must not be in a host (letters, digits, _ - .)");
    FAILS(Address::parse("/a b"), "NAME SYNTAX", "bad address \"/a b\": at character 3, \" \", must not be in the path of a socket");
}

void testResolve() {
    Dictionary d;
    d.loadText("@robot localhost:7014\n@arm @robot\n@left arm\n@here self\n@a @b\n@b c\n@c @a\n@me @me\n@empty\n@bad host:0\n"
               "@late h:1 -wait\n@later @late\nCARRY @left\nNOP /tmp/n.sock\nECHO self\nFOO unknown\nBAR @a\n@sub -SUBST @robot\n", "t.dict");
    auto at = [&](const char* name) { return resolve(Name::parse(name), d).toText(); };
    EQUAL(at("carry"), "self");
    EQUAL(at("carry@robot"), "localhost:7014");
    EQUAL(at("carry@left"), "localhost:7014");
    EQUAL(at("carry@sub"), "localhost:7014");
    EQUAL(at("carry@here"), "self");
    EQUAL(at("carry@self"), "self");
    EQUAL(at("carry@h:1"), "h:1");
    EQUAL(at("CARRY.slow"), "localhost:7014");
    EQUAL(at("NOP"), "/tmp/n.sock");
    auto waits = [&](const char* name) { return resolve(Name::parse(name), d).wait; };
    CHECK(waits("x@late") && waits("x@later") && !waits("x@robot") && !waits("x@left"));
    EQUAL(at("ECHO"), "self");
    CHECK(resolve(Name::parse("carry@nowhere"), d).kind == Address::Kind::alias);
    EQUAL(at("FOO"), "unknown");
    // Two entries of the dictionary belong to a name: its place, and its recipe.
    auto entries = [](const char* name) { return Name::parse(name).location() + " | " + Name::parse(name).recipeKey(); };
    EQUAL(entries("carry.slow"), " | carry.slow");
    EQUAL(entries("carry.slow@robot"), "@robot | carry.slow@robot");
    EQUAL(entries("CARRY.slow"), "CARRY | CARRY.slow");
    EQUAL(entries("CARRY"), "CARRY | ");
    CHECK(Name::isElsewhere("carry@robot") && Name::isElsewhere("CARRY.slow") && !Name::isElsewhere("carry.Slow") && !Name::isElsewhere(""));
    CHECK(Name::isLocation("@robot") && Name::isLocation("CARRY") && !Name::isLocation("CARRY.slow") && !Name::isLocation("carry@robot"));
    // Which entry decides, when the connection is made anew.
    auto rule = [&](const char* name) {
        std::string out;
        resolve(Name::parse(name), d, &out);
        return out;
    };
    EQUAL(rule("carry@robot"), "@robot");
    EQUAL(rule("carry@left"), "@robot");
    EQUAL(rule("carry@h:1"), "@h:1");
    EQUAL(rule("NOP"), "NOP");
    EQUAL(rule("FOO"), "@unknown");
    EQUAL(rule("x@nowhere"), "@nowhere");
    CHECK(resolve(Name::parse("FOO"), d).kind == Address::Kind::alias);
    FAILS(at("VISION.left"), "ADDRESS UNRESOLVED VISION.left",
          "VISION.left: class VISION has no default location; give it one: dict CTRL -add VISION @DAEMON");
    FAILS(at("x@a"), "DICT LOOP x@a", "x@a: addresses in the dictionary lead in a circle: @a -> @b -> @c -> @a");
    FAILS(at("BAR"), "DICT LOOP BAR", "BAR: addresses in the dictionary lead in a circle: BAR -> @a -> @b -> @c -> @a");
    FAILS(at("x@me"), "DICT LOOP", "x@me: addresses in the dictionary lead in a circle: @me -> @me");
    FAILS(at("x@empty"), "ADDRESS UNRESOLVED x@empty",
          "x@empty: the dictionary's entry @empty holds no address; give it one: dict CTRL -add @empty HOST:PORT");
    FAILS(at("x@bad"), "ADDRESS UNRESOLVED", "x@bad: the dictionary's entry @bad: bad address \"host:0\": at character 6, the port must be 1 to 65535");
}

}  // namespace

const std::vector<Group> kNameGroups{
    {"names", testNames}, {"patterns", testPatterns}, {"addresses", testAddresses}, {"resolve", testResolve},
};
