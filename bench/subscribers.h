// subscribers.h -- other processes that listen to what a daemon's object publishes.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace bench {

// Each process has a connection of its own, and so many subscriptions to one object. They end with this object, and with
// the benchmark itself should that be killed.
class Subscribers {
public:
    enum class Kind {
        reading,            // they count, and tell whenever a batch of events has come by all subscriptions of a process
        sharing,            // the same, by memory
        deaf,               // they never read
    };
    // object: as clients write it, NAME@ADDRESS. batch: events; each subscription keeps as many.
    // Returns when all have subscribed; throws when one cannot.
    Subscribers(Kind kind, const std::string& object, int processes, int each, int batch, int cpu);
    ~Subscribers();
    Subscribers(const Subscribers&) = delete;
    Subscribers& operator=(const Subscribers&) = delete;

    // Block until all have the next batch. Throws when an event was lost.
    void await() { hear(kBatch); }

private:
    static constexpr char kReady = 'r', kBatch = 'b', kLost = 'l', kFailed = 'f';       // what they tell

    void hear(char word);       // from each of them
    void stop();
    [[noreturn]] static void listen(int tell, Kind kind, const std::string& object, int each, int batch);

    int heard_ = -1;
    std::vector<pid_t> processes_;
};

}  // namespace bench
