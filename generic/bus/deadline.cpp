#include "bus/deadline.h"

#include <pwd.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>
#include <vector>

namespace sorma {

namespace {

thread_local Call* theCall = nullptr;

std::int64_t read(clockid_t clock) {
    timespec t{};
    clock_gettime(clock, &t);
    return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

std::string userName() {
    std::vector<char> buffer(1024);
    passwd entry{}, *found = nullptr;
    int result;
    while ((result = getpwuid_r(geteuid(), &entry, buffer.data(), buffer.size(), &found)) == ERANGE && buffer.size() < 1 << 20)
        buffer.resize(buffer.size() * 2);
    return result == 0 && found ? std::string(found->pw_name) : std::to_string(geteuid());
}

}  // namespace

std::int64_t monotonicNow() { return read(CLOCK_MONOTONIC); }
std::int64_t wallNow() { return read(CLOCK_REALTIME) / 1000; }

std::string Caller::toText() const {
    return user + '@' + host + ' ' + program + '[' + std::to_string(process) + ']';
}

const Caller& Caller::self() {
    static const Caller caller = [] {
        Caller c;
        char host[256] = "";
        if (gethostname(host, sizeof host - 1) != 0) host[0] = 0;
        c.user = userName();
        c.host = host[0] ? host : "localhost";
        c.program = program_invocation_short_name;
        c.address = "self";
        c.process = getpid();
        return c;
    }();
    return caller;
}

const ClientPointer Call::kThisProcess;

Call::Call(const Caller& caller, Deadline deadline, const ClientPointer& client)
    : caller(caller), deadline(deadline.earlier(currentDeadline())), client(client), outer_(theCall) {
    theCall = this;
}

Call::~Call() {
    if (outer_) outer_->subTime += subTime;
    theCall = outer_;
}

Call::Lent::Lent(Call* call) : own_(theCall) { theCall = call; }
Call::Lent::~Lent() { theCall = own_; }

Call* Call::current() { return theCall; }
Deadline Call::currentDeadline() { return theCall ? theCall->deadline : Deadline(); }
const Caller& Call::currentCaller() { return theCall ? theCall->caller : Caller::self(); }
ClientPointer Call::currentClient() { return theCall ? theCall->client : nullptr; }

}  // namespace sorma
