#include "tcl/notifier.h"

#include <sys/epoll.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <system_error>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "bus/deadline.h"

namespace sorma::notifier {

#if TCL_MAJOR_VERSION >= 9

bool install(Tcl_Interp*, std::shared_ptr<Reactor>, std::function<void()>) { return false; }
void release(const Reactor&) {}
bool goOn(std::int64_t) { return false; }

#else

namespace {

struct Set;

// A descriptor that Tcl watches.
struct Handler : Reactor::Watcher {
    Handler(Set& owner, int descriptor) : set(owner), fd(descriptor) {}
    void ready(std::uint32_t events) override;

    Set& set;
    const int fd;
    int mask = 0;               // what Tcl waits for
    int found = 0;              // what has happened and Tcl has not been told
    Tcl_FileProc* proc = nullptr;
    ClientData data = nullptr;
};

struct FileEvent {
    Tcl_Event header;
    int fd;
};

// The descriptors of one thread.
struct Set {
    explicit Set(std::shared_ptr<Reactor> r) : reactor(std::move(r)) {}

    std::shared_ptr<Reactor> reactor;
    std::function<void()> serve;            // empty: Reactor::callGathered
    std::unordered_map<int, std::unique_ptr<Handler>> handlers;
    std::vector<Handler*> always;           // regular files, which epoll refuses: they are always ready
    std::vector<std::unique_ptr<Handler>> ended;    // one of them may be on the stack
    bool queued = false;                    // the event that serves is in Tcl's queue
    int files = 0;                          // so many file events are there
    std::int64_t until = 0;                 // when Tcl's next timer is due, as for gather
    // Since Tcl last waited: somebody has set a timer or an idle callback; another thread has something for this one.
    bool due = false;
    std::atomic<bool> alerted{false};
};

thread_local Set* own = nullptr;            // of this thread; Tcl's finalization deletes it, of the main thread the process's end

// Tcl names a thread by what its initNotifierProc returned. The installing thread is older than we are. Tcl's own notifier gave
// it its name, and it stands for all names that are not in this list.
struct Threads {
    std::mutex mutex;
    std::unordered_set<void*> known;
    Set* first = nullptr;
};
Threads& threads() {
    static auto* all = new Threads;         // threads may outlive the statics
    return *all;
}

Set& here() {
    if (!own) own = new Set(std::make_shared<Reactor>());
    return *own;
}

int fileEvent(Tcl_Event* event, int flags) {
    if (!(flags & TCL_FILE_EVENTS)) return 0;
    --here().files;
    auto& handlers = here().handlers;
    auto known = handlers.find(reinterpret_cast<FileEvent*>(event)->fd);
    if (known == handlers.end()) return 1;
    Handler& h = *known->second;
    int mask = h.found & h.mask;
    h.found = 0;
    if (mask) h.proc(h.data, mask);
    return 1;
}

void Handler::ready(std::uint32_t events) {
    int now = 0;
    if (events & (EPOLLIN | EPOLLHUP | EPOLLERR)) now |= TCL_READABLE;
    if (events & (EPOLLOUT | EPOLLHUP | EPOLLERR)) now |= TCL_WRITABLE;
    if (events & (EPOLLPRI | EPOLLERR)) now |= TCL_EXCEPTION;
    now &= mask;
    if (now == 0) return;
    if (found == 0) {
        auto* event = reinterpret_cast<FileEvent*>(Tcl_Alloc(sizeof(FileEvent)));
        event->header.proc = fileEvent;
        event->fd = fd;
        Tcl_QueueEvent(&event->header, TCL_QUEUE_TAIL);
        ++set.files;
    }
    found |= now;
}

int serveEvent(Tcl_Event*, int flags) {
    if (!(flags & TCL_FILE_EVENTS)) return 0;
    Set& set = here();
    set.queued = false;
    if (set.serve) {
        auto serve = set.serve;             // it may end the interpreter that gave it
        serve();
    } else {
        set.reactor->callGathered();
    }
    return 1;
}

void createHandler(int fd, int mask, Tcl_FileProc* proc, ClientData data) {
    Set& set = here();
    std::uint32_t events = 0;
    if (mask & TCL_READABLE) events |= EPOLLIN;
    if (mask & TCL_WRITABLE) events |= EPOLLOUT;
    if (mask & TCL_EXCEPTION) events |= EPOLLPRI;
    auto& handler = set.handlers[fd];
    const bool isNew = !handler;
    if (isNew) handler = std::make_unique<Handler>(set, fd);
    handler->mask = mask;
    handler->proc = proc;
    handler->data = data;
    if (!isNew && std::find(set.always.begin(), set.always.end(), handler.get()) != set.always.end()) return;
    if (!isNew && set.reactor->change(fd, events, handler.get())) return;
    try {
        set.reactor->add(fd, events, handler.get());
    } catch (const std::system_error&) {
        set.always.push_back(handler.get());
    }
}

void deleteHandler(int fd) {
    Set& set = here();
    auto known = set.handlers.find(fd);
    if (known == set.handlers.end()) return;
    set.reactor->remove(fd, known->second.get());
    std::erase(set.always, known->second.get());
    set.ended.push_back(std::move(known->second));
    set.handlers.erase(known);
}

int waitForEvent(const Tcl_Time* limit) {
    Set& set = here();
    if (!set.reactor->polling()) set.ended.clear();
    std::int64_t until = 0;
    if (!set.always.empty() || (limit && limit->sec == 0 && limit->usec == 0)) {
        until = Reactor::kNoWait;
    } else if (limit) {
        until = monotonicNow() + limit->sec * 1'000'000'000 + limit->usec * 1'000;
    }
    set.until = until;
    set.due = false;
    set.alerted = false;
    for (auto* handler : set.always) handler->ready(EPOLLIN | EPOLLOUT);
    if (!set.reactor->gather(until) || set.queued) return 0;
    auto* event = static_cast<Tcl_Event*>(static_cast<void*>(Tcl_Alloc(sizeof(Tcl_Event))));
    event->proc = serveEvent;
    Tcl_QueueEvent(event, TCL_QUEUE_TAIL);
    set.queued = true;
    return 0;
}

// In a child that has forked from us Tcl calls it again.
ClientData beginThread() {
    Set& set = here();
    Threads& all = threads();
    std::lock_guard lock(all.mutex);
    if (&set != all.first) all.known.insert(&set);
    return &set;
}

void endThread(ClientData) {
    Threads& all = threads();
    std::lock_guard lock(all.mutex);
    if (!own || own == all.first) return;
    all.known.erase(own);
    delete own;
    own = nullptr;
}

void alert(ClientData thread) {
    Threads& all = threads();
    std::lock_guard lock(all.mutex);        // the thread does not end meanwhile
    Set* set = all.known.contains(thread) ? static_cast<Set*>(thread) : all.first;
    set->alerted = true;
    set->reactor->wake();
}

// Nothing is watched, and nothing is loaded that might: in 8.6 there is no other way to ask.
constexpr const char* kNobodyWaits = R"tcl(
    apply {{} {
        if {![string match tclsh* [file tail [info nameofexecutable]]] || [interp slaves] ne {}} {
            return 0
        }
        foreach library [info loaded {}] {
            if {![string match -nocase *sorma* [lindex $library 1]]} {
                return 0
            }
        }
        foreach channel [chan names] {
            foreach event {readable writable} {
                if {![catch {fileevent $channel $event} script] && $script ne {}} {
                    return 0
                }
            }
        }
        return 1
    }}
)tcl";

bool nobodyWaits(Tcl_Interp* interp) {
    if (Tcl_IsSafe(interp) || Tcl_GetMaster(interp)) return false;
    int yes = 0;
    if (Tcl_EvalEx(interp, kNobodyWaits, -1, TCL_EVAL_GLOBAL) != TCL_OK ||
        Tcl_GetBooleanFromObj(nullptr, Tcl_GetObjResult(interp), &yes) != TCL_OK)
        yes = 0;
    Tcl_ResetResult(interp);
    return yes != 0;
}

}  // namespace

bool install(Tcl_Interp* interp, std::shared_ptr<Reactor> reactor, std::function<void()> serve) {
    Threads& all = threads();
    if (all.first || !nobodyWaits(interp)) return false;
    own = new Set(std::move(reactor));
    own->serve = std::move(serve);
    all.first = own;
    Tcl_NotifierProcs procs{};
    procs.setTimerProc = [](const Tcl_Time*) { here().due = true; };
    procs.waitForEventProc = waitForEvent;
    procs.createFileHandlerProc = createHandler;
    procs.deleteFileHandlerProc = deleteHandler;
    procs.initNotifierProc = beginThread;
    procs.finalizeNotifierProc = endThread;
    procs.alertNotifierProc = alert;
    procs.serviceModeHookProc = [](int) {};
    Tcl_SetNotifier(&procs);
    return true;
}

bool goOn(std::int64_t end) {
    Set& set = here();
    if (set.due || set.files > 0 || set.alerted || set.until == Reactor::kNoWait) return false;
    if (set.until != 0 && set.reactor->seen() >= set.until) return false;
    return set.reactor->gather(set.until == 0 ? end : std::min(end, set.until));
}

void release(const Reactor& reactor) {
    Set* first = threads().first;
    if (first && first->reactor.get() == &reactor) first->serve = nullptr;
}

#endif

}  // namespace sorma::notifier
