// busCalls.cpp -- checks of what a request carries with it: its deadline, its caller, and its context while work waits.
#include <unistd.h>
#include <stdexcept>

#include "busText.h"
#include "bus/call.h"
#include "bus/client.h"
#include "bus/loop.h"

using namespace sorma;

namespace {

void testDeadline() {
    CHECK(Deadline().none() && !Deadline().passed() && Deadline::in(0).none());
    CHECK(Deadline::at(1).passed() && Deadline::at(1).left() == 0);
    Deadline soon = Deadline::in(1000), late = Deadline::in(100'000);
    EQUAL(soon.earlier(late).when(), soon.when());
    EQUAL(late.earlier(soon).when(), soon.when());
    EQUAL(Deadline().earlier(soon).when(), soon.when());
    EQUAL(soon.earlier(Deadline()).when(), soon.when());
}

void testCaller() {
    CHECK(&CallContext::currentCaller() == &Caller::self());
    Caller other{"joe", "lab", "tclsh", "unix", 77, {}};
    EQUAL(other.toText(), "joe@lab tclsh[77]");
    Caller far{"joe", "lab", "tclsh", "10.0.0.7:4711", 77, "10.0.0.7"};
    EQUAL(far.toText(), "10.0.0.7 (claims joe@lab tclsh[77])");
    EQUAL(Caller::self().process, static_cast<std::int64_t>(getpid()));
    CHECK(!Caller::self().user.empty() && !Caller::self().host.empty() && !Caller::self().program.empty());
}

void testContexts() {
    CHECK(CallContext::current() == nullptr && CallContext::currentDeadline().none());
    const Deadline soon = Deadline::in(1000), late = Deadline::in(100'000);
    auto client = std::make_shared<Client>(Caller{"joe", "lab", "tclsh", "unix", 77, {}});
    const ClientPointer none;
    const std::string nobody, joe = "joe@lab";
    KeptCallPointer kept;
    {
        // A context keeps no copy of client and callers, so it takes no temporary ones.
        static_assert(std::is_constructible_v<CallContext, const ClientPointer&, Deadline, int, const std::string&>);
        static_assert(!std::is_constructible_v<CallContext, std::nullptr_t, Deadline, int, const std::string&>);
        static_assert(!std::is_constructible_v<CallContext, const ClientPointer&, Deadline, int, const char*>);
        CallContext outer(client, soon, 7, nobody);
        {
            // A request that comes in meanwhile inherits nothing, and bills nothing.
            CallContext inner(none, late, 8, joe);
            EQUAL(inner.deadline.when(), late.when());
            inner.subTime = 5;
            CHECK(CallContext::current() == &inner);
            EQUAL(CallContext::currentCallers(), Caller::self().toText() + " for joe@lab");
        }
        EQUAL(outer.subTime, 0u);
        CHECK(&CallContext::currentCaller() == &client->caller);
        EQUAL(CallContext::currentDeadline().when(), soon.when());
        kept = CallContext::keep();
        CHECK(kept == CallContext::keep());
        {
            CallContext::Fresh fresh;           // an event loop
            CHECK(CallContext::current() == nullptr && CallContext::currentDeadline().none() && !CallContext::keep());
        }
    }
    CHECK(CallContext::current() == nullptr);
    {
        CallContext again(kept);                // work that waited
        EQUAL(CallContext::currentRequest(), 7u);
        CHECK(CallContext::currentClient() == client && !CallContext::currentCancelled());
        kept->cancel();
        CHECK(CallContext::currentCancelled());
    }
    {
        CallContext fresh{KeptCallPointer()};
        CHECK(CallContext::current() == nullptr);
    }
}

void testMailbox() {
    const ClientPointer none;
    const std::string joe = "joe@lab";
    KeptCallPointer kept;
    {
        CallContext context(none, Deadline(), 7, joe);
        kept = CallContext::keep();
    }
    // Work in a mailbox has the context that was kept for it, or none; what one item throws loses no other.
    Mailbox box;
    int done = 0;
    box.post([&] { done += CallContext::current() == nullptr; });
    box.post(kept, [&] { done += CallContext::currentRequest() == 7 ? 10 : 0; });
    box.post([&] { throw std::runtime_error("no"); });
    box.post([&] { done += 100; });
    bool thrown = false;
    try {
        box.run();
    } catch (const std::runtime_error&) {
        thrown = true;
    }
    CHECK(thrown);
    box.run();
    EQUAL(done, 111);
    // An item that waits sees what comes after it.
    box.post([&] { box.run(); done += 1000; });
    box.post([&] { done *= 2; });
    box.run();
    EQUAL(done, 1222);
    CHECK(CallContext::current() == nullptr);
}

}  // namespace

const std::vector<Group> kCallGroups{
    {"deadline", testDeadline}, {"caller", testCaller}, {"contexts", testContexts}, {"mailbox", testMailbox},
};
