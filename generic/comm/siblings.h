// siblings.h -- where the daemons of one user on one host are reached by TCP, for those who look on from another host.
//
// Each daemon that listens to TCP says it in the runtime folder: NAME.tcp, beside NAME.sock, holds "HOST PORT".
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "comm/reactor.h"

namespace sorma {

struct Sibling {
    std::string name;
    std::string host;       // the interface it listens to
    int port = 0;
};

// Those in the runtime folder whose sockets are there; none when nobody may believe that folder.
std::vector<Sibling> siblings();

// Says it of one daemon, as long as this lives. socket: its Unix-domain one; elsewhere than in the runtime folder nothing is said.
class SiblingFile {
public:
    SiblingFile(const std::string& socket, const std::string& host, int port);
    ~SiblingFile();
    SiblingFile(const SiblingFile&) = delete;
    SiblingFile& operator=(const SiblingFile&) = delete;

private:
    std::string file_;      // empty: there is none
};

// Calls when a file comes to a folder or leaves it. Without inotify never: then who asks again now and then sees it.
class FolderWatch {
public:
    // changed: ending of the files that matter, such as ".sock".
    FolderWatch(Reactor& reactor, std::string folder, std::string ending, std::function<void()> changed);
    ~FolderWatch();
    FolderWatch(const FolderWatch&) = delete;
    FolderWatch& operator=(const FolderWatch&) = delete;

    const std::string& folder() const { return folder_; }
    bool alive() const { return fd_ >= 0; }         // no: the folder itself has gone

private:
    void ready();
    void end();

    Reactor& reactor_;
    std::string folder_, ending_;
    std::function<void()> changed_;
    int fd_ = -1;
};

}  // namespace sorma
