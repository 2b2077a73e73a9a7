// policyLines.cpp -- checks of a policy without Tcl: the subjects of its lines, their order, permits and refusals.
//
//     policyLines GROUP      runs one group; tests/access.test has a test for each. See checks.h.
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "bus/access.h"
#include "bus/principal.h"
#include "checks.h"

using namespace sorma;

namespace {

Principal::Address addressOf(const char* text) {
    Principal::Address address{};
    CHECK(Principal::fromText(text, address));
    return address;
}
PrincipalPointer hostAt(const char* text) { return Principal::host(addressOf(text)); }
bool may(const Access& access, const PrincipalPointer& who, Right right, const char* on = "foo") { return access.rights(who, on) & Rights(right); }

// Users and groups that this host knows: all have daemon and bin, with the same numbers for both.
constexpr uid_t kDaemon = 1, kBin = 2;

// ---- whom a line is about ----

void testSubjects() {
    const std::vector<PrincipalPointer> all = {
        Principal::user(kDaemon, {kDaemon}),                        // 0
        Principal::user(kBin, {kBin, kDaemon}),                     // 1: in the group daemon, too
        Principal::user(54321, {54321}),                            // 2
        Principal::local(kDaemon, addressOf("127.0.0.1")),          // 3
        Principal::local(kBin, addressOf("127.0.0.1")),             // 4
        hostAt("192.168.7.21"),                                     // 5
        Principal::anyone(addressOf("192.168.7.21")),               // 6
        Principal::nobody(),                                        // 7
    };
    const struct { const char* subject; std::vector<int> about; } lines[] = {
        {"user daemon", {0}},       {"user bin", {1}},      {"group daemon", {0, 1}},           {"group bin", {1}},
        {"local daemon", {3}},      {"local bin", {4}},     {"host 192.168.7.21", {5, 6}},      {"host 127.0.0.1", {3, 4}},
        {"host 192.0.0.0/3", {5, 6}}, {"host ::/0", {3, 4, 5, 6}}, {"anyone", {0, 1, 2, 3, 4, 5, 6, 7}},
    };
    for (auto& [subject, about] : lines) {
        Access access;
        access.add("allow " + std::string(subject) + " call", "here");
        for (std::size_t i = 0; i < all.size(); ++i) {
            const bool wanted = std::find(about.begin(), about.end(), int(i)) != about.end();
            note(may(access, all[i], Right::call) == wanted, __LINE__, std::string(subject) + ": principal " + std::to_string(i));
            note(!may(access, all[i], Right::inspect), __LINE__, std::string(subject) + " inspects: principal " + std::to_string(i));
        }
        CHECK(may(access, nullptr, Right::policy) && may(access, nullptr, Right::relay));
    }
}

// ---- which line decides ----

void testOrder() {
    const auto host = hostAt("192.168.7.21"), other = hostAt("10.0.0.1");
    Access access;
    access.add("deny host 192.168.7.21 inspect", "first");
    access.add("host 192.168.7.21 use", "second");                  // allow, as sormad -allow takes it
    CHECK(may(access, host, Right::call) && !may(access, host, Right::inspect) && !may(access, other, Right::call));
    const int newest = access.addFirst("allow host 192.168.7.21 inspect on foo", "later");
    CHECK(may(access, host, Right::inspect) && !may(access, host, Right::inspect, "bar"));
    const int newer = access.addFirst("deny anyone everything", "later");
    CHECK(newer == newest + 1 && access.rights(host, "foo") == 0);
    const auto epoch = access.epoch();
    access.remove(newer);
    CHECK(access.epoch() != epoch && may(access, host, Right::inspect));
    for (int number : {newer, 0}) {
        std::string why;
        try {
            access.remove(number);
        } catch (const Error& e) {
            why = e.what();
        }
        CHECK(why.find(std::to_string(newest)) != why.npos);
    }
    // Built in, after all others: this user by TCP, and everybody where it is open.
    const auto self = Principal::local(geteuid(), addressOf("127.0.0.1"));
    CHECK(access.rights(self, "foo") == (Right::call | Right::inspect | Rights(Right::configure) | Rights(Right::make) | Rights(Right::dictionary) | Rights(Right::operate)));
    access.setOpen(true);
    CHECK(access.rights(other, "foo") == (Right::call | Right::inspect) && !may(access, host, Right::inspect, "bar"));
    access.setOpen(false);
    CHECK(access.rights(other, "foo") == 0);
}

void testSeveral() {
    Access access;
    access.add("allow host 192.168.7.21 call configure", "here");
    access.add("allow host 192.168.7.22 call inspect", "here");
    const auto one = hostAt("192.168.7.21"), two = hostAt("192.168.7.22"), three = hostAt("192.168.7.23");
    CHECK(access.rights(Principal::both(one, two), "foo") == Rights(Right::call));
    CHECK(access.rights(Principal::both(one, three), "foo") == 0 && access.rights(Principal::both(one, nullptr), "foo") == (Right::call | Right::configure));
    CHECK(access.rights(Principal::parse("too many authors"), "foo") == 0);
    std::string why;
    try {
        (void)access.need(Principal::both(one, two), Right::configure, "foo.a", "foo.a");
    } catch (const Error& e) {
        why = e.what();
    }
    // The line is for whom the right is missing, on the flavors of the class.
    CHECK(why.find("sormad -allow \"host 192.168.7.22 configure on foo.*\"") != why.npos);
    CHECK(why.find("host 192.168.7.21 and host 192.168.7.22") != why.npos || why.find("192.168.7.21 and 192.168.7.22") != why.npos);
}

// ---- permits ----

bool refuses(const Permit& permit, Right right, const char* target) {
    try {
        target ? permit.check(right, target) : permit.check(right);
    } catch (const Error&) {
        return true;
    }
    return false;
}
void testPermits() {
    Access access;
    access.add("allow anyone use on foo", "here");
    const Permit permit = access.need(Principal::nobody(), Right::call, "foo", "foo"), owner = access.need(nullptr, Right::policy, "foo", "foo");
    CHECK(!permit.isOwners() && permit.includes(Right::inspect) && !permit.includes(Right::configure));
    CHECK(!refuses(permit, Right::call, "foo") && refuses(permit, Right::call, "bar") && refuses(permit, Right::configure, "foo"));
    CHECK(!refuses(permit, Right::call, nullptr) && refuses(permit, Right::files, nullptr));
    CHECK(owner.isOwners() && owner.includes(Right::policy) && !refuses(owner, Right::files, "bar") && !refuses(owner, Right::files, nullptr));
}

// ---- what is remembered ----

void testRefusals() {
    Access access;
    EQUAL(access.deniedText(), "0 refused");
    auto ask = [&](Right right, const std::string& on) {
        try {
            (void)access.need(hostAt("192.168.7.21"), right, on, on);
        } catch (const Error& e) {
            return std::string(e.what());
        }
        return std::string("allowed");
    };
    CHECK(ask(Right::call, "foo.a").find("allow \"host 192.168.7.21 call on foo.*\"") != std::string::npos);
    CHECK(ask(Right::files, "/tmp/a.b").find("allow \"host 192.168.7.21 files on /tmp/a.b\"") != std::string::npos);
    CHECK(ask(Right::policy, "policy").find("only this daemon's own user may") != std::string::npos);
    (void)ask(Right::call, "foo.a");
    CHECK(access.denials() == 4);
    // The same one is one line, and the latest comes first.
    std::string text = access.deniedText();
    CHECK(text.starts_with("4 refused\n") && std::count(text.begin(), text.end(), '\n') == 3);
    CHECK(text.find("call foo.a, 2 times") < text.find("change the policy") && text.find("change the policy") < text.find("have file /tmp/a.b read or written"));
    for (int i = 0; i < 1000; ++i) (void)ask(Right::call, "n" + std::to_string(i));
    text = access.deniedText();
    CHECK(access.denials() == 1004 && std::count(text.begin(), text.end(), '\n') < 200 && text.find("call n999") != text.npos && text.find("call n0\n") == text.npos);
}

constexpr Group kGroups[] = {
    {"subjects", testSubjects}, {"order", testOrder}, {"several", testSeveral}, {"permits", testPermits}, {"refusals", testRefusals},
};

}  // namespace

int main(int argc, char** argv) { return runGroups(kGroups, argc, argv); }
