// etcdDirectory.h -- the directory of many hosts: a cluster of etcd, version 3, by its JSON gateway.
//
//     @directory  etcd:http://h1:2379,http://h2:2379  ?-prefix lab?  ?-user NAME -password FILE?
//                 ?-authority FILE?  ?-certificate FILE -key FILE?  ?-lease SECONDS?
//
// Each name is the key PREFIX/NAME. Its value is a JSON object with identity, machine and addresses. The key has the lease of its
// process: etcd removes it when the process does not renew the lease. The epoch is the revision of the cluster in which the key was made.
//
// There is one watch for all names, from which find() answers at once. A question with a quorum behind it shows every few seconds whether
// the answers are still true. A server that was cut off, or is stopped, does not answer it. Then the next server is asked. A process that has not
// heard any of them finds what others have heard before in the cache.
//
// Threads: the SORM's.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bus/deadline.h"
#include "alarms.h"
#include "cache.h"
#include "comm/directory.h"
#include "http.h"
#include "json.h"

namespace etcd {

class Lease;

class EtcdDirectory : public sorma::Directory {
public:
    struct Settings {
        std::vector<std::string> servers;           // URLs
        std::string prefix = "sorma", user, password;
        Keys keys;
        std::int64_t lease = 10;                    // [s] that a grant lasts
        static Settings of(const std::vector<std::string>& words);     // fails with DIRECTORY SYNTAX
    };
    struct Reply {
        Json json;
        std::string why;                            // empty: it is good; else for people
        bool heard = false;                         // a server has said no, and another one would say the same
        std::size_t server = 0;                     // which one
    };
    using Replied = std::function<void(const Reply& reply)>;

    EtcdDirectory(sorma::Loop& loop, Settings settings);
    ~EtcdDirectory() override;

    std::string describe() const override;
    void claim(const Entry& wanted) override;
    Claim claimed(const std::string& name) override;
    void release(const std::vector<std::string>& names) override;
    Found find(const std::string& name) override;
    std::vector<Entry> entries() override;
    bool told() override { return begin(), revision_ != 0; }
    void wait(std::int64_t until) override;

    // ---- for the lease ----
    // Ask the present server; when it does not answer, the next one is the present one from then on. milliseconds: for the answer.
    // Nothing is called after end().
    using Number = std::uint64_t;
    Number ask(const std::string& path, std::string body, long milliseconds, Replied replied);
    void end(Number& number);
    std::string key(const std::string& name) const { return settings_.prefix + "/" + name; }
    std::string quorum() const { return "{\"key\":" + base64(key({})) + ",\"count_only\":true}"; }     // for kv/range: needs one, and costs little
    static Entry entryOf(const std::string& name, const Json& pair);
    static std::string valueOf(const Entry& entry);
    void tell(const std::string& name) {
        if (changed) changed(name);
    }
    void owned(Entry entry, std::int64_t epoch);    // by us: it is known from now on, also when the watch has not told it yet
    Alarms& alarms() { return alarms_; }
    std::int64_t jitter(std::int64_t most);         // [ns] random, from half of it to all of it

private:
    struct Question {
        std::string path, body;
        long milliseconds;
        Replied replied;
        Http::Number request = 0;                   // 0: it waits until the user has logged in
        std::string token = {};                     // with which it was posted
        bool again = false;                         // its token was refused once
    };
    void post(Number number);
    void answered(Number number, std::size_t server, Http::Answer answer);
    void logIn();
    void turn();
    void begin() {
        if (!std::exchange(begun_, true)) read();
    }
    void read();                                    // all names, then watch what changes after that
    void watch(std::int64_t revision);
    void take(std::string_view line);
    void note(const std::string& name, Entry entry, std::int64_t lease, std::int64_t revision);
    void confirm(const std::string& name);          // that nobody has it
    void learn(const Json& range, std::int64_t revision);      // all names there are
    void keep();                                    // what is known, for processes that begin while it is away
    void recall();
    void probe();
    void heard(std::int64_t asked);
    void failed(const std::string& why);
    bool fresh() const { return read_ && failures_ == 0; }
    std::string range() const;                      // of all names, as members of a question

    const Settings settings_;
    Http http_;
    Alarms alarms_;
    std::size_t server_ = 0;                        // the present one
    std::string token_;                             // of the user; empty: none yet
    Number last_ = 0;
    std::map<Number, Question> questions_;
    Http::Number loggingIn_ = 0, watching_ = 0;
    Number reading_ = 0, probing_ = 0;
    std::map<std::string, Entry> names_;            // epoch 0: nobody has it
    struct Doubt {
        Number asking = 0;
        std::int64_t answered = 0;                  // [ns]; 0: not yet
    };
    std::map<std::string, Doubt> doubts_;           // names that nobody has, as far as we know
    std::unique_ptr<Lease> lease_;                  // of this process, with the names that it claims
    const Cache cache_;
    std::int64_t revision_ = 0;                     // of the latest news
    bool begun_ = false, read_ = false;             // read_: names_ is what it once said
    std::int64_t heardAt_ = 0;                      // [ns] when the last question was sent that a quorum has answered
    std::size_t failures_ = 0;                      // in a row
    std::string why_;                               // of the last one
    Alarms::Number next_ = 0;                       // question
    Alarms::Number keep_ = 0;
};

std::unique_ptr<sorma::Directory> row(sorma::Sorm& sorm, sorma::Loop& loop, const std::vector<std::string>& words);

}  // namespace etcd
