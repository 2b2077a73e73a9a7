#include "comm/directory.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ctime>
#include <mutex>

#include "bus/catalogue.h"
#include "bus/statistics.h"
#include "comm/errors.h"

namespace sorma {

namespace {

constexpr std::string_view kEntry = "@directory";

const Prototype kMissing{Severity::error, "DIRECTORY MISSING", 1,
    "{}: nothing here knows directories of the kind \"{}\"; for etcd install libcurl4-openssl-dev and nlohmann-json3-dev, then configure and build again"};
const Prototype kForeign{Severity::error, "DIRECTORY DENIED", 1,
    "{}: this entry of the dictionary was written by {}, and only the owner of this process may choose the directory"};
const Prototype kSyntax{Severity::error, "DIRECTORY SYNTAX", 1, "{}: the entry is empty; expected KIND:PLACE, such as etcd:http://localhost:2379"};
const Prototype kAway{Severity::warning, "DIRECTORY AWAY", 1, "{}: {} does not answer; what it said {} ago serves meanwhile"};

// Few: searched from the front.
std::vector<std::pair<std::string, Directory::Row>>& rows() {
    static std::vector<std::pair<std::string, Directory::Row>> all;
    return all;
}

Directory::Row rowOf(const std::string& kind) {
    for (auto& [own, row] : rows())
        if (own == kind) return row;
    return nullptr;
}

bool ownSocket(const std::string& path) {
    struct stat s{};
    return stat(path.c_str(), &s) == 0 && S_ISSOCK(s.st_mode) && s.st_uid == geteuid();
}

bool loopback(const std::string& host) { return host.starts_with("127.") || host == "localhost" || host == "::1"; }

}  // namespace

// Several threads may load the module. Once `steps` is set nothing is added, so readers need no lock.
void Directory::add(const std::string& kind, Row row) {
    static std::mutex mutex;
    std::lock_guard lock(mutex);
    if (!rowOf(kind)) rows().emplace_back(kind, row);
}

std::atomic<Directory::Steps> Directory::steps{nullptr};

void Directory::load(Sorm& sorm) {
    if (!steps && sorm.host()) sorm.host()->loadClass("directory");
}

std::int64_t bootNow() {
    timespec t{};
    clock_gettime(CLOCK_BOOTTIME, &t);
    return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}

const std::string& thisMachine() {
    static const std::string id = [] {
        char text[64];
        const Descriptor fd(open("/proc/sys/kernel/random/boot_id", O_RDONLY | O_CLOEXEC));
        const ssize_t n = fd ? read(fd.get(), text, sizeof text) : 0;
        return std::string(text, n > 0 ? std::size_t(n - 1) : 0);
    }();
    return id;
}

bool ChosenDirectory::remote() const { return sorm_.dictionary().has(kEntry); }

ChosenDirectory::~ChosenDirectory() {
    if (directory_) directory_->changed = nullptr;      // a daemon may keep it for its name
}

std::shared_ptr<Directory> ChosenDirectory::get() {
    std::vector<std::string> words;
    if (remote()) {
        if (const auto& author = sorm_.dictionary().authorOf(kEntry)) fail(kForeign, kEntry, author->toText());
        for (auto& word : sorm_.dictionary().expand(kEntry)) words.push_back(word.text);
        if (words.empty()) fail(kSyntax, kEntry);
    }
    if (directory_ && words == words_) return directory_;
    const std::string kind = words.empty() ? "local" : words[0].substr(0, words[0].find(':'));
    Directory::load(sorm_);
    const auto row = rowOf(kind);
    if (!row) fail(kMissing, kEntry, kind);
    std::shared_ptr<Directory> made = row(sorm_, loop_, words);
    made->changed = [this](const std::string&) {
        if (changed) changed();
    };
    if (directory_) directory_->changed = nullptr;
    directory_ = std::move(made);
    words_ = std::move(words);
    return directory_;
}

Transport::Found ChosenDirectory::place(const Address& alias) {
    using State = Transport::Found::State;
    Transport::Found folder = transportOf(alias).place(alias);
    if (!remote()) return folder;
    try {
        const auto directory = get();
        Directory::Found found = directory->find(alias.host);
        if (found.state == Directory::Found::State::asking) return {State::asks, alias, found.why};
        if (found.state != Directory::Found::State::known) {
            if (folder.state == State::absent) folder.why = directory->describe() + ": " + found.why;
            return folder;
        }
        tellAge(found);
        for (auto& text : found.entry.addresses) {
            Address target = Address::parse(text);
            const bool path = target.kind == Address::Kind::path, tcp = target.kind == Address::Kind::tcp;
            if ((path || (tcp && loopback(target.host))) && found.entry.machine != thisMachine()) continue;
            if (path ? !ownSocket(target.host) : !tcp) continue;
            target.wait = alias.wait, target.tls = alias.tls, target.as = alias.host;
            return {State::known, target, {}, found.entry.epoch};
        }
        return {State::absent, alias, directory->describe() + ": " + alias.host + " is at " + found.entry.identity + ", which can be reached from its own host alone"};
    } catch (const Error& e) {
        return {State::absent, alias, e.what()};
    }
}

void ChosenDirectory::tellAge(const Directory::Found& found) {
    if (found.age > 0 && !told_)
        sorm_.announce(errors::trailOf(kAway, kEntry, directory_->describe(), durationText(double(found.age))));
    told_ = found.age > 0;
}

}  // namespace sorma
