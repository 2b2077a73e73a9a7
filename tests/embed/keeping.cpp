// keeping.cpp -- checks of what a process keeps for others, without Tcl: accounts and their limits, and texts that are cut.
//
//     keeping GROUP      runs one group; tests/budget.test has a test for each. See checks.h.
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>
#include <vector>

#include "bus/budget.h"
#include "bus/call.h"
#include "bus/client.h"
#include "bus/kept.h"
#include "bus/principal.h"
#include "checks.h"

using namespace sorma;

// Blocks of memory that are in use.
static long blocks = 0;
[[gnu::noinline]] void* operator new(std::size_t size) {     // inlined, gcc takes them for a mismatch
    ++blocks;
    if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
    throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    ++blocks;
    return std::malloc(size > 0 ? size : 1);
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
    if (memory) --blocks;
    std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { operator delete(memory); }
[[gnu::noinline]] void operator delete(void* memory, const std::nothrow_t&) noexcept { operator delete(memory); }

namespace {

PrincipalPointer hostAt(const char* text) {
    Principal::Address address{};
    CHECK(Principal::fromText(text, address));
    return Principal::host(address);
}
std::string refused(Charge& charge, std::size_t bytes) {
    try {
        charge.need("foo", bytes);
    } catch (const Error& e) {
        return e.trail.entries().front().text;
    }
    return "granted";
}

// ---- accounts ----

void testLimits() {
    Budget budget;
    budget.setLimits(100, 1000);
    auto account = budget.of(hostAt("192.168.7.21")), owner = budget.of(nullptr);
    CHECK(account->limit() == 100 && owner->limit() == 1000 && owner->owner() && !account->owner());
    CHECK(account->fits(100) && !account->fits(101) && owner->fits(1000) && !owner->fits(1001));
    Charge charge(account, Account::Use::values);
    CHECK(charge.set(60) && charge.bytes() == 60 && account->used() == 60 && account->fits(40) && !account->fits(41));
    // In all, not beside what was charged before: nothing changes when it is too much, and less is always granted.
    CHECK(charge.set(100) && !charge.set(101) && charge.bytes() == 100 && account->used() == 100 && account->fits(0) && !account->fits(1));
    CHECK(charge.set(0) && account->used() == 0);
    charge.force(150);
    CHECK(account->used() == 150 && !account->fits(0) && charge.set(140) && account->used() == 140);
    charge.clear();
    CHECK(charge.bytes() == 0 && account->used() == 0);
    Charge free;
    CHECK(free.set(SIZE_MAX) && free.bytes() == SIZE_MAX);
}

void testTotal() {
    Budget budget;
    budget.setLimits(800, 1000);
    auto one = budget.of(hostAt("192.168.7.21")), two = budget.of(hostAt("192.168.7.22")), owner = budget.of(nullptr);
    Charge first(one, Account::Use::values), second(two, Account::Use::queues), own(owner, Account::Use::objects);
    // The last quarter is the owner's.
    CHECK(one->fits(750) && !one->fits(751) && first.set(700) && two->fits(50) && !two->fits(51));
    CHECK(owner->fits(300) && !owner->fits(301) && own.set(300) && !own.set(301) && !two->fits(1));
    CHECK(first.set(0) && two->fits(450) && !two->fits(451));
}

void testOver() {
    Budget budget;
    budget.setLimits(160, 1000);
    auto account = budget.of(hostAt("192.168.7.21")), little = budget.of(hostAt("192.168.7.22")), owner = budget.of(nullptr);
    Charge charge(account, Account::Use::values), small(little, Account::Use::values), own(owner, Account::Use::objects);
    charge.force(160);
    CHECK(!account->over());
    charge.force(161);
    CHECK(account->over());
    // When all have too much together, those who have a little are none of them.
    charge.force(11), small.force(10), own.force(729);
    CHECK(!account->over() && !little->over());
    own.force(730);
    CHECK(account->over() && !little->over());
    own.force(2000);
    CHECK(!owner->over());
}

void testRefusals() {
    Budget budget;
    budget.setLimits(100, 1000);
    auto account = budget.of(hostAt("192.168.7.21"));
    Charge charge(account, Account::Use::queues);
    EQUAL(refused(charge, 100), "granted");
    EQUAL(refused(charge, 120),
          "foo: 120 bytes for queues are too many: host 192.168.7.21 has 100 of the 100 bytes that each may make this daemon keep; raise it there: "
          "sorma::configure -budget BYTES");
    charge.force(0);
    // The limit for all is named to an account that has enough left, and to the owner.
    const char* all = "foo: 100 bytes for queues are too many: all clients of this daemon together may make it keep 1000 bytes; raise it there: "
                      "sorma::configure -totalbudget BYTES";
    Charge own(budget.of(nullptr), Account::Use::queues);
    own.force(700);
    EQUAL(refused(charge, 100), all);
    own.force(950);
    Charge more(budget.of(nullptr), Account::Use::queues);
    EQUAL(refused(more, 100), all);
    charge.force(101);
    Charge another(account, Account::Use::tables);
    CHECK(refused(another, 1).starts_with("foo: 1 bytes for tables are too many: host 192.168.7.21 has 101 of the 100 bytes"));
    CHECK(budget.text().find("host 192.168.7.21: 101 of 100 bytes, queues 101; 0 connections, refused 3") != std::string::npos);
}

void testAccounts() {
    Budget budget;
    Principal::Address here{};
    CHECK(Principal::fromText("127.0.0.1", here));
    auto user = budget.of(Principal::user(54321, {1, 2}));
    CHECK(user && user == budget.of(Principal::user(54321, {3})) && user != budget.of(Principal::user(54322, {1, 2})));
    auto local = budget.of(Principal::local(54321, here));
    CHECK(local != user && local != budget.of(Principal::local(54322, here)));
    auto anyone = budget.of(Principal::anyone());
    CHECK(anyone == budget.of(Principal::anyone(here)) && anyone != local);
    // IPv4: each address. IPv6: a network of 64 bits.
    auto host = budget.of(hostAt("192.168.7.21")), net = budget.of(hostAt("2001:db8:1:2:3:4:5:6"));
    CHECK(host != budget.of(hostAt("192.168.7.22")) && host == budget.of(hostAt("192.168.7.21")) && host != net);
    CHECK(net == budget.of(hostAt("2001:db8:1:2:ff:ff:ff:ff")) && net != budget.of(hostAt("2001:db8:1:3:3:4:5:6")));
    EQUAL(host->name(), "host 192.168.7.21");
    EQUAL(net->name(), "host 2001:db8:1:2::/64");
    EQUAL(budget.of(nullptr)->name(), "the owner");
    // Several have the account of the first; too many of them are anyone.
    auto both = Principal::both(Principal::user(54321, {1}), Principal::user(54323, {1}));
    auto first = budget.of(both->members()[0]);
    CHECK(budget.of(both) == first);
    CHECK(budget.of(Principal::parse("too many authors")) == anyone);
    CHECK(budget.of(nullptr) == budget.of(nullptr));
    // In no request: the author's, or none.
    CHECK(budget.ofCaller() == nullptr && budget.ofCaller(hostAt("192.168.7.21")) == host);
    // The sender's of a request, whoever has written the words.
    const ClientPointer client = std::make_shared<Client>(Caller(), hostAt("192.168.7.21"));
    const std::string nobody;
    {
        CallContext call(client, Deadline(), 1, nobody);
        CHECK(budget.ofCaller() == host && budget.ofCaller(Principal::user(54321, {1})) == host);
    }
}

// Strangers come and go, and each has an account of his own: what that takes does not grow.
void testStrangers() {
    Budget budget;
    const long before = blocks;
    long most = 0;
    for (int i = 0; i < 20000; ++i) {
        Principal::Address address{};
        address[0] = 0x20, address[5] = static_cast<unsigned char>(i), address[6] = static_cast<unsigned char>(i >> 8);
        CHECK(budget.of(Principal::host(address)) != nullptr);
        most = std::max(most, blocks - before);
    }
    note(most < 2000, __LINE__, std::to_string(most) + " blocks");
}

void testText() {
    Budget budget;
    budget.setLimits(1000, 5000);
    auto one = budget.of(hostAt("192.168.7.21")), two = budget.of(hostAt("192.168.7.22"));
    Charge a(one, Account::Use::values), b(two, Account::Use::requests), c(two, Account::Use::tables);
    CHECK(a.set(10) && b.set(20) && c.set(5));
    two->connections = 3;
    EQUAL(budget.text(),
          "all 35 of 5000 bytes\nhost 192.168.7.22: 25 of 1000 bytes, requests 20, tables 5; 3 connections, refused 0\n"
          "host 192.168.7.21: 10 of 1000 bytes, values 10; 0 connections, refused 0");
    CHECK(budget.accounts().size() == 2 && budget.of(nullptr) && budget.accounts().size() == 3);
    // An account that nobody uses is forgotten.
    b = Charge(), c = Charge(), two.reset();
    CHECK(budget.accounts().size() == 2);
}

// ---- texts that are kept ----

void testCuts() {
    EQUAL(cutText("short"), "short");
    EQUAL(cutText(std::string(64, 'a'), 64), std::string(64, 'a'));
    EQUAL(cutText(std::string(65, 'a'), 64), std::string(24, 'a') + "... 41 bytes more");
    EQUAL(cutText(std::string(1023, 'a'), 64), std::string(24, 'a') + "... 999 bytes more");
    EQUAL(cutText(std::string(1024, 'a'), 64), std::string(24, 'a') + "... 1 000 bytes more");
    EQUAL(cutText(std::string(1'234'591, 'a'), 64), std::string(24, 'a') + "... 1 234 567 bytes more");
    EQUAL(cutText(std::string(1001, 'a')), std::string(960, 'a') + "... 41 bytes more");
    // Never inside a character.
    EQUAL(cutText(std::string(23, 'a') + "\xc3\xa4" + std::string(40, 'b'), 64), std::string(23, 'a') + "... 42 bytes more");
    EQUAL(cutText(std::string(22, 'a') + "\xc3\xa4" + std::string(41, 'b'), 64), std::string(22, 'a') + "\xc3\xa4... 41 bytes more");
    EQUAL(cutText(std::string(100, '\x80'), 64), "... 100 bytes more");
    std::string text(65, 'a'), longer(65, 'b');
    cutInPlace(text, 64), cutInPlace(longer, 65);
    EQUAL(text, std::string(24, 'a') + "... 41 bytes more");
    EQUAL(longer, std::string(65, 'b'));
}

void testTrails() {
    const std::string name(300, 'n'), line(1500, 'l'), cutName = cutText(name, kKeptName), cutLine = cutText(line);
    Entry e;
    e.severity = Severity::warning;
    e.symbol = e.text = e.request = line;
    e.details.assign(20, line);
    e.so = e.daemon = e.file = name;
    e.line = 12;
    e.time = 34;
    Trail trail;
    trail.add(e);
    trail.setDropped(7);
    const Trail cut = cutTrail(trail);
    CHECK(cut.entries().size() == 1 && cut.dropped() == 7);
    const Entry& kept = cut.entries().front();
    CHECK(kept.severity == Severity::warning && kept.symbol == cutLine && kept.text == cutLine && kept.request == cutLine);
    CHECK(kept.details == std::vector<std::string>(16, cutLine));
    CHECK(kept.so == cutName && kept.daemon == cutName && kept.file == cutName && kept.line == 12 && kept.time == 34);
}

void testBytes() {
    std::string little = "abc", large(100, 'a');
    CHECK(heapOf(little) == 0 && heapOf(large) == large.capacity() + 1);
    std::vector<std::string> two{little, large};
    CHECK(heapOf(two) == two.capacity() * sizeof(std::string) + large.capacity() + 1);
    // Each of its parts counts.
    Entry e;
    CHECK(heapOf(e) == 0);
    std::size_t before = 0;
    for (auto* part : {&e.symbol, &e.text, &e.so, &e.daemon, &e.file, &e.request}) {
        *part = large;
        CHECK(heapOf(e) == before + heapOf(*part));
        before = heapOf(e);
    }
    e.details.assign(2, large);
    CHECK(heapOf(e) == before + heapOf(e.details));
    Message m;
    before = heapOf(m);
    m.text = large;
    m.floats.assign(10, 1);
    m.ints.assign(10, 1);
    m.any.assign(10, {});
    m.words.assign(2, large);
    m.trail.add(e);
    CHECK(heapOf(m) == before + heapOf(m.text) + heapOf(m.floats) + heapOf(m.ints) + heapOf(m.any) + heapOf(m.words) + heapOf(m.trail));
    CHECK(heapOf(m.floats) >= 80 && heapOf(m.trail) >= heapOf(e));
}

void testCharged() {
    Budget budget;
    budget.setLimits(1000, 10000);
    auto account = budget.of(hostAt("192.168.7.21"));
    {
        Charged<std::string> value("foo", account, Account::Use::values, std::string(200, 'a'));
        CHECK(account->used() >= 200 + sizeof(std::string) && account->used() < 400);
        const std::size_t used = account->used();
        auto again = value.again();
        CHECK(account->used() == 2 * used && *again == *value);
        again = {};
        CHECK(account->used() == used);
        // What is too much changes nothing.
        bool thrown = false;
        try {
            value.refill("foo", account, Account::Use::values, 5000, [](std::string& text) { text.assign(5000, 'b'); });
        } catch (const Error&) {
            thrown = true;
        }
        CHECK(thrown && *value == std::string(200, 'a') && account->used() == used);
        value.edit([](std::string& text) { std::string().swap(text); });
        CHECK(account->used() < used);
        EQUAL(value.release(), "");
        CHECK(account->used() == 0);
    }
    Charged<std::string> own("foo", nullptr, Account::Use::values, std::string(5000, 'a'));
    CHECK(account->used() == 0 && own->size() == 5000 && !own.account());
}

constexpr Group kGroups[] = {
    {"limits", testLimits}, {"total", testTotal}, {"over", testOver}, {"refusals", testRefusals}, {"accounts", testAccounts},
    {"strangers", testStrangers}, {"text", testText}, {"cuts", testCuts}, {"trails", testTrails}, {"bytes", testBytes}, {"charged", testCharged},
};

}  // namespace

int main(int argc, char** argv) { return runGroups(kGroups, argc, argv); }
