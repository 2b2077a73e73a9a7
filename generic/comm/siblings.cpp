#include "comm/siblings.h"

#include <fcntl.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <charconv>

#include "bus/catalogue.h"
#include "bus/name.h"
#include "comm/runtimeFolder.h"

namespace sorma {

namespace {

constexpr std::string_view kTcp = ".tcp";

// "HOST PORT" of a file of our own folder; port 0: it says something else.
Sibling read(const std::string& folder, const std::string& name) {
    Sibling s{name, {}, 0};
    const Descriptor in(open((folder + "/" + name + std::string(kTcp)).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
    if (!in) return s;
    char text[300];
    ssize_t n = ::read(in.get(), text, sizeof text);
    std::string_view said(text, n > 0 ? std::size_t(n) : 0);
    auto blank = said.find(' ');
    if (blank == std::string_view::npos) return s;
    int port = 0;
    auto [end, wrong] = std::from_chars(said.data() + blank + 1, said.data() + said.size(), port);
    if (wrong != std::errc() || port < 1 || port > 65535) return s;
    s.host = said.substr(0, blank);
    s.port = port;
    return s;
}

}  // namespace

std::vector<Sibling> siblings() {
    std::vector<Sibling> found;
    std::string folder;
    try {
        folder = runtimeFolder();
    } catch (const Error&) {
        return found;
    }
    for (auto& name : namesIn(folder, kTcp)) {
        if (!Name::isName("sorm@" + name) || access((folder + "/" + name + std::string(kSocketEnding)).c_str(), F_OK) != 0) continue;
        if (Sibling s = read(folder, name); s.port > 0) found.push_back(std::move(s));
    }
    return found;
}

SiblingFile::SiblingFile(const std::string& socket, const std::string& host, int port) {
    if (!std::string_view(socket).ends_with(kSocketEnding)) return;
    try {
        if (socket.substr(0, socket.rfind('/')) != runtimeFolder()) return;
    } catch (const Error&) {
        return;
    }
    std::string file = socket.substr(0, socket.size() - kSocketEnding.size()) + std::string(kTcp), made = file + ".new";
    std::string text = host + ' ' + std::to_string(port) + '\n';
    const Descriptor out(open(made.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (!out) return;                   // then it is not found from elsewhere; everything else works
    bool good = write(out.get(), text.data(), text.size()) == ssize_t(text.size());
    if (good && rename(made.c_str(), file.c_str()) == 0) file_ = file;
    else unlink(made.c_str());
}

SiblingFile::~SiblingFile() {
    if (!file_.empty()) unlink(file_.c_str());
}

FolderWatch::FolderWatch(Reactor& reactor, std::string folder, std::string ending, std::function<void()> changed)
    : reactor_(reactor), folder_(std::move(folder)), ending_(std::move(ending)), changed_(std::move(changed)) {
    fd_ = raiseDescriptor(Descriptor(inotify_init1(IN_NONBLOCK | IN_CLOEXEC)));
    if (!fd_) return;
    inotify_add_watch(fd_.get(), folder_.c_str(), IN_CREATE | IN_DELETE | IN_MOVED_FROM | IN_MOVED_TO | IN_ATTRIB);
    reactor_.watch(fd_.get(), [this] { ready(); });
}

FolderWatch::~FolderWatch() { end(); }

void FolderWatch::end() {
    if (!fd_) return;
    reactor_.unwatch(fd_.get());
    fd_.close();
}

void FolderWatch::ready() {
    alignas(inotify_event) char events[4096];
    bool gone = false, matters = false;
    for (ssize_t n; (n = ::read(fd_.get(), events, sizeof events)) > 0;)
        for (char* at = events; at < events + n; at += sizeof(inotify_event) + reinterpret_cast<inotify_event*>(at)->len) {
            auto* e = reinterpret_cast<inotify_event*>(at);
            gone = gone || (e->mask & IN_IGNORED);
            // The rights of the folder itself may have changed.
            matters = matters || e->len == 0 || std::string_view(e->name).ends_with(ending_);
        }
    if (gone) end();
    if (gone || matters) {
        auto changed = changed_;        // it may end us
        changed();
    }
}

}  // namespace sorma
