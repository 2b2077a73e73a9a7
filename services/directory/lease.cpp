#include "lease.h"

#include <algorithm>

#include "bus/statistics.h"
#include "comm/random.h"

namespace etcd {

using State = sorma::Directory::Claim::State;

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::string number(std::int64_t n) { return '"' + std::to_string(n) + '"'; }

}  // namespace

Lease::Lease(EtcdDirectory& directory, sorma::Directory::Entry wanted, std::int64_t timeToLive)
    : directory_(directory), wanted_(std::move(wanted)), timeToLive_(std::max(timeToLive, kSecond)), mark_(std::to_string(sorma::randomNumber())) {
    claim_.state = State::asking;
    claim_.why = "the directory has not answered yet";
    grant();
}

Lease::~Lease() {
    directory_.end(asking_);
    directory_.alarms().cancel(timer_);
    directory_.alarms().cancel(end_);
}

// The clock decides, not a timer: a process that was stopped handles requests before its timers.
Lease::Claim Lease::claim() const {
    if (claim_.state != State::owned || sorma::bootNow() < claim_.until) return claim_;
    Claim out;
    out.state = State::lost;
    out.why = "it was not renewed in time";
    return out;
}

void Lease::become(State state, const std::string& why) {
    const bool other = claim_.state != state || claim_.why != why;
    claim_.state = state;
    claim_.why = why;
    if (state != State::owned) claim_.epoch = claim_.until = 0;
    if (other) directory_.tell(wanted_.name);
}

void Lease::later(std::int64_t nanoseconds, void (Lease::*what)()) {
    directory_.alarms().set(timer_, nanoseconds, [this, what] { (this->*what)(); });
}

// An answer is awaited for a sixth of the time to live: then there is time for another server.
void Lease::ask(const char* path, std::string body, void (Lease::*answered)(const EtcdDirectory::Reply&)) {
    asked_ = sorma::bootNow();
    directory_.end(asking_);
    asking_ = directory_.ask(path, std::move(body), long(timeToLive_ / 6'000'000), [this, answered](const EtcdDirectory::Reply& reply) {
        asking_ = 0;
        (this->*answered)(reply);
    });
}

void Lease::grant() {
    if (lease_ != 0) return put();
    ask("lease/grant", "{\"TTL\":" + number((timeToLive_ + kSecond - 1) / kSecond) + "}", &Lease::granted);
}

void Lease::granted(const EtcdDirectory::Reply& reply) {
    if (!reply.why.empty()) {
        if (claim_.state == State::asking) become(State::asking, reply.why);
        return later(directory_.jitter(timeToLive_ / 10), &Lease::grant);
    }
    lease_ = reply.json["ID"].number();
    claim_.asked = asked_;
    claim_.until = asked_ + timeToLive_ * 4 / 5;
    put();
}

void Lease::put() {
    std::string addresses;
    for (auto& address : wanted_.addresses) addresses += (addresses.empty() ? "" : ",") + quoted(address);
    const std::string value = "{\"identity\":" + quoted(wanted_.identity) + ",\"machine\":" + quoted(wanted_.machine) + ",\"mark\":" + quoted(mark_) +
                              ",\"addresses\":[" + addresses + "]}";
    const std::string key = base64(directory_.key(wanted_.name));
    ask("kv/txn", "{\"compare\":[{\"target\":\"CREATE\",\"key\":" + key + ",\"create_revision\":\"0\"}],"
        "\"success\":[{\"requestPut\":{\"key\":" + key + ",\"value\":" + base64(value) + ",\"lease\":" + number(lease_) + "}}],"
        "\"failure\":[{\"requestRange\":{\"key\":" + key + "}}]}", &Lease::judge);
}

void Lease::judge(const EtcdDirectory::Reply& reply) {
    if (!reply.why.empty()) {
        // Perhaps the lease has ended. Its mark tells an entry that we have put by a question without an answer.
        if (reply.heard) lease_ = 0;
        if (claim_.state == State::asking) become(State::asking, reply.why);
        return later(directory_.jitter(timeToLive_ / 10), &Lease::grant);
    }
    if (!reply.json["succeeded"].empty()) return own(reply.json["header"]["revision"].number());
    const auto& answers = reply.json["responses"].items();
    const auto pairs = answers.empty() ? std::vector<Json>() : answers.front()["response_range"]["kvs"].items();
    const Json pair = pairs.empty() ? Json() : pairs.front();
    std::string mark;
    const auto other = EtcdDirectory::entryOf(wanted_.name, pair, &mark);
    if (mark == mark_ && pair["lease"].number() == lease_) return own(other.epoch);
    become(State::taken, other.identity);
    renew();                            // the lease, so that it is there when the name is free
}

void Lease::own(std::int64_t epoch) {
    claim_.epoch = epoch;
    if (sorma::bootNow() >= claim_.until) return renew();       // the answers took too long: ask whether the lease is still there
    const bool gained = claim_.state != State::owned;
    become(State::owned, {});
    // The directory may go away before its watch has told that.
    if (gained) directory_.owned(wanted_, epoch);
    directory_.alarms().set(end_, claim_.until - sorma::bootNow(), [this] {
        if (claim_.state == State::owned && sorma::bootNow() >= claim_.until) lose("it was not renewed in time");
    });
    later(directory_.jitter(timeToLive_ / 3), &Lease::renew);
}

void Lease::lose(const std::string& why) {
    become(State::lost, why);
    renew();
}

void Lease::renew() { ask("lease/keepalive", "{\"ID\":" + number(lease_) + "}", &Lease::renewed); }

void Lease::renewed(const EtcdDirectory::Reply& reply) {
    directory_.alarms().cancel(timer_);
    if (!reply.why.empty()) return later(directory_.jitter(timeToLive_ / 20), &Lease::renew);
    const std::int64_t seconds = reply.json["result"]["TTL"].number();
    if (seconds <= 0) {
        lease_ = 0;
        if (claim_.state == State::owned) become(State::lost, "its lease has ended");
        return grant();
    }
    claim_.asked = asked_;
    claim_.until = asked_ + std::min(timeToLive_, seconds * kSecond) * 4 / 5;
    if (claim_.state == State::owned) own(claim_.epoch);
    else if (claim_.state == State::taken) later(directory_.jitter(timeToLive_ / 3), &Lease::grant);
    else grant();
}

void Lease::seen(std::int64_t epoch, std::int64_t revision) {
    if (claim_.state == State::taken && epoch == 0) later(directory_.jitter(kSecond / 100), &Lease::grant);
    // Nobody but an operator does that. The lease is still there: so put the key again, if nobody else has.
    if (claim_.state == State::owned && epoch != claim_.epoch && revision > claim_.epoch) {
        become(State::lost, "its key was removed from the directory");
        put();
    }
}

void Lease::revoke(std::function<void()> done) {
    directory_.alarms().cancel(timer_);
    directory_.alarms().cancel(end_);
    claim_ = {};
    directory_.end(asking_);
    if (lease_ == 0) return done();
    asking_ = directory_.ask("lease/revoke", "{\"ID\":" + number(lease_) + "}", 500, [this, done = std::move(done)](const EtcdDirectory::Reply&) {
        asking_ = 0;
        done();
    });
}

}  // namespace etcd
