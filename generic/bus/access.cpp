#include "bus/access.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "bus/call.h"
#include "bus/catalogue.h"
#include "bus/client.h"
#include "bus/glob.h"
#include "bus/requestText.h"
#include "bus/statistics.h"

namespace sorma {

namespace {

const Prototype kDenied{Severity::error, "COMM DENIED", 2, "{0}: {2} may not {3}; {4}"};
const Prototype kSyntax{Severity::error, "POLICY SYNTAX", 1, "{0}: {1}; a line is: allow|deny SUBJECT RIGHT ... ?on PATTERN ...?"};
const Prototype kFile{Severity::error, "POLICY FILE", 1, "cannot take the policy file \"{0}\": {1}"};

constexpr std::size_t kDeniedLength = 100;
constexpr std::size_t kLongestFile = 1 << 20;

struct Word {
    const char* name;
    Rights rights;
    const char* doing;      // "{}" stands for the subject
};
constexpr Rights kUse = Right::call | Right::inspect;
constexpr Rights kTune = kUse | Right::configure | Right::make | Right::dictionary;
constexpr Word kWords[] = {
    {"call", Rights(Right::call), "call {}"},
    {"inspect", Rights(Right::inspect), "inspect {}"},
    {"configure", Rights(Right::configure), "configure {}"},
    {"make", Rights(Right::make), "make or remove {}"},
    {"dictionary", Rights(Right::dictionary), "change entry {}"},
    {"files", Rights(Right::files), "have file {} read or written"},
    {"program", Rights(Right::program), "choose what {} runs"},
    {"reach", Rights(Right::reach), "have this daemon call {}"},
    {"policy", Rights(Right::policy), "change the policy"},
    {"use", kUse, nullptr},
    {"tune", kTune, nullptr},
    {"everything", kTune | Right::files | Right::program | Right::reach, nullptr},
};
constexpr std::string_view kRightNames = "call, inspect, configure, make, dictionary, files, program, reach, use, tune, or everything";

Rights rightsOf(std::string_view name) {
    for (auto& w : kWords)
        if (name == w.name) return w.rights == Rights(Right::policy) ? Rights(0) : w.rights;
    return 0;
}

const Word& wordOf(Right right) {
    for (auto& w : kWords)
        if (w.rights == Rights(right)) return w;
    return kWords[0];
}

// The words of a line up to its comment.
std::vector<std::string> wordsOf(std::string_view line) {
    std::vector<std::string> words;
    std::size_t at = 0;
    auto white = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
    while (at < line.size()) {
        while (at < line.size() && white(line[at])) ++at;
        if (at == line.size() || line[at] == '#') break;
        std::size_t begin = at;
        while (at < line.size() && !white(line[at])) ++at;
        words.emplace_back(line.substr(begin, at - begin));
    }
    return words;
}

// The caller in a refusal: what is known, then what it claims.
std::string whoText(const PrincipalPointer& author) {
    std::string who = author->kind() == Principal::Kind::host || (author->kind() == Principal::Kind::anyone && author->byNetwork())
                          ? Principal::toText(author->address()) : author->toText();
    auto* context = CallContext::current();
    if (context && context->client && context->client->principal == author) {
        auto& claim = context->client->caller;
        if (author->byNetwork() && !claim.user.empty()) who += " (claims " + claim.user + "@" + claim.host + ")";
    }
    return who;
}

}  // namespace

const char* toText(Right right) { return wordOf(right).name; }

// ---- lines ----

bool Access::Line::fits(const Principal* who) const {
    switch (subject) {
        case Subject::owner: return !who;
        case Subject::anyone: return who;
        case Subject::user: return who && who->kind() == Principal::Kind::user && who->uid() == number;
        case Subject::group:
            return who && who->kind() == Principal::Kind::user &&
                   std::binary_search(who->groups().begin(), who->groups().end(), gid_t(number));
        case Subject::local: return who && who->kind() == Principal::Kind::local && who->uid() == number;
        case Subject::host: break;
    }
    if (!who || !who->byNetwork()) return false;
    int whole = bits / 8, rest = bits % 8;
    if (std::memcmp(who->address().data(), address.data(), std::size_t(whole)) != 0) return false;
    if (rest == 0) return true;
    unsigned mask = 0xff00u >> rest & 0xffu;
    return ((who->address()[std::size_t(whole)] ^ address[std::size_t(whole)]) & mask) == 0;
}

bool Access::Line::covers(std::string_view what) const {
    return patterns.empty() || std::any_of(patterns.begin(), patterns.end(), [&](auto& p) { return globMatch(p, what); });
}

void Access::parseRights(Line& line, const std::vector<std::string>& words, std::size_t at) {
    for (; at < words.size() && words[at] != "on"; ++at) {
        Rights r = rightsOf(words[at]);
        if (r == 0) fail(kSyntax, line.source, "\"" + words[at] + "\" is no right: must be " + std::string(kRightNames));
        line.rights = Rights(line.rights | r);
    }
    if (line.rights == 0) fail(kSyntax, line.source, "a right is missing: " + std::string(kRightNames));
    if (at == words.size()) return;
    line.patterns.assign(words.begin() + std::ptrdiff_t(at) + 1, words.end());
    if (line.patterns.empty()) fail(kSyntax, line.source, "a pattern is missing after \"on\"");
}

Access::Line Access::parse(std::string_view text, std::string source) {
    Line line;
    line.source = std::move(source);
    auto words = wordsOf(text);
    for (auto& w : words) line.text += (line.text.empty() ? "" : " ") + w;
    auto word = [&](std::size_t i, const char* what) -> const std::string& {
        if (i >= words.size()) fail(kSyntax, line.source, std::string(what) + " is missing");
        return words[i];
    };
    if (word(0, "allow or deny") != "allow" && words[0] != "deny")
        fail(kSyntax, line.source, "\"" + words[0] + "\" must be allow or deny");
    line.allow = words[0] == "allow";
    const std::string& subject = word(1, "the subject: user, group, local, host, or anyone");
    if (subject == "anyone") {
        line.subject = Line::Subject::anyone;
        parseRights(line, words, 2);
        return line;
    }
    const bool host = subject == "host", named = subject == "user" || subject == "group" || subject == "local";
    if (!host && !named)
        fail(kSyntax, line.source, "\"" + subject + "\" is no subject: must be user, group, local, host, or anyone");
    const std::string& who = word(2, host ? "the address of the host" : "the name");
    if (host) {
        line.subject = Line::Subject::host;
        auto slash = who.find('/');
        if (!Principal::fromText(who.substr(0, slash), line.address))
            fail(kSyntax, line.source, "\"" + who + "\" is no numeric address");
        bool four = who.find(':') == who.npos;
        std::int64_t bits = four ? 32 : 128;
        const std::int64_t most = bits;
        if (slash != who.npos && (!parseNumber(who.substr(slash + 1), bits) || bits < 0 || bits > most))
            fail(kSyntax, line.source, "\"" + who.substr(slash + 1) + "\" is no number of bits from 0 to " + std::to_string(most));
        line.bits = int(bits) + (four ? 96 : 0);
    } else {
        line.subject = subject == "user" ? Line::Subject::user : subject == "group" ? Line::Subject::group : Line::Subject::local;
        uid_t uid = 0;
        gid_t gid = 0;
        if (subject == "group" ? !groupNumber(who, gid) : !userNumber(who, uid))
            fail(kSyntax, line.source, "this host knows no " + std::string(subject == "group" ? "group" : "user") + " \"" + who + "\"");
        line.number = subject == "group" ? gid : uid;
    }
    parseRights(line, words, 3);
    return line;
}

const std::vector<Access::Line>& Access::builtIn() {
    static const std::vector<Line> lines = [] {
        Line self;
        self.subject = Line::Subject::local;
        self.allow = true;
        self.number = geteuid();
        self.rights = kTune;
        self.text = "allow local " + userName(geteuid()) + " tune";
        self.source = "built in";
        return std::vector<Line>{self, parse("allow anyone use", "built in")};
    }();
    return lines;
}

template <class F> void Access::eachLine(F body) const {
    for (auto* list : {&given_, &ofFile_, &builtIn()})
        for (auto& line : *list)
            if (!body(line)) return;
}

// The line that decides; null: none, which is a no.
const Access::Line* Access::decide(const Principal* who, Right right, std::string_view subject) const {
    const Line* found = nullptr;
    auto look = [&](const Line& line) {
        if ((line.rights & Rights(right)) && line.fits(who) && line.covers(subject)) found = &line;
        return !found;
    };
    if (who) {
        eachLine(look);
    } else {
        for (auto& line : granted_)
            if (!look(line)) break;
    }
    return found;
}

Rights Access::rights(const PrincipalPointer& author, std::string_view subject) const {
    constexpr Rights kAll = kTune | Right::files | Right::program | Right::reach;
    if (!author && !restricted_) return kAll | Right::policy;
    Rights out = author ? Rights(0) : kTune;        // rights of a safe interpreter on its own objects
    for (auto& w : kWords) {
        if (w.doing == nullptr || w.rights == Rights(Right::policy)) continue;
        if (auto* line = decide(author.get(), Right(w.rights), subject)) out = Rights(line->allow ? out | w.rights : out & ~w.rights);
    }
    return out;
}

void Access::ask(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object) {
    if (!(rights(author, subject) & Rights(right))) refuse(author, right, subject, object);
}

std::string Access::remedy(const PrincipalPointer& author, Right right, std::string_view subject) const {
    if (right == Right::policy) return "only this daemon's own user may, by Unix socket";
    std::string on;
    if (right == Right::dictionary || right == Right::configure || right == Right::make || right == Right::call || right == Right::inspect) {
        auto dot = subject.find('.');
        on = dot == subject.npos ? std::string(subject) : std::string(subject.substr(0, dot)) + ".*";
    } else {
        on = subject;
    }
    std::string what = std::string(toText(right)) + " on " + on;
    if (!author) return "its parent can grant it: sorma::grant INTERP allow " + what;
    std::string file = file_.empty() ? "~/.config/sorma/policy" : file_;
    return "allow it with sormad -allow \"" + author->toText() + " " + what + "\" or that line in " + file;
}

void Access::refuse(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object) {
    std::string named(object);
    if (!daemon.empty() && named.find('@') == named.npos) named += "@" + daemon;
    std::string doing = wordOf(right).doing;
    if (auto at = doing.find("{}"); at != doing.npos) doing.replace(at, 2, subject);
    std::string who = author ? whoText(author) : std::string("this interpreter is safe and");
    ++denials_;
    std::string text = who + ": " + doing;
    auto known = std::find_if(denied_.begin(), denied_.end(), [&](auto& d) { return d.text == text; });
    Denial denial{wallNow(), text, 1};
    if (known != denied_.end()) {
        denial.times += known->times;
        denied_.erase(known);
    } else if (denied_.size() == kDeniedLength) {
        denied_.pop_front();
    }
    denied_.push_back(std::move(denial));
    fail(kDenied, named, toText(right), who, doing, remedy(author, right, subject));
}

std::string Access::deniedText() const {
    std::string out = std::to_string(denials_) + " refused";
    for (auto d = denied_.rbegin(); d != denied_.rend(); ++d)
        out += "\n" + clockText(d->time) + " " + d->text + (d->times > 1 ? ", " + std::to_string(d->times) + " times" : "");
    return out;
}

// ---- the policy ----

void Access::add(std::string_view text, std::string source) {
    // `sormad -allow` takes the line without its first word as well, since that is what its name says.
    std::string whole(text);
    auto words = wordsOf(text);
    if (!words.empty() && words[0] != "allow" && words[0] != "deny") whole = "allow " + whole;
    given_.push_back(parse(whole, std::move(source)));
    anotherHolds();
}

void Access::anotherHolds() {
    ++epoch_;
    if (changed) changed();
}

void Access::load(const std::string& file) {
    struct Descriptor {
        int fd;
        ~Descriptor() {
            if (fd >= 0) close(fd);
        }
    } in{open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
    auto wrong = [&](const std::string& why) { fail(kFile, file, why); };
    struct stat facts{};
    if (in.fd < 0 || fstat(in.fd, &facts) != 0) wrong(std::strerror(errno));
    if (!S_ISREG(facts.st_mode)) wrong("it is no file");
    if (facts.st_uid != geteuid() && facts.st_uid != 0) wrong("it belongs to " + userName(facts.st_uid) + "; it must be this user's, or root's");
    if (facts.st_mode & (S_IWGRP | S_IWOTH)) wrong("others than its owner may write to it; chmod go-w it");
    std::string text;
    char block[4096];
    for (ssize_t n; (n = read(in.fd, block, sizeof block)) != 0;) {
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) wrong(std::strerror(errno));
        text.append(block, std::size_t(n));
        if (text.size() > kLongestFile) wrong("it is longer than " + std::to_string(kLongestFile) + " bytes");
    }
    std::vector<Line> lines;
    std::string_view rest = text;
    for (int number = 1; !rest.empty(); ++number) {
        auto line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(rest.size(), line.size() + 1));
        if (!wordsOf(line).empty()) lines.push_back(parse(line, file + ":" + std::to_string(number)));
    }
    ofFile_ = std::move(lines);
    file_ = file;
    anotherHolds();
}

void Access::loadDefault() {
    if (!file_.empty()) return;
    const char* config = getenv("XDG_CONFIG_HOME");
    const char* home = getenv("HOME");
    std::string folder = config && *config ? config : home && *home ? std::string(home) + "/.config" : std::string();
    std::string file = folder + "/sorma/policy";
    if (!folder.empty() && access(file.c_str(), F_OK) == 0) load(file);
}

void Access::reload() {
    if (!file_.empty()) load(file_);
}

std::string Access::text() const {
    std::string out = "# this user and root, in the process or by Unix socket: everything";
    eachLine([&](const Line& line) {
        out += "\n" + line.text + "    # " + line.source;
        return true;
    });
    return out;
}

std::string Access::explain(std::string_view subject, std::string_view right, std::string_view on) const {
    auto words = wordsOf(subject);
    std::string line = "allow";
    for (auto& w : words) line += " " + w;
    Line parsed = parse(line + " " + std::string(right), "-may");       // says what is wrong with the words
    PrincipalPointer who;
    switch (parsed.subject) {
        case Line::Subject::user: who = Principal::user(parsed.number, {}); break;
        case Line::Subject::local: {
            Principal::Address loopback{};
            Principal::fromText("127.0.0.1", loopback);
            who = Principal::local(parsed.number, loopback);
            break;
        }
        case Line::Subject::host: who = Principal::host(parsed.address); break;
        case Line::Subject::group: fail(kSyntax, "-may", "a group cannot be asked for: name a user of it");
        default: who = Principal::anyone();
    }
    if (!who) return "yes: this user and root, by Unix socket, may do everything";
    std::string out;
    for (auto& w : kWords) {
        if (w.doing == nullptr || !(parsed.rights & w.rights)) continue;
        auto* by = decide(who.get(), Right(w.rights), on);
        if (!out.empty()) out += "\n";
        if (rightsOf(right) != w.rights) out += std::string(w.name) + " ";
        out += by ? std::string(by->allow ? "yes" : "no") + ", by \"" + by->text + "\" (" + by->source + ")" : "no: no line allows it";
    }
    return out;
}

// ---- a safe interpreter ----

void Access::grant(const std::vector<std::string>& words) {
    Line line;
    line.subject = Line::Subject::owner;
    line.source = "sorma::grant";
    if (words.empty() || (words[0] != "allow" && words[0] != "deny"))
        fail(kSyntax, line.source, words.empty() ? std::string("allow or deny is missing") : "\"" + words[0] + "\" must be allow or deny");
    line.allow = words[0] == "allow";
    parseRights(line, words, 1);
    for (auto& w : words) line.text += (line.text.empty() ? "" : " ") + w;
    granted_.insert(granted_.begin(), std::move(line));
    anotherHolds();
}

std::vector<std::string> Access::grants() const {
    std::vector<std::string> out;
    for (auto& line : granted_) out.push_back(line.text);
    return out;
}

}  // namespace sorma
