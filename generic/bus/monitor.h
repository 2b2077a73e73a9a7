// monitor.h -- what passes through a daemon, told to those who have asked for it: events of the SO `sorm` whose names begin with
// "monitor.". Their words: object, method or event, caller, number of the request; of a reply also its code. Text: the request,
// reply or event, abridged.
//
// Only who has subscribed with a pattern that begins with "monitor" gets them; without one, a request costs a look at a pointer.
// Contents are for those who may inspect the object they are of: see concealed().
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

// A request on its way. Made before it is executed; done() or later() afterwards.
class Passing {
public:
    // caller, service: borrowed for the length of the constructor.
    Passing(Sorm& sorm, std::uint64_t number, std::string_view service, Method method, const Message& m) : sorm_(sorm) {
        if (sorm.monitored()) [[unlikely]] begin(number, service, method, m);
    }
    // ran: microseconds.
    void done(const Message& m, std::int64_t ran) {
        if (started_ != 0) [[unlikely]] end(m, ran);
    }
    void later(const PendingPointer& pending);

private:
    void begin(std::uint64_t number, std::string_view service, Method method, const Message& m);
    void end(const Message& m, std::int64_t ran);

    Sorm& sorm_;
    std::int64_t started_ = 0;              // [ns]; 0: nobody listens
    std::vector<std::string> words_;
};

// An event of an object, as it is handed out.
void tellPassing(const Service& from, std::string_view event, const Message& m);

// Is it an event of a monitor whose contents this principal must not see? Then only its words are for him.
bool concealed(const Event& event, const Access& access, const PrincipalPointer& author);

}  // namespace sorma
