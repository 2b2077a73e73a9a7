// notifier.h -- Tcl's waiting, in the reactor's epoll set and on the calling thread.
//
// The notifier of a threaded Tcl 8.6 hands each wait to a helper thread, which costs as much as two calls. This one waits
// itself: what Tcl watches for scripts lies in the same epoll set as COMM's connections, so that one system call waits for
// both. A request then costs no second wait, and no timer that a later request makes useless.
//
// Tcl_SetNotifier forgets the handlers that exist, and it is for the whole process. So it is done only in a tclsh where
// nobody waits for anything yet. Elsewhere (wish, programs that embed Tcl, Tcl 9, which has such a notifier itself) Tcl keeps
// its own, and EventSource watches the reactor's descriptor.
//
// Threads: the installing thread waits in the reactor's set. Each other thread of Tcl has a set of its own.
#pragma once

#include <functional>
#include <memory>

#include "comm/reactor.h"
#include "tcl/interpreter.h"

namespace sorma::notifier {

// Make this the notifier of the process, if that is allowed (see above), and if it is not yet.   serve: Tcl's event loop calls it
// when the reactor has gathered events; it should call Reactor::callGathered. False: Tcl keeps its notifier, or this
// one waits in the set of another interpreter's reactor; then watch the reactor's descriptor.
bool install(Tcl_Interp* interp, std::shared_ptr<Reactor> reactor, std::function<void()> serve);

// Inside serve: wait for more, until that time at most [ns, monotonic]. False: nothing came, or Tcl has something to do.
// While requests come without a pause this saves Tcl's way through its event sources, a tenth of a call.
bool goOn(std::int64_t end);

// The caller of install ends: serve is not called any more. Tcl goes on to wait in that reactor's set.
void release(const Reactor& reactor);

}  // namespace sorma::notifier
