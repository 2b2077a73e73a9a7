// siblings.h -- at which TCP ports the daemons of one user on one host listen, for observers on another host.
//
// Each daemon that listens on TCP writes a file in the runtime folder: NAME.tcp, beside NAME.sock, contains "HOST PORT".
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "comm/reactor.h"

namespace sorma {

struct Sibling {
    std::string name;
    std::string host;       // the interface on which it listens
    int port = 0;
};

// The daemons in the runtime folder whose sockets exist, by name; none when runtimeFolder() fails. Any thread. Does not
// throw Error.
std::vector<Sibling> siblings();

// The file of one daemon, while this exists. socket: its Unix-domain socket; there is no file when that is not in the
// runtime folder. Never throws Error: without the file the daemon works, and observers on other hosts do not find it.
class SiblingFile {
public:
    SiblingFile(const std::string& socket, const std::string& host, int port);
    ~SiblingFile();
    SiblingFile(const SiblingFile&) = delete;
    SiblingFile& operator=(const SiblingFile&) = delete;

private:
    std::string file_;      // empty: there is none
};

// Calls back when a file is added to a folder or removed from it. Without inotify it never calls: then observers have to ask
// again.
// Threads: belongs to the reactor's thread.
class FolderWatch {
public:
    // ending: of the files that matter, such as ".sock".   changed: called from the reactor's turn, also when the rights of
    // the folder have changed or it was removed. It may delete this object.
    FolderWatch(Reactor& reactor, std::string folder, std::string ending, std::function<void()> changed);
    ~FolderWatch();
    FolderWatch(const FolderWatch&) = delete;
    FolderWatch& operator=(const FolderWatch&) = delete;

    const std::string& folder() const { return folder_; }
    bool alive() const { return bool(fd_); }        // false: the folder was removed, or there is no inotify

private:
    void ready();
    void end();

    Reactor& reactor_;
    std::string folder_, ending_;
    std::function<void()> changed_;
    Descriptor fd_;
};

}  // namespace sorma
