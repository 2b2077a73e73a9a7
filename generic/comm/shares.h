// shares.h -- whose turn it is: the principals of a server get the same time, whatever their requests cost.
//
// This is start-time fair queuing (Goyal, Vin and Cheng 1996), in turns of the reactor, on two levels. The principals share
// the time of the server, and the connections of one principal share what it gets. A stranger with fifty connections gets as
// much as with one. Each connection of the owner has a share like a principal.
//
// Each level has a clock of its own. It goes on by as much time as each flow that wants more has got. A flow is due by that
// clock, and each nanosecond of its requests makes it due later. When it is due too late it waits for the others. So the
// sender pays for a request, and for an error, too.
//
// A flow that is alone never waits. One that was away has saved nothing.
//
// Threads: belongs to the server's.
#pragma once

#include <cstdint>
#include <map>
#include <memory>

#include "bus/budget.h"

namespace sorma {

// Flows that share a time.
class Level {
public:
    // A connection, or all those of one principal.
    class Flow {
        friend class Level;
        std::int64_t due_ = 0;          // [ns] of Level::clock_
        std::int64_t inTurn_ = 0;       // [ns] that it got in the last turn that it had
        std::uint64_t turn_ = 0;
        bool waits_ = false;            // in that turn it wanted more
    };

    // A flow has its turn, perhaps for the second time in one turn of the reactor. now: about [ns].
    void enter(Flow& flow, std::uint64_t turn, std::int64_t now);
    // May it have one more request served in this turn?
    bool mayGoOn(const Flow& flow) const { return flow.due_ < clock_ + quantum_; }
    void took(Flow& flow, std::int64_t nanoseconds);            // its requests have taken so long
    void leave(Flow& flow, bool wantsMore);                     // its turn is over
    bool owes(const Flow& flow) const { return flow.due_ > clock_; }

private:
    static constexpr std::int64_t kLeast = 5'000, kMost = 200'000;      // [ns] quantum_
    static constexpr std::int64_t kTurn = 1'000;        // [ns] quantum_ has so much more for each connection that has a turn

    void next(std::uint64_t turn, std::int64_t now);

    std::int64_t clock_ = 0;            // [ns]
    // [ns] what a flow gets in one turn, and the rest of a request beyond it. It is as much as a modest flow takes,
    // so that this one seldom waits long. It grows with the number of connections, and when all want more, since
    // each turn costs something.
    std::int64_t quantum_ = kMost;
    // In the present turn [ns]: when the first flow is due that wants more, and when the last one of all. The most that a
    // satisfied flow got.
    std::uint64_t turn_ = 0;
    std::int64_t firstDue_ = 0, lastDue_ = 0, modest_ = 0;
    int flows_ = 0, waiting_ = 0;       // that had a turn; of which want more
    int entered_ = 0;                   // turns of connections
    // When two flows last had requests in the same turn [ns], and in which turn.
    std::int64_t crowded_ = 0;
    std::uint64_t crowdedTurn_ = 0;
};

class Shares {
    struct Group {
        Level::Flow flow;
        Level connections;
    };

public:
    // One connection's.
    class Share {
        friend class Shares;
        Level::Flow flow_;
        std::shared_ptr<Group> group_;      // its principal's; null: the owner's
    };

    // A share for a connection of this principal. It owes what the principal owes by others, also by closed ones.
    Share of(const AccountPointer& account);

    void enter(Share& share, std::uint64_t turn, std::int64_t now) {
        if (share.group_) share.group_->connections.enter(share.flow_, turn, now);
        principals_.enter(flow(share), turn, now);
    }
    bool mayGoOn(const Share& share) const {
        return !share.group_ ? principals_.mayGoOn(share.flow_)
                             : principals_.mayGoOn(share.group_->flow) && share.group_->connections.mayGoOn(share.flow_);
    }
    void took(Share& share, std::int64_t nanoseconds) {
        if (share.group_) share.group_->connections.took(share.flow_, nanoseconds);
        principals_.took(flow(share), nanoseconds);
    }
    void leave(Share& share, bool wantsMore) {
        if (share.group_) share.group_->connections.leave(share.flow_, wantsMore);
        principals_.leave(flow(share), wantsMore);
    }

private:
    static Level::Flow& flow(Share& share) { return share.group_ ? share.group_->flow : share.flow_; }

    Level principals_;
    std::map<AccountPointer, std::shared_ptr<Group>> groups_;      // with connections, or that owe something
};

}  // namespace sorma
