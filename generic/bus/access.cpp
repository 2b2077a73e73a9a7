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
#include "bus/descriptor.h"
#include "bus/glob.h"
#include "bus/nearest.h"
#include "bus/requestText.h"
#include "bus/statistics.h"

namespace sorma {

namespace {

const Prototype kDenied{Severity::error, "COMM DENIED", 2, "{0}: {2} may not {3}; {4}"};
const Prototype kSyntax{Severity::error, "POLICY SYNTAX", 1, "{0}: {1}; a line is: allow|deny SUBJECT RIGHT ... ?on PATTERN ...?, or revoke CERTIFICATE ..."};
const Prototype kPermit{Severity::error, "POLICY PERMIT", 2, "{}: the right to {} was not asked for: an error of the program"};
const Prototype kLine{Severity::error, "POLICY LINE", 1, "-disallow expects the number of a line that was added at run time{1}, got {0}"};
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
constexpr Rights kEverything = kTune | Right::files | Right::program | Right::reach | Rights(Right::operate | Right::relay);
constexpr Word kWords[] = {
    {"call", Rights(Right::call), "call {}"},
    {"inspect", Rights(Right::inspect), "inspect {}"},
    {"configure", Rights(Right::configure), "configure {}"},
    {"make", Rights(Right::make), "make or remove {}"},
    {"dictionary", Rights(Right::dictionary), "change entry {}"},
    {"files", Rights(Right::files), "have file {} read or written"},
    {"program", Rights(Right::program), "choose what {} runs"},
    {"reach", Rights(Right::reach), "have this daemon call {}"},
    {"operate", Rights(Right::operate), "have {} move, power or fire something"},
    {"relay", Rights(Right::relay), "pass requests of others on to {}"},
    {"policy", Rights(Right::policy), "change the policy"},
    {"use", kUse, nullptr},
    {"tune", kTune, nullptr},
    {"everything", kEverything, nullptr},
};
const std::vector<std::string> kSubjects{"user", "group", "local", "host", "cert", "web", "anyone"};       // as Access::Line::Subject has them

// The words that a line may have for rights.
const std::vector<std::string>& rightNames() {
    static const std::vector<std::string> all = [] {
        std::vector<std::string> names;
        for (auto& w : kWords)
            if (w.rights != Rights(Right::policy)) names.emplace_back(w.name);
        return names;
    }();
    return all;
}

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

std::string quoted(const std::string& word, const std::vector<std::string>& known) { return "\"" + word + "\"" + didYouMean(word, known); }

// A pattern for a text that a stranger has chosen. A line and a shell read it as one word.
std::string patternFor(std::string_view subject) {
    std::string out(subject);
    for (char& c : out)
        if (static_cast<unsigned char>(c) <= ' ' || std::strchr("*[]\\\"$`#\x7f", c)) c = '?';
    return out;
}

// The caller in a refusal: what is known, then what it claims.
std::string whoText(const PrincipalPointer& author) {
    if (author->kind() == Principal::Kind::several) {
        std::string all;
        for (auto& member : author->members()) all += (all.empty() ? "" : " and ") + whoText(member);
        return all.empty() ? author->toText() : all;
    }
    std::string who = author->kind() == Principal::Kind::host || (author->kind() == Principal::Kind::anyone && author->byNetwork())
                          ? Principal::toText(author->address()) : author->toText();
    auto* context = CallContext::current();
    if (context && context->client && context->client->principal == author) {
        auto& claim = context->client->caller;
        if (author->byNetwork() && author->kind() != Principal::Kind::cert && !claim.user.empty()) who += " (claims " + claim.user + "@" + claim.host + ")";
    }
    return who;
}

}  // namespace

const char* toText(Right right) { return wordOf(right).name; }

Permit::Permit(Rights rights, std::string_view target) : owner_(false), rights_(rights), target_(std::hash<std::string_view>{}(target)) {}

void Permit::check(Right right) const {
    if (!includes(right)) fail(kPermit, "it", toText(right));
}

void Permit::compare(Right right, std::string_view target) const {
    if (!(rights_ & Rights(right)) || target_ != std::hash<std::string_view>{}(target)) fail(kPermit, target, toText(right));
}

// One line for each way in. The manual's table is made from it, and tests/doors.test walks through all of it.
const std::vector<Door>& Access::doors() {
    static const std::vector<Door> list = {
        {"NAME EXEC", Right::call, "the object"},
        {"NAME EXEC of a class or with a word that declares -danger move, power or fire", Right::operate, "the object, besides call"},
        {"NAME EXEC of a class that runs programs (fork)", Right::program, "the object, instead of call"},
        {"the first use of a name", Right::call, "the object that it makes"},
        {"NAME CTRL -option value", Right::configure, "the object"},
        {"NAME CTRL -option value, -action, with -danger move, power or fire", Right::operate, "the object, besides configure"},
        {"NAME CTRL -action", Right::configure, "the object, unless the action declares another right"},
        {"NAME CTRL -action that stops something", Right::call, "the object"},
        {"NAME CTRL -help, -dump, -save, -if", Right::inspect, "the object"},
        {"NAME CTRL -save", Right::dictionary, "the entry, besides inspect"},
        {"NAME CTRL -undo", Right::configure, "the object"},
        {"NAME CTRL -lock", Right::configure, "the object, and as long as it is locked"},
        {"NAME CTRL -unlock", Right::call, "the object"},
        {"NAME CTRL -unlock break", Right::policy, "policy, besides call"},
        {"NAME DBX", Right::inspect, "the object"},
        {"NAME DBX -verbosity LEVEL", Right::configure, "the object, besides inspect"},
        {"an option of type service, a wire, a step", Right::call, "the object that it names, and operate where its EXEC needs that"},
        {"a safe action", Right::call, "the object that it names; each word of a CTRL asks for its own right when it is sent"},
        {"a safe action of a class that runs programs", Right::program, "the object that it names, instead of call"},
        {"an option or word of type file, folder, segment or address", Right::files, "what it names, when it is set and when it is used"},
        {"an option or word of type program", Right::program, "the object, when it is set and when it is used"},
        {"a name at another daemon", Right::reach, "the place after @"},
        {"a recipe", Right::configure, "the object that is made: of each word, asked of who wrote it"},
        {"a subscription, a stream", Right::inspect, "the object, and as long as events come"},
        {"an event object.changed, trail.* or monitor.* of sorm", Right::inspect, "the object that it tells of"},
        {"sorm DBX -describe NAME, CTRL -references NAME", Right::inspect, "the object that is there"},
        {"sorm DBX -look NAME WORD", Right::inspect, "the object"},
        {"GET /metrics from the port of a class metrics", Right::inspect, "the object"},
        {"sorm DBX -daemons", Right::reach, "*"},
        {"sorm CTRL, dict CTRL", Right::inspect, "sorm or dict, besides what the word asks for"},
        {"sorm CTRL -create, -remove", Right::make, "the object"},
        {"sorm CTRL -create", Right::call, "the object, besides make"},
        {"sorm CTRL -alias NAME TARGET", Right::make, "the name, and the object"},
        {"sorm CTRL -allow, -reloadPolicy", Right::policy, "policy"},
        {"sorm EXEC", Right::call, "sorm; then the request asks for its own"},
        {"dict CTRL -add, -remove", Right::dictionary, "the entry"},
        {"dict CTRL -load, -reload, -save", Right::dictionary, "*"},
        {"dict CTRL -load FILE, -save FILE", Right::files, "the file, besides dictionary"},
        {"a request that a neighbour passes on for somebody", Right::relay, "the object, asked of the neighbour; without it the author is anyone"},
    };
    return list;
}

// ---- lines ----

// A pattern NAME@ORGANISATION, or NAME, which is of any organisation.
static bool matches(const std::string& pattern, std::string_view certificate) {
    const bool any = pattern.find('@') == pattern.npos;
    return globMatch(pattern, any ? certificate.substr(0, certificate.find('@')) : certificate);
}

bool Access::revokes(std::string_view name, std::string_view organisation) const {
    const std::string certificate = std::string(name) + "@" + std::string(organisation);
    bool found = false;
    eachLine([&](const Line& line) {
        found = line.rights == 0 && std::any_of(line.certificates.begin(), line.certificates.end(), [&](auto& p) { return matches(p, certificate); });
        return !found;
    });
    return found;
}

bool Access::Line::fits(const Principal* who) const {
    switch (subject) {
        case Subject::owner: return !who;
        case Subject::anyone: return who;
        case Subject::user: return who && who->kind() == Principal::Kind::user && who->uid() == number;
        case Subject::group:
            return who && who->kind() == Principal::Kind::user &&
                   std::binary_search(who->groups().begin(), who->groups().end(), gid_t(number));
        case Subject::local:
            // After the other end has closed, the kernel names no user: it may be anybody, so each deny holds.
            if (!allow && who && who->kind() == Principal::Kind::anyone && who->byNetwork()) return true;
            return who && who->kind() == Principal::Kind::local && who->uid() == number;
        case Subject::cert: return who && who->kind() == Principal::Kind::cert && matches(certificates[0], who->certificate());
        case Subject::web: return who && who->kind() == Principal::Kind::web && globMatch(certificates[0], who->certificate());
        case Subject::ownAuthority: return who && who->kind() == Principal::Kind::cert && who->ofOwnAuthority();
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
        if (r == 0) fail(kSyntax, line.source, quoted(words[at], rightNames()) + " is no right: must be " + oneOf(rightNames()));
        line.rights = Rights(line.rights | r);
    }
    if (line.rights == 0) fail(kSyntax, line.source, "a right is missing: " + oneOf(rightNames()));
    if (at == words.size()) return;
    line.patterns.assign(words.begin() + std::ptrdiff_t(at) + 1, words.end());
    if (line.patterns.empty()) fail(kSyntax, line.source, "a pattern is missing after \"on\"");
}

void Access::parseHost(Line& line, const std::string& host) {
    auto slash = host.find('/');
    if (!Principal::fromText(host.substr(0, slash), line.address)) fail(kSyntax, line.source, "\"" + host + "\" is no numeric address");
    const bool four = host.find(':') == host.npos;
    const std::int64_t most = four ? 32 : 128;
    std::int64_t bits = most;
    if (slash != host.npos && (!parseNumber(host.substr(slash + 1), bits) || bits < 0 || bits > most))
        fail(kSyntax, line.source, "\"" + host.substr(slash + 1) + "\" is no number of bits from 0 to " + std::to_string(most));
    line.bits = int(bits) + (four ? 96 : 0);
}

Access::Line Access::parse(std::string_view text, std::string source) {
    Line line;
    line.source = std::move(source);
    auto words = wordsOf(text);
    for (auto& w : words) line.text += (line.text.empty() ? "" : " ") + w;
    auto wrong = [&](const std::string& why) { fail(kSyntax, line.source, why); };
    auto word = [&](std::size_t i, const std::string& what) -> const std::string& {
        if (i >= words.size()) wrong(what + " is missing");
        return words[i];
    };
    line.allow = word(0, "allow, deny or revoke") == "allow";
    if (words[0] == "revoke") {
        word(1, "the name of a certificate");
        line.certificates.assign(words.begin() + 1, words.end());
        return line;
    }
    if (!line.allow && words[0] != "deny") wrong(quoted(words[0], {"allow", "deny", "revoke"}) + " must be allow, deny or revoke");
    const std::string& subject = word(1, "the subject: " + oneOf(kSubjects));
    const auto known = std::find(kSubjects.begin(), kSubjects.end(), subject);
    if (known == kSubjects.end()) {
        auto near = kSubjects;                          // and what `sormad -allow` may begin with
        near.insert(near.end(), {"allow", "deny", "revoke"});
        wrong(quoted(subject, near) + " is no subject: must be " + oneOf(kSubjects));
    }
    line.subject = Line::Subject(known - kSubjects.begin());
    if (line.subject == Line::Subject::anyone) return parseRights(line, words, 2), line;
    const bool host = line.subject == Line::Subject::host, group = line.subject == Line::Subject::group;
    const std::string& who = word(2, host ? "the address of the host" : "the name");
    if (host) parseHost(line, who);
    else if (line.subject == Line::Subject::cert || line.subject == Line::Subject::web) line.certificates = {who};
    else if (!(group ? groupNumber(who, line.number) : userNumber(who, line.number)))
        wrong("this host knows no " + std::string(group ? "group" : "user") + " \"" + who + "\"");
    parseRights(line, words, 3);
    return line;
}

const std::vector<Access::Line>& Access::builtIn() const {
    static const std::vector<Line> closed = [] {
        Line self;
        self.subject = Line::Subject::local;
        self.allow = true;
        self.number = geteuid();
        self.rights = Rights(kTune | Rights(Right::operate));
        self.text = "allow local " + userName(geteuid()) + " tune operate";
        self.source = "built in";
        Line own;
        own.subject = Line::Subject::ownAuthority;
        own.allow = true;
        own.rights = kTune;
        own.text = "allow cert * tune";
        own.source = "built in, for certificates of the own authority";
        Line web;                                       // a browser is no place for what moves something: that needs a line
        web.subject = Line::Subject::web;
        web.allow = true;
        web.rights = kTune;
        web.certificates = {userName(geteuid())};
        web.text = "allow web " + userName(geteuid()) + " tune";
        web.source = "built in";
        return std::vector<Line>{self, own, web};
    }();
    static const std::vector<Line> open = [] {
        auto lines = closed;
        lines.push_back(parse("allow anyone use", "-open 1"));
        return lines;
    }();
    return open_ ? open : closed;
}

template <class F> void Access::eachLine(F body) const {
    for (auto* list : {&added_, &given_, &ofFile_, &builtIn()})
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
    if (!author && !restricted_) return kEverything | Right::policy;
    if (!author || author->kind() != Principal::Kind::several) return rightsOfOne(author.get(), subject);
    Rights out = author->members().empty() ? Rights(0) : kEverything;
    for (auto& member : author->members()) out = Rights(out & rightsOfOne(member.get(), subject));
    return out;
}

Rights Access::rightsOfOne(const Principal* who, std::string_view subject) const {
    Rights out = who ? Rights(0) : Rights(kTune | Rights(Right::operate));      // of a safe interpreter on its own objects
    for (auto& w : kWords) {
        if (w.doing == nullptr || w.rights == Rights(Right::policy)) continue;
        if (auto* line = decide(who, Right(w.rights), subject)) out = Rights(line->allow ? out | w.rights : out & ~w.rights);
    }
    return out;
}

Permit Access::ask(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object) {
    const Rights all = rights(author, subject);
    if (!(all & Rights(right))) refuse(author, right, subject, object);
    return Permit(all, subject);
}

std::string Access::remedy(const PrincipalPointer& author, Right right, std::string_view subject) const {
    if (right == Right::policy) return "only this daemon's own user may, by Unix socket";
    std::string on;
    if (right == Right::dictionary || right == Right::configure || right == Right::make || right == Right::call || right == Right::inspect ||
        right == Right::operate || right == Right::relay) {
        auto dot = subject.find('.');
        on = dot == subject.npos ? patternFor(subject) : patternFor(subject.substr(0, dot)) + ".*";
    } else {
        on = patternFor(subject);
    }
    std::string what = std::string(toText(right)) + " on " + on;
    if (!author) return "its parent can grant it: sorma::grant INTERP allow " + what;
    std::string file = file_.empty() ? "~/.config/sorma/policy" : file_;
    std::string who = author->toText();
    if (author->kind() == Principal::Kind::several) {       // each needs the right: a line for the first who has it not
        for (auto& member : author->members()) {
            if (rightsOfOne(member.get(), subject) & Rights(right)) continue;
            who = member->toText();
            break;
        }
    }
    return "allow it with sormad -allow \"" + who + " " + what + "\" or that line in " + file;
}

void Access::refuse(const PrincipalPointer& author, Right right, std::string_view subject, std::string_view object) {
    std::string named(object);
    if (!daemon.empty() && named.find('@') == named.npos) named += "@" + daemon;
    std::string doing = wordOf(right).doing;
    // tcp:HOST:PORT is an address; a path and the name of a package are not.
    const auto colon = subject.find(':');
    if (right == Right::files && !subject.starts_with("/") && colon != subject.npos && !subject.substr(colon).starts_with("::")) doing = "have address {} reached";
    if (auto at = doing.find("{}"); at != doing.npos) doing.replace(at, 2, subject);
    std::string who = author ? whoText(author) : std::string("this interpreter is safe and");
    note(author, who + ": " + doing);
    fail(kDenied, named, toText(right), who, doing, remedy(author, right, subject));
}

void Access::note(const PrincipalPointer& author, const std::string& what) {
    ++denials_;
    std::string text = cutText(what, kKeptText);
    std::replace(text.begin(), text.end(), '\n', '?');
    auto known = std::find_if(denied_.begin(), denied_.end(), [&](auto& d) { return d->text == text; });
    Denial denial{wallNow(), text, 1};
    if (known != denied_.end()) {
        denial.times += (*known)->times;
        denied_.erase(known);
    } else if (denied_.size() == kDeniedLength) {
        denied_.pop_front();
    }
    denied_.push_back(Charged<Denial>::forced(budget && author ? budget->of(author) : nullptr, Account::Use::records, std::move(denial)));
}

std::string Access::deniedText() const {
    std::string out = std::to_string(denials_) + " refused";
    for (auto d = denied_.rbegin(); d != denied_.rend(); ++d)
        out += "\n" + clockText((*d)->time) + " " + (*d)->text + ((*d)->times > 1 ? ", " + std::to_string((*d)->times) + " times" : "");
    return out;
}

// ---- the policy ----

// `sormad -allow` takes the line without its first word as well, since that is what its name says.
Access::Line Access::parseGiven(std::string_view text, std::string source) {
    std::string whole(text);
    auto words = wordsOf(text);
    if (!words.empty() && words[0] != "allow" && words[0] != "deny" && words[0] != "revoke") whole = "allow " + whole;
    return parse(whole, std::move(source));
}

void Access::add(std::string_view text, std::string source) {
    given_.push_back(parseGiven(text, std::move(source)));
    anotherHolds();
}

int Access::addFirst(std::string_view text, const std::string& source) {
    Line line = parseGiven(text, source);
    line.line = ++lastAdded_;
    line.source = source + ", line " + std::to_string(line.line);
    added_.insert(added_.begin(), std::move(line));
    anotherHolds();
    return lastAdded_;
}

void Access::remove(int number) {
    auto at = std::find_if(added_.begin(), added_.end(), [&](auto& line) { return line.line == number; });
    if (at == added_.end()) {
        std::string known;
        for (auto& line : added_) known += (known.empty() ? ": " : ", ") + std::to_string(line.line);
        fail(kLine, number, known.empty() ? ", and there is none" : known);
    }
    added_.erase(at);
    anotherHolds();
}

void Access::anotherHolds() {
    ++epoch_;
    auto watchers = watchers_;                          // one may come or go meanwhile
    for (auto& [who, changed] : watchers)
        if (watchers_.contains(who)) changed();
}

void Access::load(const std::string& file) {
    const Descriptor in(open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    auto wrong = [&](const std::string& why) { fail(kFile, file, why); };
    struct stat facts{};
    if (!in || fstat(in.get(), &facts) != 0) wrong(std::strerror(errno));
    if (!S_ISREG(facts.st_mode)) wrong("it is no file");
    if (facts.st_uid != geteuid() && facts.st_uid != 0) wrong("it belongs to " + userName(facts.st_uid) + "; it must be this user's, or root's");
    if (facts.st_mode & (S_IWGRP | S_IWOTH)) wrong("others than its owner may write to it; chmod go-w it");
    std::string text;
    char block[4096];
    for (ssize_t n; (n = read(in.get(), block, sizeof block)) != 0;) {
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
        case Line::Subject::cert: who = Principal::cert(parsed.certificates[0], {}, {}, true, {}); break;
        case Line::Subject::web: who = Principal::web(parsed.certificates[0]); break;
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
