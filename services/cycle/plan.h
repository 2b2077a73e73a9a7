// plan.h -- what a cycle does in each tick: its steps, and the safe action.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <unordered_set>
#include <vector>

#include <sorma.h>

#include "bus/statistics.h"

namespace cycle {

using Objects = std::unordered_set<const sorma::Service*>;

struct Step {
    sorma::Reference object;
    sorma::Method method = sorma::Method::exec;
    bool nearAction = false;            // it may execute the object of the safe action, or a part of it
    sorma::Message request;             // the request, as given
    sorma::Message message;             // a copy of it for each tick, which becomes the reply
    sorma::Histogram times;             // [ns] in one of kSample ticks
    std::string text;                   // as its author wrote it

    void reserve();                     // allocate memory for the reply, so that the first tick need not
    void run(sorma::RealtimeOwner* here) {
        message.reset();
        if (!request.floats.empty()) message.floats = request.floats;
        if (!request.ints.empty()) message.ints = request.ints;
        if (!request.text.empty()) message.text = request.text;
        if (!request.any.empty()) message.any = request.any;
        object.step(message, here);
    }
};

// The reaction to a tick that has not ended before the next one was due.
enum class Overrun {
    skip,           // the ticks that were due meanwhile are left out
    catchUp,        // they follow at once
    fault,          // it is a fault, as when a step fails
};

struct Plan {
    std::int64_t period = 0;            // [ns]
    Overrun overrun = Overrun::skip;
    std::vector<Step> steps;
    std::shared_ptr<Step> onFault;      // the safe action, or null; shared with calls of Owner::act, deleted by the SORM's thread
    bool goesOn = false;                // ticks continue after a fault and the safe action
    std::int64_t watchdog = 0;          // [ns] a tick that takes longer counts as hanging
    Objects nearAction;                 // objects that have parts in common with the safe action's

    // executes: does the runner execute the object of the safe action? Call it again when parts of objects have changed.
    void findNearAction(bool executes);
};

}  // namespace cycle
