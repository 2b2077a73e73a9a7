// monitor.h -- publishes the requests, replies and events that pass through a daemon.
//
// They are events of the object `sorm` whose names begin with "monitor.". The words of such an event: object, method or
// event, caller, number of the request, and for a reply its code. The text: the request, reply or event, shortened.
//
// A subscriber gets them only with a pattern that begins with "monitor". Without such a subscriber a request pays for
// reading one pointer. The contents are only for subscribers that may inspect the object: see concealed().
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "bus/call.h"
#include "bus/message.h"
#include "bus/reply.h"
#include "bus/sorm.h"
#include "bus/stream.h"

namespace sorma {

class Access;
class Service;

// One request. Make it before the request is executed; afterwards call done() or later().
class Passing {
public:
    Passing(Sorm& sorm, std::uint64_t number, std::string_view service, Method method, const Message& m) : sorm_(sorm) {
        if (sorm.monitored()) [[unlikely]] begin(number, service, method, m);
    }
    // m: the reply.   ran: [us]
    void done(const Message& m, std::int64_t ran) {
        if (started_ != 0) [[unlikely]] end(m, ran);
    }
    void later(const PendingPointer& pending);      // the service answers later: publish the reply then

private:
    void begin(std::uint64_t number, std::string_view service, Method method, const Message& m);
    void end(const Message& m, std::int64_t ran);

    Sorm& sorm_;
    std::int64_t started_ = 0;              // [ns]; 0: nobody listens
    std::vector<std::string> words_;
};

// Publish an event of another object to the monitors.
void tellPassing(const Service& from, std::string_view event, const Message& m);

// Is it an event of a monitor whose contents this principal must not see? Then send him only its words.
bool concealed(const Event& event, const Access& access, const PrincipalPointer& author);

}  // namespace sorma
