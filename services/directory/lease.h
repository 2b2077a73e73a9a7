// lease.h -- one name that this process wants to own.
//
//     asking: grant a lease > put the key with it, if nobody has it > owned: renew, each third of the time to live
//                                    |                                     |
//                                    taken: ask again, when it is free     lost: it was not renewed in time; go on trying
//
// The time is counted from when a question was sent, on a clock that goes on while the machine sleeps. It ends a fifth earlier here than there:
// so at no time two processes believe that they own the name.
//
// Threads: the SORM's.
#pragma once

#include <string>

#include "etcdDirectory.h"

namespace etcd {

class Lease {
public:
    using Claim = sorma::Directory::Claim;
    Lease(EtcdDirectory& directory, sorma::Directory::Entry wanted, std::int64_t timeToLive);
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;

    Claim claim() const;                // at this moment
    // The directory says whose the name is at a revision: the epoch of its owner; 0: nobody's.
    void seen(std::int64_t epoch, std::int64_t revision);
    // Give it back, and call when the server has heard it. Nothing else happens after that.
    void revoke(std::function<void()> done);

private:
    void grant();
    void put();
    void judge(const EtcdDirectory::Reply& reply);
    void own(std::int64_t epoch);
    void renew();
    void lose(const std::string& why);
    void later(std::int64_t nanoseconds, void (Lease::*what)());
    void ask(const char* path, std::string body, void (Lease::*answered)(const EtcdDirectory::Reply&));
    void granted(const EtcdDirectory::Reply& reply);
    void renewed(const EtcdDirectory::Reply& reply);
    void become(Claim::State state, const std::string& why);

    EtcdDirectory& directory_;
    const sorma::Directory::Entry wanted_;
    const std::int64_t timeToLive_;
    const std::string mark_;            // random: in the value, so that we know our own key again
    std::int64_t lease_ = 0;               // 0: none
    std::int64_t asked_ = 0;            // [ns, bootNow] when the question was sent whose answer is awaited
    Claim claim_;
    EtcdDirectory::Number asking_ = 0;
    Alarms::Number timer_ = 0, end_ = 0;
};

}  // namespace etcd
