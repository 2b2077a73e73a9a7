// transportClients.cpp -- cases of the client: each has a daemon that follows a script, in a thread of its own.
#include <sys/socket.h>

#include <atomic>
#include <thread>

#include "transports.h"

namespace transports {

namespace {

constexpr std::uint64_t kBoot = 4711;

class Scripted {
public:
    explicit Scripted(const Row& row) : socket(row.listen()), address(addressOf(socket)) {}
    ~Scripted() { stop(); }
    void run(std::function<void(Scripted&)> script) {
        thread_ = std::thread([this, script = std::move(script)] {
            try {
                script(*this);
            } catch (const std::exception& e) {
                wrong = e.what();
            }
        });
    }
    void finish() {
        if (thread_.joinable()) thread_.join();
        check(wrong.empty(), "the daemon: " + wrong);
    }
    void stop() {
        if (thread_.joinable()) thread_.join();
        socket.fd.close();
        if (!socket.path.empty()) unlink(socket.path.c_str());
    }
    End accept() {
        for (;;) {
            pollfd p{socket.fd.get(), POLLIN, 0};
            check(poll(&p, 1, 60'000) == 1, "nobody connects");
            if (Line line = socket.row->accept(socket.fd.get()); line.open()) {
                End end(std::move(line));
                end.upgrade(Transport::Stage::connected);
                return end;
            }
        }
    }
    static Buffer welcome(std::uint32_t xid, std::uint64_t boot, bool known) {
        Buffer out;
        wire::Welcome w{boot, "scripted", "u", "h", "p", getpid(), 0, std::uint32_t(kLimit), 16, known};
        wire::writeWelcome(out, xid, w);
        return out;
    }
    static Buffer reply(std::uint32_t xid, std::string text) {
        Buffer out;
        Message m;
        m.text = std::move(text);
        wire::writeReply(out, xid, {}, m);
        return out;
    }
    // Accept, and greet.
    // when: not before that is true.
    End greet(std::uint64_t boot = kBoot, bool known = true, const std::atomic<bool>* when = nullptr) {
        End end = accept();
        const auto hello = end.call();
        if (when) when->wait(false);
        check(hello.procedure == wire::kHello, "HELLO does not come first");
        end.say(welcome(hello.xid, boot, known));
        end.upgrade(Transport::Stage::greeted);
        return end;
    }
    ListeningSocket socket;
    Address address;
    std::string wrong;

private:
    std::thread thread_;
};

struct Client {
    Sorm sorm;
    std::shared_ptr<Reactor> reactor = std::make_shared<Reactor>(sorm.mailbox());
    std::shared_ptr<Settings> settings = std::make_shared<Settings>();
    std::shared_ptr<Connection> connection;

    explicit Client(Address address) {
        sorm.setLoop(reactor.get());
        settings->maxMessage = kLimit;
        connection = std::make_shared<Connection>("scripted", [address] { return address; }, settings, reactor, sorm.mailbox());
    }
    ~Client() {
        connection->end();
        connection.reset();
        sorm.setLoop(nullptr);
    }
    // Call it, blocking or from the reactor. The text of the reply, or the code and the message of the error.
    std::string call(bool blocking, std::int64_t patience = 60'000, std::string text = "hello") {
        Message m;
        m.text = std::move(text);
        try {
            if (blocking) {
                connection->call("so.x", Method::exec, m, Deadline::in(patience));
                return m.text;
            }
            auto pending = begin(m, patience);
            turnUntil([&] { return pending->answered(); });
            return Future(pending).result().text;
        } catch (const Error& e) {
            auto* cause = e.trail.cause();
            return (cause ? std::string(cause->symbol) : "?") + ": " + e.what();
        }
    }
    PendingPointer begin(const Message& m, std::int64_t patience) {
        auto pending = std::make_shared<Pending>(sorm, Deadline::in(patience), nullptr, nullptr);
        pending->message = m;
        connection->begin(pending, "so.x", Method::exec);
        return pending;
    }
    template <class Done> void turnUntil(Done done) {
        for (Deadline enough = Deadline::in(60'000); !done(); reactor->poll(10'000'000)) check(!enough.passed(), "it waits in vain");
    }
};

// Do it with calls that block, then with calls that the reactor drives.
void bothWays(const std::function<void(bool blocking)>& body) {
    for (bool blocking : {true, false}) body(blocking);
}

// A daemon that goes by its script, and a client of it.
void converse(const Row& row, const std::function<void(Scripted&)>& script, const std::function<void(Client&)>& body) {
    Scripted daemon(row);
    daemon.run(script);
    {
        Client client(daemon.address);
        body(client);
    }
    daemon.finish();
}

void absent(const Row& row) {
    bothWays([&](bool blocking) {
        Scripted daemon(row);
        daemon.stop();
        Client client(daemon.address);
        expect(client.call(blocking), "COMM REFUSED");
    });
}

void refused(const Row& row) {
    bothWays([&](bool blocking) {
        Scripted daemon(row);
        daemon.run([](Scripted& d) { d.accept(); });
        Client client(daemon.address);
        expect(client.call(blocking), "COMM REFUSED");
        daemon.finish();
    });
}

// The welcome is cut at each byte: each attempt is refused, or not a daemon's, and the last one is served.
void cutWelcome(const Row& row) {
    bothWays([&](bool blocking) {
        const std::size_t size = Scripted::welcome(0, kBoot, false).size();
        converse(row, [size](Scripted& d) {
            for (std::size_t at = 0; at < size; ++at) {
                End end = d.accept();
                const auto hello = end.call();
                end.say(Scripted::welcome(hello.xid, kBoot, false), at);
            }
            End end = d.greet(kBoot, false);
            end.say(Scripted::reply(end.call().xid, "whole"));
            end.record();
        }, [&](Client& client) {
            for (std::size_t at = 0; at < size; ++at) expect(client.call(blocking), "COMM REFUSED");
            expect(client.call(blocking), "whole");
        });
    });
}

// The reply is cut at each byte: the same daemon is asked again, and executes nothing twice.
void cutReply(const Row& row) {
    bothWays([&](bool blocking) {
        const std::size_t size = Scripted::reply(0, "whole").size();
        converse(row, [size](Scripted& d) {
            for (std::size_t at = 0; at < size; at += at < 40 ? 1 : 7) {
                std::string first;
                {
                    End end = d.greet();
                    const auto header = end.call();
                    first = end.last;
                    end.say(Scripted::reply(header.xid, "whole"), at);
                }
                End end = d.greet();
                const auto header = end.call();
                check(end.last == first, "it asks something else");
                end.say(Scripted::reply(header.xid, "whole"));
            }
        }, [&](Client& client) {
            for (std::size_t at = 0; at < size; at += at < 40 ? 1 : 7) expect(client.call(blocking), "whole");
        });
    });
}

// It is connected and says nothing: the call ends with its deadline. Later it answers, and the next call is served.
void halfOpen(const Row& row) {
    bothWays([&](bool blocking) {
        std::atomic<bool> over{false};
        converse(row, [&over](Scripted& d) {
            End end = d.greet(kBoot, false, &over);
            for (auto header = end.call(); header.procedure != 99; header = end.call())
                if (header.procedure == wire::kCall) end.say(Scripted::reply(header.xid, "late"));
        }, [&](Client& client) {
            expect(client.call(blocking, 100), "COMM TIMEOUT");
            over = true;
            over.notify_all();
            expect(client.call(blocking), "late");
        });
    });
}

void hugeRecord(const Row& row) {
    bothWays([&](bool blocking) {
        converse(row, [](Scripted& d) {
            {
                End end = d.greet();
                end.call();
                Buffer mark;
                XdrWriter(mark).u32(0x80000000u | (1u << 30));
                end.say(mark);
                end.more();
            }
            End end = d.greet(kBoot + 1, false);
            end.record();
        }, [&](Client& client) {
            expect(client.call(blocking), "not a record of ONC RPC");
        });
    });
}

// A request that is longer than the daemon takes is not sent, and the connection goes on.
void tooBig(const Row& row) {
    bothWays([&](bool blocking) {
        converse(row, [](Scripted& d) {
            End end = d.greet();
            end.say(Scripted::reply(end.call().xid, "small"));
            end.record();
        }, [&](Client& client) {
            expect(client.call(blocking, 60'000, std::string(kLimit + 1, 'x')), "COMM TOO_BIG");
            expect(client.call(blocking), "small");
        });
    });
}

void cancelConnecting(const Row& row) {
    std::atomic<bool> over{false};
    converse(row, [&over](Scripted& d) {
        End end = d.greet(kBoot, false, &over);
        const auto header = end.call();
        end.say(Scripted::reply(header.xid, end.last.find("second") != std::string::npos ? "second" : "the cancelled one was sent"));
        end.record();
    }, [&](Client& client) {
        Message m;
        auto first = client.begin(m, 60'000);
        check(Future(first).cancel(), "it cannot be cancelled");
        over = true;
        over.notify_all();
        expect(client.call(false, 60'000, "second"), "second");
    });
}

// The daemon ends while it greets, and another one takes its place: the call is made there, once.
void restartConnecting(const Row& row) {
    bothWays([&](bool blocking) {
        converse(row, [](Scripted& d) {
            {
                End end = d.greet(1, false);
                end.say(Scripted::reply(end.call().xid, "first"));
                end.record();                           // until the client closes it
            }
            {
                End end = d.accept();
                end.call();                             // HELLO; it ends without an answer
            }
            End end = d.greet(2, false);
            end.say(Scripted::reply(end.call().xid, "second"));
            check(end.record().empty(), "the call comes twice");
        }, [&](Client& client) {
            expect(client.call(blocking), "first");
            client.connection->close("for the test");
            expect(client.call(blocking), "second");
        });
    });
}

// Both send much and read slowly: nothing is lost, and neither waits for the other.
void slowReaders(const Row& row) {
    bothWays([&](bool blocking) {
        std::string text;                               // no piece of it is like another one
        while (text.size() < kLimit / 2) text += std::to_string(text.size()) + ' ';
        converse(row, [&text](Scripted& d) {
            End end = d.greet();
            for (int buffer : {SO_RCVBUF, SO_SNDBUF}) {     // so that neither side's socket takes a message at once
                const int small = 65536;
                setsockopt(end.line.descriptor(), SOL_SOCKET, buffer, &small, sizeof small);
            }
            std::string bytes;
            char few[1000];
            while (true) {                              // a few bytes at a time
                check(end.wait(EPOLLIN), "nothing comes");
                ssize_t n = end.line.read(few, sizeof few);
                if (n == 0) return;
                if (n > 0) bytes.append(few, std::size_t(n));
                record::Reader records(bytes.data(), bytes.size(), SIZE_MAX);
                std::string_view record;
                if (!records.next(record)) continue;
                XdrReader r(record);
                const auto envelope = wire::readEnvelope(r);
                check(record.find(text) != record.npos, "the request is another one");
                end.say(Scripted::reply(envelope.xid, text));
                bytes.erase(0, std::size_t(records.at() - bytes.data()));
            }
        }, [&](Client& client) {
            for (int i = 0; i < 3; ++i) check(client.call(blocking, 60'000, text) == text, "the reply is another one");
        });
    });
}

void highDescriptor(const Row& row) {
    Scripted daemon(row);
    check(daemon.socket.fd.get() > 1023, "the listening socket has descriptor " + std::to_string(daemon.socket.fd.get()));
    Line line = transportOf(daemon.address).begin(daemon.address, "test");
    Line came = daemon.socket.row->accept(daemon.socket.fd.get());
    check(line.descriptor() > 1023 && came.descriptor() > 1023, "a line has a low descriptor");
    check(line.row().finish(line, "test"), "it is not connected");
}

void addresses(const Row& row) {
    Scripted daemon(row);
    auto& way = transportOf(daemon.address);
    const auto found = way.place(daemon.address);
    check(found.state == Transport::Found::State::known && found.target == daemon.address, "it does not know its own address");
    check(way.leadsTo(daemon.address, daemon.socket), "its address does not lead to it");
    check(!way.leadsTo(Scripted(row).address, daemon.socket), "another address leads to it");
    check(describe(daemon.address) == daemon.address.toText(), "it is described as " + describe(daemon.address));
}

}  // namespace

const Cases clientCases{
    {"absent", absent}, {"refused", refused}, {"cutWelcome", cutWelcome}, {"cutReply", cutReply}, {"halfOpen", halfOpen},
    {"hugeRecord", hugeRecord}, {"tooBig", tooBig}, {"cancelConnecting", cancelConnecting},
    {"restartConnecting", restartConnecting}, {"slowReaders", slowReaders}, {"highDescriptor", highDescriptor},
    {"addresses", addresses},
};

}  // namespace transports
