#include "etcdDirectory.h"

#include <algorithm>
#include <fstream>

#include <sorma.h>

#include "comm/keys.h"
#include "comm/random.h"
#include "lease.h"

namespace etcd {

namespace {

using sorma::Prototype;
using sorma::Severity;

constexpr std::int64_t kMillisecond = 1'000'000;
constexpr std::int64_t kProbe = 2'000 * kMillisecond;       // [ns] between questions whether what we know is true
constexpr std::int64_t kLastPause = 2'000 * kMillisecond;   // [ns] between attempts, at most
constexpr std::int64_t kConfirmed = 100 * kMillisecond;     // [ns] nobody has a name: for so long after that was heard
constexpr std::int64_t kStale = 2 * kProbe;                 // [ns] after that nobody has moved the loop
constexpr std::int64_t kKeep = 10'000 * kMillisecond;       // [ns] between looks whether the cache is still true, at most
constexpr std::int64_t kKeepAtMost = 60'000'000;            // [us] that it says so without being written again
constexpr long kPatience = 1500;                            // [ms] for an answer
// A password costs etcd 50 ms of a processor, also when the client has gone meanwhile. After its start all clients log in at once.
constexpr long kLogIn = 15'000;                             // [ms] for the answer
constexpr std::size_t kMostDoubts = 1000;

const Prototype kWord{Severity::error, "DIRECTORY SYNTAX", 1,
    "@directory: {} {}; expected etcd:URL,... ?-prefix NAME? ?-user NAME -password FILE? ?-authority FILE? ?-certificate FILE -key FILE? ?-lease SECONDS?"};

std::string firstLine(const std::string& file) {
    std::ifstream in(file);
    std::string line;
    if (!std::getline(in, line)) sorma::fail(kWord, file, "cannot be read");
    if (const auto why = sorma::keys::exposed(file); !why.empty()) sorma::fail(kWord, file, why);
    return line;
}

bool goodPrefix(const std::string& text) {
    return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == '.' || c == '/'; });
}

std::string existing(const std::string& file) { return std::ifstream(file) ? file : std::string(); }

// SORMA's own keys, for what the line leaves unsaid.
void fillIn(Keys& keys) {
    if (keys.authority.empty()) keys.authority = existing(sorma::keys::file("authority.pem"));
    if (!keys.certificate.empty()) return;
    const std::string own = sorma::keys::ownName({});
    if (!own.empty()) keys.certificate = keys.key = existing(sorma::keys::file(own + ".pem"));
}

}  // namespace

EtcdDirectory::Settings EtcdDirectory::Settings::of(const std::vector<std::string>& words) {
    Settings out;
    bool secure = false;
    std::string urls = words[0].substr(words[0].find(':') + 1) + ',';
    for (std::size_t comma; (comma = urls.find(',')) != urls.npos; urls.erase(0, comma + 1)) {
        std::string url = urls.substr(0, comma);
        while (url.ends_with('/')) url.pop_back();
        if (!url.starts_with("http://") && !url.starts_with("https://")) sorma::fail(kWord, '"' + url + '"', "is no URL that begins with http:// or https://");
        secure = secure || url.starts_with("https:");
        out.servers.push_back(url);
    }
    std::string password, lease = "10";
    const std::map<std::string, std::string*> options{{"-prefix", &out.prefix},           {"-user", &out.user},
                                                      {"-password", &password},           {"-authority", &out.keys.authority},
                                                      {"-certificate", &out.keys.certificate}, {"-key", &out.keys.key},             {"-lease", &lease}};
    for (std::size_t k = 1; k < words.size(); k += 2) {
        const auto option = options.find(words[k]);
        if (option == options.end()) sorma::fail(kWord, '"' + words[k] + '"', "is none of its options");
        if (k + 1 == words.size()) sorma::fail(kWord, words[k], "needs a value");
        *option->second = words[k + 1];
    }
    if (!sorma::parseNumber(lease, out.lease) || out.lease < 2 || out.lease > 3600) sorma::fail(kWord, "-lease \"" + lease + '"', "is no whole number of seconds from 2 to 3600");
    if (!goodPrefix(out.prefix)) sorma::fail(kWord, "-prefix \"" + out.prefix + '"', "has other characters than letters, digits and _ - . /");
    if (out.user.empty() != password.empty()) sorma::fail(kWord, "-user and -password", "belong together");
    if (!password.empty()) out.password = firstLine(password);
    if (secure) fillIn(out.keys);
    return out;
}

EtcdDirectory::EtcdDirectory(sorma::Loop& loop, Settings settings) : settings_(std::move(settings)), http_(loop, settings_.keys), alarms_(loop),
      lease_(std::make_unique<Lease>(*this, settings_.lease * 1000 * kMillisecond)), cache_(describe() + " " + settings_.user) {}

EtcdDirectory::~EtcdDirectory() {
    changed = nullptr;
    release(lease_->names());
}

std::string EtcdDirectory::describe() const {
    std::string out = "etcd";
    for (auto& server : settings_.servers) out += (out.size() > 4 ? "," : " ") + server;
    return out + ", prefix " + settings_.prefix;
}

std::int64_t EtcdDirectory::jitter(std::int64_t most) { return most / 2 + std::int64_t(sorma::randomNumber() % std::uint64_t(most / 2 + 1)); }

// ---- questions ----

EtcdDirectory::Number EtcdDirectory::ask(const std::string& path, std::string body, long milliseconds, Replied replied) {
    const Number number = ++last_;
    questions_.emplace(number, Question{path, std::move(body), milliseconds, std::move(replied)});
    if (!settings_.user.empty() && token_.empty()) logIn();
    else post(number);
    return number;
}

void EtcdDirectory::end(Number& number) {
    const auto found = questions_.find(std::exchange(number, 0));
    if (found == questions_.end()) return;
    http_.end(found->second.request);
    questions_.erase(found);
}

void EtcdDirectory::post(Number number) {
    Question& question = questions_.at(number);
    question.token = token_;
    question.request = http_.post(settings_.servers[server_] + "/v3/" + question.path, token_, question.body, question.milliseconds,
                                  [this, number, server = server_](Http::Answer answer) { answered(number, server, std::move(answer)); });
}

void EtcdDirectory::logIn() {
    if (loggingIn_ != 0) return;
    loggingIn_ = http_.post(settings_.servers[server_] + "/v3/auth/authenticate", {},
                            "{\"name\":" + quoted(settings_.user) + ",\"password\":" + quoted(settings_.password) + "}", kLogIn,
                            [this, server = server_](Http::Answer answer) {
                                loggingIn_ = 0;
                                if (answer.status == 200) token_ = Json::parse(answer.body)["token"].text();
                                std::vector<Number> waiting;
                                for (auto& [number, question] : questions_)
                                    if (question.request == 0) waiting.push_back(number);
                                for (const Number number : waiting) {
                                    if (!questions_.contains(number)) continue;
                                    if (!token_.empty()) post(number);
                                    else answered(number, server, answer);
                                }
                            });
}

void EtcdDirectory::answered(Number number, std::size_t server, Http::Answer answer) {
    const auto found = questions_.find(number);
    if (found == questions_.end()) return;
    Question question = std::move(found->second);
    questions_.erase(found);
    Reply reply;
    reply.server = server;
    reply.json = Json::parse(answer.body);
    const Json& error = reply.json["error"];
    const bool silent = answer.status == 0;
    const std::int64_t code = reply.json["code"].empty() ? error["grpc_code"].number() : reply.json["code"].number();
    constexpr std::int64_t kLate = 4, kUnavailable = 14, kUnknownUser = 16;        // of gRPC
    if (silent) reply.why = answer.why;
    else if (!error.empty()) reply.why = error.text().empty() ? error["message"].text() : error.text();
    else if (answer.status != 200 && !reply.json["message"].empty()) reply.why = reply.json["message"].text();     // etcd 3.5
    else if (answer.status != 200) reply.why = "it answers with HTTP status " + std::to_string(answer.status);
    else if (reply.json.empty()) reply.why = "its answer is no JSON: is it etcd?";
    if ((code == kUnknownUser || answer.status == 401) && !settings_.user.empty()) {
        if (question.token == token_) token_.clear();
        if (!std::exchange(question.again, true)) {
            question.request = 0;
            questions_.emplace(number, std::move(question));
            return token_.empty() ? logIn() : post(number);
        }
    }
    reply.heard = !silent && !reply.why.empty() && code != kLate && code != kUnavailable && code != kUnknownUser;
    if (!reply.why.empty()) reply.why = settings_.servers[server] + ": " + reply.why;
    if (!reply.why.empty() && !reply.heard && server == server_) server_ = (server_ + 1) % settings_.servers.size();
    question.replied(reply);
}

// ---- what is known ----

std::string EtcdDirectory::range() const {
    return "\"key\":" + base64(settings_.prefix + "/") + ",\"range_end\":" + base64(settings_.prefix + "0");      // 0 comes after /
}

sorma::Directory::Entry EtcdDirectory::entryOf(const std::string& name, const Json& pair) {
    const Json value = Json::parse(plain(pair["value"].text()));
    Entry entry{name, value["identity"].text(), value["machine"].text(), {}, pair["create_revision"].number()};
    for (auto& address : value["addresses"].items()) entry.addresses.push_back(address.text());
    return entry;
}

std::string EtcdDirectory::valueOf(const Entry& entry) {
    std::string addresses;
    for (auto& address : entry.addresses) addresses += (addresses.empty() ? "" : ",") + quoted(address);
    return "{\"identity\":" + quoted(entry.identity) + ",\"machine\":" + quoted(entry.machine) + ",\"addresses\":[" + addresses + "]}";
}

void EtcdDirectory::read() {
    http_.end(std::exchange(watching_, 0));
    end(probing_);
    const std::int64_t asked = sorma::monotonicNow();
    end(reading_);
    reading_ = ask("kv/range", "{" + range() + "}", kPatience, [this, asked](const Reply& reply) {
        reading_ = 0;
        if (!reply.why.empty()) return failed(reply.why);
        const std::int64_t revision = reply.json["header"]["revision"].number();
        learn(reply.json, revision);
        const bool first = !std::exchange(read_, true);
        heard(asked);
        watch(revision + 1);
        keep();
        if (first) tell({});
    });
}

void EtcdDirectory::learn(const Json& range, std::int64_t revision) {
    std::map<std::string, Json> now;
    for (auto& pair : range["kvs"].items())
        if (std::string key = plain(pair["key"].text()); key.size() > settings_.prefix.size()) {
            key.erase(0, settings_.prefix.size() + 1);
            now.emplace(key, pair);
        }
    std::vector<std::string> gone;
    for (auto& [name, entry] : names_)
        if (!now.contains(name)) gone.push_back(name);
    for (auto& name : gone) note(name, {}, 0, revision);
    for (auto& [name, pair] : now) note(name, entryOf(name, pair), pair["lease"].number(), revision);
    revision_ = revision;
}

// One of many processes writes what has changed; and from time to time, that it is still true.
void EtcdDirectory::keep() {
    alarms_.set(keep_, jitter(kKeep), [this] { keep(); });
    const std::int64_t now = sorma::wallNow();
    const Cache::Head head = cache_.read();
    if (!fresh() || (head.revision == revision_ && now - head.heard < kKeepAtMost)) return;
    std::string pairs;
    for (auto& [name, entry] : names_)
        pairs += (pairs.empty() ? "" : ",") + ("{\"key\":" + base64(key(name))) + ",\"value\":" + base64(valueOf(entry)) + ",\"create_revision\":\"" + std::to_string(entry.epoch) + "\"}";
    cache_.write({revision_, now}, "{\"kvs\":[" + pairs + "]}");
}

void EtcdDirectory::recall() {
    std::string json;
    const Cache::Head head = cache_.read(&json);
    if (head.revision == 0) return;
    learn(Json::parse(json), head.revision);
    heardAt_ = sorma::monotonicNow() - std::max<std::int64_t>(sorma::wallNow() - head.heard, 1) * 1000;
}

void EtcdDirectory::watch(std::int64_t revision) {
    watching_ = http_.post(settings_.servers[server_] + "/v3/watch", token_,
                           "{\"create_request\":{" + range() + ",\"start_revision\":\"" + std::to_string(revision) + "\"}}", 0,
                           [this](Http::Answer answer) {
                               watching_ = 0;
                               failed(answer.why.empty() ? "it has ended the watch" : answer.why);
                           },
                           [this](std::string_view line) { take(line); });
}

void EtcdDirectory::take(std::string_view line) {
    const Json json = Json::parse(line);
    const Json& result = json["result"];
    if (!result["canceled"].empty() || !json["error"].empty()) {
        http_.end(std::exchange(watching_, 0));
        return failed("it has cancelled the watch");
    }
    for (auto& event : result["events"].items()) {
        const Json& pair = event["kv"];
        std::string name = plain(pair["key"].text());
        if (name.size() <= settings_.prefix.size()) continue;
        name.erase(0, settings_.prefix.size() + 1);
        revision_ = std::max(revision_, pair["mod_revision"].number());
        note(name, event["type"].text() == "DELETE" ? Entry{} : entryOf(name, pair), pair["lease"].number(), pair["mod_revision"].number());
    }
}

void EtcdDirectory::note(const std::string& name, Entry entry, std::int64_t lease, std::int64_t revision) {
    const auto known = names_.find(name);
    const bool other = known == names_.end() ? entry.epoch != 0 : known->second.epoch != entry.epoch;
    const std::int64_t epoch = entry.epoch;
    if (epoch == 0 && known != names_.end()) names_.erase(known);
    else if (epoch != 0) names_[name] = std::move(entry);
    lease_->seen(name, epoch, lease, revision);
    if (other) tell(name);
}

void EtcdDirectory::owned(Entry entry, std::int64_t epoch) {
    if (heardAt_ == 0) heardAt_ = sorma::monotonicNow();
    entry.epoch = epoch;
    const std::string name = entry.name;
    note(name, std::move(entry), 0, epoch);
}

// A daemon that has just come may be ahead of the watch.
void EtcdDirectory::confirm(const std::string& name) {
    if (doubts_.size() >= kMostDoubts) {
        for (auto& [other, doubt] : doubts_) end(doubt.asking);
        doubts_.clear();
    }
    doubts_[name].asking = ask("kv/range", "{\"key\":" + base64(key(name)) + "}", kPatience, [this, name](const Reply& reply) {
        Doubt& doubt = doubts_[name];
        doubt.asking = 0;
        if (!reply.why.empty()) return failed(reply.why);
        doubt.answered = sorma::monotonicNow();
        const auto& pairs = reply.json["kvs"].items();
        if (!pairs.empty()) note(name, entryOf(name, pairs.front()), pairs.front()["lease"].number(), reply.json["header"]["revision"].number());
        tell(name);
    });
}

void EtcdDirectory::probe() {
    const std::int64_t asked = sorma::monotonicNow();
    end(probing_);
    probing_ = ask("kv/range", quorum(), kPatience, [this, asked](const Reply& reply) {
        probing_ = 0;
        if (!reply.why.empty()) failed(reply.why);
        else if (watching_ != 0) heard(asked);          // else all names are read again soon
    });
}

void EtcdDirectory::heard(std::int64_t asked) {
    failures_ = 0;
    heardAt_ = asked;
    alarms_.set(next_, jitter(kProbe), [this] { probe(); });
}

// Each server is asked once without a pause. After that all of them are away.
void EtcdDirectory::failed(const std::string& why) {
    why_ = why;
    const std::size_t rounds = ++failures_ / settings_.servers.size();
    const std::int64_t pause = rounds == 0 ? 0 : jitter(std::min(kLastPause, 20 * kMillisecond << std::min<std::size_t>(rounds, 10)));
    alarms_.set(next_, pause, [this] { read(); });
    if (rounds == 1 && revision_ == 0 && names_.empty()) recall();
    if (rounds == 1) tell({});
}

// A program that only makes blocking calls has no loop that would do this.
void EtcdDirectory::turn() {
    alarms_.run();
    http_.turn();
    alarms_.run();
}

void EtcdDirectory::wait(std::int64_t until) {
    http_.wait(alarms_.first(until));
    alarms_.run();
}

sorma::Directory::Found EtcdDirectory::find(const std::string& name) {
    using State = Found::State;
    begin();
    if (heardAt_ != 0 && sorma::monotonicNow() - heardAt_ > kStale) turn();
    for (bool again = true;; again = false) {
        if (const auto known = names_.find(name); known != names_.end())
            return {State::known, known->second, failures_ < settings_.servers.size() ? 0 : sorma::monotonicNow() - heardAt_, {}};
        const auto doubt = doubts_.find(name);
        if (fresh() && doubt != doubts_.end() && doubt->second.answered + kConfirmed > sorma::monotonicNow()) return {State::absent, {}, 0, "nobody has the name " + name};
        if (fresh() && (doubt == doubts_.end() || doubt->second.asking == 0)) confirm(name);
        if (!again) break;
        turn();
    }
    if (failures_ < settings_.servers.size()) return {State::asking, {}, 0, "the directory has not answered yet"};
    return {State::away, {}, 0, "it is away, and " + name + " is not known from before: " + why_};
}

std::vector<sorma::Directory::Entry> EtcdDirectory::entries() {
    begin();
    std::vector<Entry> out;
    for (auto& [name, entry] : names_) out.push_back(entry);
    return out;
}

// ---- what is claimed ----

void EtcdDirectory::claim(const Entry& wanted) {
    begin();
    lease_->claim(wanted);
}

sorma::Directory::Claim EtcdDirectory::claimed(const std::string& name) { return lease_->claimed(name); }

void EtcdDirectory::release(const std::vector<std::string>& names) {
    lease_->release(names);
    for (const auto deadline = sorma::Deadline::in(500); lease_->gives() && !deadline.passed();) wait(deadline.when());
}

std::unique_ptr<sorma::Directory> row(sorma::Sorm&, sorma::Loop& loop, const std::vector<std::string>& words) {
    return std::make_unique<EtcdDirectory>(loop, EtcdDirectory::Settings::of(words));
}

}  // namespace etcd
