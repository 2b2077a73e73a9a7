// monitor.h -- publishes the requests, replies and events that pass through a daemon.
//
// They are events of the object `sorm` whose names begin with "monitor.". The words of such an event: object, method or
// event, caller, number of the request, and for a reply its code. The text: the request, reply or event, shortened.
//
// Requests of all doors are among them: bus/request.h. A subscriber gets them only with a pattern that begins with "monitor";
// without such a subscriber a request pays nothing. The contents are only for subscribers that may inspect the object: see
// concealed().
//
// Threads: the SORM's.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/message.h"
#include "bus/principal.h"
#include "bus/request.h"
#include "bus/sorm.h"
#include "bus/stream.h"

namespace sorma {

class Service;

// The observer that publishes requests and replies.
std::unique_ptr<Observer> makeMonitor(Sorm& sorm);

// Publish an event of another object to the monitors.
void tellPassing(const Service& from, std::string_view event, const Message& m);

// Is it an event of `sorm` that tells of an object which this author must not inspect: object.changed, trail.*, monitor.*?
// Then send him only whom it is about: bareWords().
bool concealed(const Event& event, const Sorm& sorm, const PrincipalPointer& author);
std::vector<std::string> bareWords(const Event& event);
bool tellable(const std::string& object, const Sorm& sorm, const PrincipalPointer& author);        // may he inspect it?

}  // namespace sorma
