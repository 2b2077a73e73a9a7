// remote.h -- the calling side of protected calls: what the rows and bench --client do alike.
#pragma once

#include <deque>
#include <string>

#include "comm/comm.h"
#include "sorma.h"

namespace bench {

// A C++ program that embeds the bus, without Tcl. Its lines go as the name of a row says: by the socket, or by memory.
struct Bus {
    Bus() { comm.settings.sharing = sorma::Sharing::never; }
    sorma::Sorm sorm;
    sorma::Comm comm{sorm};
};

// A request that is made again and again: empty to class nop, or a text of 16 characters and 10 floats each way through
// class echo. By the ordinary path: the SORM finds the proxy, the proxy is called by reference.
class Remote {
public:
    Remote(Bus& bus, const std::string& address, bool record);

    void call();                // one blocking call; throws when the reply is not what was sent
    // So many in flight at a time, until more() returns false. It is told how many replies have just come.
    template <class More> void pipeline(std::size_t window, More more);

    std::size_t requestSize() const;        // on the wire
    std::size_t replySize() const;

private:
    void check(const sorma::Message& m) const;

    bool record_;
    sorma::Reference service_;
    sorma::Connection& connection_;
    sorma::Message message_, sent_;
};

template <class More> void Remote::pipeline(std::size_t window, More more) {
    std::deque<sorma::Connection::Ticket> flying;
    sorma::Deadline deadline;
    auto submit = [&](std::size_t n) {
        const std::int64_t now = sorma::monotonicNow();
        deadline = sorma::Deadline::at(now + 25'000'000'000);
        for (; n > 0; --n) flying.push_back(connection_.submit(record_ ? "echo" : "nop", sorma::Method::exec, sent_, deadline, now));
        connection_.flush(deadline);
    };
    submit(window);
    while (!flying.empty()) {
        // The first one blocks; those that came with it are there.
        std::size_t came = 0;
        do {
            connection_.collect(flying.front(), message_);
            flying.pop_front();
            check(message_);
            ++came;
        } while (!flying.empty() && connection_.arrived(flying.front()));
        if (more(came)) submit(came);
    }
}

}  // namespace bench
