#include "lease.h"

#include <algorithm>

#include "bus/statistics.h"

namespace etcd {

using State = sorma::Directory::Claim::State;

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr const char* kLate = "it was not renewed in time";

std::string number(std::int64_t n) { return '"' + std::to_string(n) + '"'; }

// The keys of the first range in a transaction.
std::vector<Json> firstPairs(const Json& json) {
    const auto answers = json["responses"].items();
    return answers.empty() ? std::vector<Json>() : answers.front()["response_range"]["kvs"].items();
}

}  // namespace

Lease::Lease(EtcdDirectory& directory, std::int64_t timeToLive) : directory_(directory), timeToLive_(timeToLive) {}

Lease::~Lease() { forget(); }

void Lease::forget() {
    for (auto* question : {&renewing_, &asking_, &revoking_}) directory_.end(*question);
    for (auto* alarm : {&renewal_, &end_, &again_}) directory_.alarms().cancel(*alarm);
    names_.clear();
}

std::vector<std::string> Lease::namesThat(bool (*are)(const Name& own)) const {
    std::vector<std::string> out;
    for (auto& [name, own] : names_)
        if (are(own)) out.push_back(name);
    return out;
}

// ---- what is wanted ----

void Lease::claim(const sorma::Directory::Entry& wanted) {
    const bool other = names_.contains(wanted.name);
    names_[wanted.name] = Name{.wanted = wanted, .remove = other};
    next();
}

// The clock decides, not a timer: a process that was stopped handles requests before its timers.
Lease::Claim Lease::claimed(const std::string& name) const {
    const auto found = names_.find(name);
    if (found == names_.end() || found->second.released) return {};
    const Name& own = found->second;
    if (own.state != State::owned) return {own.state, 0, 0, 0, own.why};
    if (sorma::bootNow() >= until_) return {State::lost, 0, 0, 0, kLate};
    return {State::owned, own.epoch, renewed_, until_, {}};
}

std::vector<std::string> Lease::names() const {
    return namesThat([](const Name& own) { return !own.released; });
}

void Lease::release(const std::vector<std::string>& names) {
    for (auto& name : names)
        if (const auto found = names_.find(name); found != names_.end()) found->second.due = found->second.remove = found->second.released = true;
    if (names_.empty()) return;
    if (Lease::names().empty()) revoke();
    else next();
}

bool Lease::gives() const {
    return revoking_ != 0 || std::any_of(names_.begin(), names_.end(), [](auto& item) { return item.second.released; });
}

// A question that is still on its way can put nothing after that.
void Lease::revoke() {
    forget();
    if (id_ == 0) return;
    revoking_ = directory_.ask("lease/revoke", "{\"ID\":" + number(std::exchange(id_, 0)) + "}", 500, [this](const EtcdDirectory::Reply&) { revoking_ = 0; });
}

void Lease::become(const std::string& name, State state, const std::string& why) {
    const auto found = names_.find(name);
    if (found == names_.end()) return;
    const bool other = found->second.state != state || found->second.why != why;
    found->second.state = state;
    found->second.why = why;
    if (other) directory_.tell(name);
}

// ---- the lease ----

// An answer is awaited for a sixth of the time to live: then there is time for another server.
void Lease::renew() {
    const std::int64_t asked = sorma::bootNow();
    directory_.alarms().cancel(renewal_);
    directory_.end(renewing_);
    const bool grant = id_ == 0;
    const std::string body = grant ? "{\"TTL\":" + number(timeToLive_ / kSecond) + "}" : directory_.quorum();
    renewing_ = directory_.ask(grant ? "lease/grant" : "kv/range", body, patience(), [this, asked, grant](const EtcdDirectory::Reply& reply) {
        renewing_ = 0;
        if (grant || !reply.why.empty()) return renewed(asked, reply);
        keepAlive(asked, reply.server);
    });
}

// A server may believe that it leads when another one does. Until it hears of that one it keeps leases alive in vain. But then it
// cannot answer for a quorum. The next leader gives each lease its whole time again. So the time counts from that question, to the same server.
void Lease::keepAlive(std::int64_t asked, std::size_t server) {
    renewing_ = directory_.ask("lease/keepalive", "{\"ID\":" + number(id_) + "}", patience(), [this, asked, server](EtcdDirectory::Reply reply) {
        renewing_ = 0;
        if (reply.why.empty() && reply.server != server) reply.why = "another server has answered";
        renewed(asked, reply);
    });
}

void Lease::renewed(std::int64_t asked, const EtcdDirectory::Reply& reply) {
    if (!reply.why.empty()) {
        for (auto& name : namesThat([](const Name& own) { return own.state == State::asking; })) become(name, State::asking, reply.why);
        return directory_.alarms().set(renewal_, directory_.jitter(timeToLive_ / 20), [this] { renew(); });
    }
    const Json lease = id_ == 0 ? reply.json : reply.json["result"];
    const std::int64_t seconds = lease["TTL"].number();
    if (seconds <= 0) {
        id_ = 0;
        directory_.end(asking_);
        lose("its lease has ended");
        return renew();
    }
    id_ = lease["ID"].number();
    renewed_ = asked;
    until_ = asked + std::min(timeToLive_, seconds * kSecond) * 4 / 5;
    directory_.alarms().set(renewal_, directory_.jitter(timeToLive_ / 3), [this] { renew(); });
    directory_.alarms().set(end_, until_ - sorma::bootNow(), [this] {
        if (sorma::bootNow() < until_) return;
        lose(kLate);
        renew();
    });
    askAgain();
}

void Lease::lose(const std::string& why) {
    for (auto& name : namesThat([](const Name& own) { return own.state == State::owned; })) become(name, State::lost, why);
}

// ---- its keys ----

void Lease::next() {
    if (id_ == 0 && renewing_ == 0) renew();
    if (id_ == 0 || asking_ != 0) return;
    std::vector<std::string> due;
    for (auto& [name, own] : names_) {
        if (!own.due) continue;
        if (own.remove) return remove(name);
        if (due.size() < most_) due.push_back(name);
    }
    if (!due.empty()) put(due);
}

void Lease::askAgain() {
    for (auto& [name, own] : names_) own.due = own.remove || own.state != State::owned;
    next();
}

void Lease::ask(const std::vector<std::string>& names, std::string body, std::function<void(const Json& json)> answered) {
    for (auto& name : names) names_.at(name).due = false, names_.at(name).told = {};
    asking_ = directory_.ask("kv/txn", std::move(body), patience(), [this, names, answered = std::move(answered)](const EtcdDirectory::Reply& reply) {
        asking_ = 0;
        if (reply.why.empty()) {
            answered(reply.json);
        } else if (reply.heard && names.size() > 1) {       // perhaps for one of them alone
            most_ = 1;
            for (auto& name : names) names_.at(name).due = true;
        } else {
            for (auto& name : names)
                if (claimed(name).state == State::asking) become(name, State::asking, reply.why);
            directory_.alarms().set(again_, directory_.jitter(timeToLive_ / 10), [this] { askAgain(); });
        }
        next();
    });
}

// The lease that a key has tells whether it is ours. A question that was given up may arrive after the name was put again: so it removes
// the key of one grant.
void Lease::remove(const std::string& name) {
    const std::string key = base64(directory_.key(name));
    const auto removed = [this, name] {
        const auto found = names_.find(name);
        if (found->second.released) names_.erase(found);
        else found->second.due = true, found->second.remove = false;
    };
    ask({name}, "{\"compare\":[{\"target\":\"LEASE\",\"key\":" + key + ",\"lease\":" + number(id_) + "}],\"success\":[{\"requestRange\":{\"key\":" + key + "}}]}",
        [this, name, key, removed](const Json& json) {
            const auto pairs = firstPairs(json);
            if (pairs.empty()) return removed();
            ask({name}, "{\"compare\":[{\"target\":\"CREATE\",\"key\":" + key + ",\"create_revision\":" + number(pairs.front()["create_revision"].number()) + "}],"
                "\"success\":[{\"requestDeleteRange\":{\"key\":" + key + "}}]}", [removed](const Json&) { removed(); });
        });
}

void Lease::put(const std::vector<std::string>& names) {
    std::string compare, success, failure, comma;
    for (auto& name : names) {
        const std::string key = base64(directory_.key(name));
        compare += comma + "{\"target\":\"CREATE\",\"key\":" + key + ",\"create_revision\":\"0\"}";
        success += comma + "{\"requestPut\":{\"key\":" + key + ",\"value\":" + base64(EtcdDirectory::valueOf(names_.at(name).wanted)) + ",\"lease\":" + number(id_) + "}}";
        failure += comma + "{\"requestRange\":{\"key\":" + key + "}}";
        comma = ",";
    }
    ask(names, "{\"compare\":[" + compare + "],\"success\":[" + success + "],\"failure\":[" + failure + "]}", [this, names](const Json& json) {
        const auto answers = json["responses"].items();
        const bool all = !json["succeeded"].empty();
        for (std::size_t k = 0; k < std::min(names.size(), answers.size()); ++k) {
            const auto pairs = answers[k]["response_range"]["kvs"].items();
            if (!names_.contains(names[k])) return;
            if (all) owned(names[k], json["header"]["revision"].number());
            else if (pairs.empty()) names_.at(names[k]).due = true;     // it is free, but another one of them is not
            else found(names[k], pairs.front());
        }
    });
}

void Lease::found(const std::string& name, const Json& pair) {
    Name& own = names_.at(name);
    const auto other = EtcdDirectory::entryOf(name, pair);
    if (pair["lease"].number() != id_) return become(name, State::taken, other.identity);
    if (plain(pair["value"].text()) == EtcdDirectory::valueOf(own.wanted)) return owned(name, other.epoch);
    own.due = own.remove = true;
}

// When the lease has ended here before that, the answer to a renewal makes us ask again.
void Lease::owned(const std::string& name, std::int64_t epoch) {
    Name& own = names_.at(name);
    if (own.remove || sorma::bootNow() >= until_) return;
    if (own.told.revision > epoch && own.told.epoch != epoch) {
        own.due = true;                 // the watch was faster than the answer, and the key has gone since
        return;
    }
    own.epoch = epoch;
    own.due = false;
    const auto wanted = own.wanted;
    become(name, State::owned, {});
    // The directory may go away before its watch has told that.
    directory_.owned(wanted, epoch);
}

void Lease::seen(const std::string& name, std::int64_t epoch, std::int64_t lease, std::int64_t revision) {
    const auto known = names_.find(name);
    if (known == names_.end()) {
        if (lease == 0 || lease != id_) return;
        // A question that was given up has put it after all.
        names_[name] = Name{.wanted = {name}, .remove = true, .released = true};
    } else {
        Name& own = known->second;
        own.told = {epoch, revision};
        const bool free = own.state == State::taken && epoch == 0;
        // Nobody but an operator does that. The lease is still there: so put the key again, if nobody else has.
        const bool taken = own.state == State::owned && epoch != own.epoch && revision > own.epoch;
        if (own.remove || (!free && !taken)) return;
        own.due = true;
        if (taken) become(name, State::lost, "its key was removed from the directory");
    }
    next();
}

}  // namespace etcd
