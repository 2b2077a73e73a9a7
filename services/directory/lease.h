// lease.h -- the lease of this process at etcd, and the names that it keeps with it.
//
//     renew: grant a lease, or keep it alive, each third of the time to live, by a server behind which a quorum stands
//     put:   put the keys of names with that lease, if nobody has them     > owned, or taken: then again when the name is free
//
// One question asks for all names that are due. When one of them is taken, nothing was put; the next question asks for the others.
// Is the lease there, then so are its keys. When it has ended, there is a new one, and all names are due. A key that is to go is removed
// alone; with the last one the lease is revoked.
//
// The time is counted from when a question was sent, on a clock that goes on while the machine sleeps. It ends a fifth earlier here than there:
// so at no time two processes believe that they own a name.
//
// Threads: the SORM's.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "etcdDirectory.h"

namespace etcd {

class Lease {
public:
    using Claim = sorma::Directory::Claim;
    Lease(EtcdDirectory& directory, std::int64_t timeToLive);       // [ns]
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;

    void claim(const sorma::Directory::Entry& wanted);
    Claim claimed(const std::string& name) const;                   // at this moment
    std::vector<std::string> names() const;
    // Give names back. It goes on when the server does not answer.
    void release(const std::vector<std::string>& names);
    bool gives() const;                                             // there are some of which it has not heard that yet
    // The directory says whose the name is at a revision: the epoch of its owner, and the lease of the key; 0: nobody's.
    void seen(const std::string& name, std::int64_t epoch, std::int64_t lease, std::int64_t revision);

private:
    struct Name {
        sorma::Directory::Entry wanted;
        Claim::State state = Claim::State::asking;
        std::string why = "the directory has not answered yet";
        std::int64_t epoch = 0;             // owned: of the grant
        bool due = true;                    // to be asked about
        bool remove = false;                // its key must go first
        bool released = false;              // and then it is not wanted any more
        struct {
            std::int64_t epoch = 0, revision = 0;
        } told = {};                        // whose it was at a revision, since the last question about it was sent
    };

    void forget();
    void revoke();
    std::vector<std::string> namesThat(bool (*are)(const Name& own)) const;
    void become(const std::string& name, Claim::State state, const std::string& why);
    void renew();
    void keepAlive(std::int64_t asked, std::size_t server);
    void renewed(std::int64_t asked, const EtcdDirectory::Reply& reply);
    void lose(const std::string& why);
    void next();
    void askAgain();
    void ask(const std::vector<std::string>& names, std::string body, std::function<void(const Json& json)> answered);
    void remove(const std::string& name);
    void put(const std::vector<std::string>& names);
    void found(const std::string& name, const Json& pair);
    void owned(const std::string& name, std::int64_t epoch);
    long patience() const { return long(timeToLive_ / 6'000'000); }         // [ms] for an answer: then there is time for another server

    EtcdDirectory& directory_;
    const std::int64_t timeToLive_;
    std::map<std::string, Name> names_;
    std::size_t most_ = 100;                // names in a question: etcd refuses more than 128, unless it is told otherwise
    std::int64_t id_ = 0;                   // 0: none
    std::int64_t renewed_ = 0, until_ = 0;  // [ns, bootNow] when the question was sent that granted or renewed it; when it ends here
    EtcdDirectory::Number renewing_ = 0, asking_ = 0, revoking_ = 0;
    Alarms::Number renewal_ = 0, end_ = 0, again_ = 0;
};

}  // namespace etcd
