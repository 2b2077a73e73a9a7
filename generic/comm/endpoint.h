// endpoint.h -- from an address to a socket, for both sides.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bus/deadline.h"
#include "bus/name.h"

namespace sorma {

// Folder where daemons of this user listen: $SORMA_RUNTIME_DIR, else $XDG_RUNTIME_DIR/sorma, else /tmp/sorma-UID.
// Made with mode 0700 when missing. Fails with COMM DENIED when it belongs to somebody else, or others may read or write it:
// they could see who serves what, or put a socket of their own in a daemon's place. That others may pass through (0711)
// gives them nothing, since each socket has a mode of its own.
std::string runtimeFolder();
std::string runtimeSocket(const std::string& name);     // NAME.sock in it

// A connected stream socket, blocking, close-on-exec, above 1024, TCP_NODELAY. who: whom error messages name.
// Fails with COMM REFUSED, COMM TIMEOUT, ADDRESS UNRESOLVED. errnoOut: of the failed connect, 0 otherwise.
int connectTo(const Address& address, const std::string& who, Deadline deadline);

// The same in two steps, for those who must not wait: a socket that is connecting (writable when that has ended), and
// what came of it. Looking up a host's name may still take its time.
int beginConnect(const Address& address, const std::string& who);
void endConnect(int fd, const Address& address, const std::string& who);       // throws as connectTo; then it blocks again

// What an address stands for, for messages: "127.0.0.1:7014", "/run/user/1000/sorma/robot.sock".
std::string describe(const Address& address);

// Listening sockets, non-blocking. Fail with COMM REFUSED, naming who holds the address where that can be known.
int listenTcp(const std::string& host, int port, int& boundPort);
// Removes the socket file of a daemon that died; refuses when a live one answers. Holds a lock on the folder meanwhile, for
// which it waits 3 s at most. share: other users may connect; of the runtime folder they may then use what they know the name of.
int listenUnix(const std::string& path, bool share = false);

// Remove the socket file of a daemon that died. False: one listens there, or it cannot be known. The same lock.
bool sweepSocket(const std::string& path);

// Sockets that somebody else has opened for us (socket activation, inetd), as copies that are like our own: non-blocking,
// close-on-exec, above 1024. The original stays open, and the caller's. Fail with COMM REFUSED, saying what the
// descriptor is instead, when it is no stream socket, TCP or Unix-domain, that listens or that is connected.
struct Inherited {
    int fd;
    bool tcp;
    int port;               // TCP: where it is bound
    std::string path;       // Unix-domain: the same; "@name" in the abstract namespace; empty: a connection without a name
};
Inherited inheritListener(int fd);
Inherited inheritConnection(int fd);

// rpcbind of a host (through libtirpc). Port of a registered program, 0 when it is not registered.
int rpcbindLookup(const std::string& host, std::uint32_t program);
// Register a TCP port; program offset 0 takes the first free one. Returns the offset. Fails with COMM REFUSED.
std::uint32_t rpcbindRegister(std::uint32_t offset, const std::string& host, int port);
void rpcbindUnregister(std::uint32_t offset);
// Offsets of the daemons that are registered at a host; none when it cannot be asked. May take a minute.
std::vector<std::uint32_t> rpcbindPrograms(const std::string& host);

}  // namespace sorma
