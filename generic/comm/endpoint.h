// endpoint.h -- makes sockets for addresses, on both sides of a connection.
//
// Threads: any thread may call these functions. They throw Error with the code that stands beside each.
// Owner:   the caller owns each descriptor that is returned.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bus/deadline.h"
#include "bus/name.h"

namespace sorma {

// The folder where daemons of this user listen: $SORMA_RUNTIME_DIR, else $XDG_RUNTIME_DIR/sorma, else /tmp/sorma-UID. It is
// made with mode 0700 when missing. Fails with COMM DENIED when it belongs to somebody else, or when others may read or
// write it: they could see who serves what, or put a socket of their own in a daemon's place. Others may pass through it
// (0711), since each socket has a mode of its own.
std::string runtimeFolder();
std::string runtimeSocket(const std::string& name);     // NAME.sock in it

// A connected stream socket: blocking, close-on-exec, above 1024, TCP_NODELAY. Blocks until the deadline, and while a host's
// name is looked up. Fails with COMM REFUSED, COMM TIMEOUT, ADDRESS UNRESOLVED.   who: the name that messages begin with.
int connectTo(const Address& address, const std::string& who, Deadline deadline);

// The same in two steps, without waiting; only the look-up of a host's name may still block. beginConnect returns a socket
// that is connecting; it becomes writable when that is over. Then endConnect returns, or throws as connectTo; the socket
// blocks again, and stays the caller's in either case.
int beginConnect(const Address& address, const std::string& who);
void endConnect(int fd, const Address& address, const std::string& who);

// An address for messages: "127.0.0.1:7014", "/run/user/1000/sorma/robot.sock".
std::string describe(const Address& address);

// A listening socket, non-blocking. Fails with COMM REFUSED; the message names who has the address, where that is known.
// port: 0: a free one.   boundPort: becomes the port.
int listenTcp(const std::string& host, int port, int& boundPort);
// The same for a Unix-domain socket. Removes the socket file of a daemon that died; refuses when a live one answers. Holds a
// lock on the folder meanwhile, for which it waits 3 s at most. share: other users may connect. Their access to the runtime
// folder is then to sockets whose name they know.
int listenUnix(const std::string& path, bool share = false);

// Remove the socket file of a daemon that died, with the same lock. False: a daemon listens there, or nobody can tell.
bool sweepSocket(const std::string& path);

// A socket that another program has opened for us (socket activation, inetd). Returns a copy that is like our own:
// non-blocking, close-on-exec, above 1024. The original stays open and belongs to the caller. Fails with COMM REFUSED when
// the descriptor is not a listening, or connected, stream socket (TCP or Unix-domain); the message says what it is.
struct Inherited {
    int fd;
    bool tcp;
    int port;               // TCP: where it is bound
    std::string path;       // Unix-domain: the same; "@name" in the abstract namespace; empty: a connection without a name
};
Inherited inheritListener(int fd);
Inherited inheritConnection(int fd);

// rpcbind of a host, through libtirpc; each of these blocks. program, offset: program number minus 0x20000000.
// The port of a registered program, 0 when it is not registered.
int rpcbindLookup(const std::string& host, std::uint32_t program);
// Register a TCP port; offset 0 takes the first free number. Returns the offset. Fails with COMM REFUSED, COMM LIMIT.
std::uint32_t rpcbindRegister(std::uint32_t offset, const std::string& host, int port);
void rpcbindUnregister(std::uint32_t offset);
// Offsets of the daemons that are registered at a host; none when it does not answer. May take a minute.
std::vector<std::uint32_t> rpcbindPrograms(const std::string& host);

}  // namespace sorma
