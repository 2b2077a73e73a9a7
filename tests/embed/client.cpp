// client.cpp ADDRESS -- a C++ program that calls services of a daemon: by text, by reference, many in flight.
#include <cstdio>

#include "comm/comm.h"
#include "sorma.h"

int main(int argc, char** argv) {
    if (argc != 2) return std::fprintf(stderr, "usage: client ADDRESS\n"), 2;
    std::string where = argv[1];
    sorma::Sorm sorm;
    sorma::Comm comm(sorm);
    try {
        std::string reply;
        sorm.dispatch("echo@" + where + " EXEC TMSG hello FMSG 2 1.5 3", reply);
        std::puts(reply.c_str());

        sorma::Reference echo = sorm.get("echo@" + where);
        sorma::Message m;
        m.ints = {1, 2, 3};
        echo.exec(m);
        std::printf("%zu ints\n", m.ints.size());

        auto& line = static_cast<sorma::Proxy&>(*echo).connection();
        std::vector<sorma::Connection::Ticket> tickets;
        for (int i = 0; i < 64; ++i) {
            m.reset();
            m.ints = {i};
            tickets.push_back(line.submit("echo", sorma::Method::exec, m, sorma::Deadline::in(5000)));
        }
        int right = 0;
        for (int i = 63; i >= 0; --i) {             // collected in another order than sent
            line.collect(tickets[std::size_t(i)], m);
            right += m.ints.size() == 1 && m.ints[0] == i;
        }
        std::printf("%d of 64 in flight\n", right);

        sorm.dispatch("nop@" + where + " CTRL -nonsense", reply);
        std::puts(reply.find("OPTION UNKNOWN") != std::string::npos ? "refused in the daemon's words" : reply.c_str());
    } catch (const sorma::Error& e) {
        std::fprintf(stderr, "%s\n", e.trail.toText().c_str());
        return 1;
    }
    return 0;
}
