// directory.h -- where names of daemons are, and whose they are: one for a host, or one for many hosts.
//
//     local       the runtime folder of this user on this host; needs no server, and is what there is without a line
//     etcd        a cluster of etcd, which this line of the dictionary chooses:
//
//         @directory  etcd:http://h1:2379,http://h2:2379  -prefix lab
//
// A name has one owner. A claim that was granted lasts for the time to live, and is renewed by the directory's own code as long as the
// loop turns. When it cannot be renewed, it ends here before it ends there: so nobody else has the name while this process
// believes that it has it. Each grant has an epoch, which is higher than all before it.
//
// The rows are a module, services/directory. No function waits, except where its comment says so. A new directory is a row there, and a
// line in tests/directory.test.
//
// Threads: those of one SORM belong to its thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "bus/sorm.h"
#include "comm/transport.h"

namespace sorma {

class Directory {
public:
    struct Entry {
        std::string name = {};
        std::string identity = {};                      // of the owner, for people: "joe@cell sormad[77]"
        std::string machine = {};                       // which kernel its sockets are in: thisMachine()
        std::vector<std::string> addresses = {};        // as after @: paths, HOST:PORT; the best one first
        std::int64_t epoch = 0;                         // given by the directory
    };
    struct Found {
        enum class State : std::uint8_t { known, asking, absent, away } state = State::absent;
        Entry entry = {};               // known
        std::int64_t age = 0;           // [ns] known: since the directory was last heard, when it is away; else 0
        std::string why = {};           // asking, absent, away: for people
    };
    struct Claim {
        enum class State : std::uint8_t { none, asking, owned, taken, lost } state = State::none;
        std::int64_t epoch = 0;         // owned: of this grant
        std::int64_t asked = 0;         // owned: [ns, bootNow] when the question was sent whose answer says so
        std::int64_t until = 0;         // owned: [ns, bootNow] when it ends unless it is renewed; 0: with this process
        std::string why = {};           // asking, taken, lost: for people. taken names the owner
    };

    virtual ~Directory() = default;
    virtual std::string describe() const = 0;           // for people: "etcd http://h1:2379, prefix lab"
    // Ask for a name, and keep it. Where it is taken or was lost the directory goes on asking, until release(). An entry of that name
    // that this process has claimed before is replaced. The row says how long a grant lasts.
    virtual void claim(const Entry& wanted) = 0;
    virtual Claim claimed(const std::string& name) = 0; // what has become of it, at this very moment
    // Give names back. Waits for half a second at most, so that they are free at once.
    virtual void release(const std::vector<std::string>& names) = 0;
    virtual Found find(const std::string& name) = 0;
    virtual std::vector<Entry> entries() = 0;           // all that is known now
    virtual bool told() { return true; }                // has it ever said what there is?
    // Wait for news of this directory alone, until a time on the monotonic clock [ns].
    virtual void wait(std::int64_t until) = 0;
    // Called from the loop, or from wait(), when what find() or claimed() say of a name has changed. May be empty.
    std::function<void(const std::string& name)> changed;

    // ---- rows ----

    // Makes one. words: of the dictionary's line; the first is "KIND:REST". Fails with DIRECTORY SYNTAX.
    using Row = std::unique_ptr<Directory> (*)(Sorm& sorm, Loop& loop, const std::vector<std::string>& words);
    static void add(const std::string& kind, Row row);  // unless there is one of that kind
    // Tells, for people, how a name is resolved. Null: the module with the rows is not loaded.
    using Steps = std::string (*)(class Comm& comm, Sorm& sorm, const std::string& name);
    static std::atomic<Steps> steps;                    // set when all rows are there
    static void load(Sorm& sorm);                       // that module, if it is there
};

std::int64_t bootNow();                                 // [ns] as monotonicNow(), and goes on while the machine sleeps
const std::string& thisMachine();                       // the kernel's number of this boot

// The directory of one SORM: what its dictionary's entry @directory says now.
class ChosenDirectory {
public:
    ChosenDirectory(Sorm& sorm, Loop& loop) : sorm_(sorm), loop_(loop) {}
    ~ChosenDirectory();
    ChosenDirectory(const ChosenDirectory&) = delete;
    ChosenDirectory& operator=(const ChosenDirectory&) = delete;
    bool remote() const;                                // is there such an entry?
    // Fails with DIRECTORY MISSING when nothing here knows its kind, DIRECTORY SYNTAX, DIRECTORY DENIED when somebody else has written it.
    std::shared_ptr<Directory> get();
    // Where an alias leads that the dictionary does not know: as the directory says, and, when it knows none, the runtime folder.
    Transport::Found place(const Address& alias);
    // Called when a name may lead elsewhere now. May be empty.
    std::function<void()> changed;

private:
    void tellAge(const Directory::Found& found);

    Sorm& sorm_;
    Loop& loop_;
    std::vector<std::string> words_;                    // of which it was made
    std::shared_ptr<Directory> directory_;
    bool told_ = false;                                 // that it is away
};

}  // namespace sorma
