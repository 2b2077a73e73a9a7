#include "host.h"

#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include <sorma.h>

namespace host {

namespace {

const sorma::Prototype kUnreadable{sorma::Severity::error, "HOST UNREADABLE", 1, "host: cannot read {}: {}"};

std::ifstream openFile(const std::string& name) {
    std::ifstream file(name);
    if (!file) fail(kUnreadable, name, std::strerror(errno));
    file.imbue(std::locale::classic());
    return file;
}

std::string firstLine(const std::filesystem::path& name) {
    std::ifstream file(name);
    std::string line;
    std::getline(file, line);
    return line;
}

double seconds(clockid_t id) {
    timespec t{};
    clock_gettime(id, &t);
    return double(t.tv_sec) + double(t.tv_nsec) / 1e9;
}

// A path as /proc/self/mounts writes it: white space, backslash and # are three octal digits after a backslash.
std::string unescaped(const std::string& text) {
    auto octal = [&](std::size_t i) { return text[i] >= '0' && text[i] <= '7'; };
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '\\' && i + 3 < text.size() && octal(i + 1) && octal(i + 2) && octal(i + 3)) {
            out += char((text[i + 1] - '0') * 64 + (text[i + 2] - '0') * 8 + (text[i + 3] - '0'));
            i += 3;
        } else {
            out += text[i];
        }
    }
    return out;
}

void measure(Disk& d) {
    struct statvfs s;
    if (statvfs(d.path.c_str(), &s) != 0) fail(kUnreadable, d.path, std::strerror(errno));
    d.size = double(s.f_blocks) * double(s.f_frsize);
    d.available = double(s.f_bavail) * double(s.f_frsize);
}

}  // namespace

Load load() {
    auto file = openFile("/proc/loadavg");
    Load l{};
    char slash = 0;
    if (!(file >> l.oneMinute >> l.fiveMinutes >> l.fifteenMinutes >> l.running >> slash >> l.processes))
        fail(kUnreadable, "/proc/loadavg", "its format is unknown");
    l.processors = int(sysconf(_SC_NPROCESSORS_ONLN));
    return l;
}

Memory memory() {
    auto file = openFile("/proc/meminfo");
    Memory m{};
    std::string line;
    while (std::getline(file, line)) {
        std::istringstream words(line);
        std::string name;
        double kilobytes = 0;
        words >> name >> kilobytes;
        double bytes = kilobytes * 1024;
        if (name == "MemTotal:") m.total = bytes;
        else if (name == "MemAvailable:") m.available = bytes;
        else if (name == "SwapTotal:") m.swapTotal = bytes;
        else if (name == "SwapFree:") m.swapFree = bytes;
    }
    if (m.total == 0) fail(kUnreadable, "/proc/meminfo", "there is no MemTotal in it");
    return m;
}

std::vector<Disk> disks() {
    auto file = openFile("/proc/self/mounts");
    std::vector<Disk> out;
    std::set<std::string> seen;
    std::string line;
    while (std::getline(file, line)) {
        std::istringstream words(line);
        Disk d{};
        words >> d.device >> d.path >> d.type;
        d.path = unescaped(d.path);
        bool real = d.device.starts_with("/dev/") || d.type == "zfs" || d.path == "/";     // root: a container has no device
        if (!real || !seen.insert(d.device).second) continue;
        try {
            measure(d);
        } catch (const sorma::Error&) {
            continue;                   // a mount that we may not look into
        }
        out.push_back(d);
    }
    return out;
}

Disk disk(const std::string& path) {
    Disk d{};
    d.path = path;
    measure(d);
    return d;
}

std::vector<Temperature> temperatures() {
    namespace fs = std::filesystem;
    std::vector<Temperature> out;
    std::error_code none;
    auto add = [&](const std::string& name, const fs::path& file) {
        std::string text = firstLine(file);
        double milliCelsius = 0;
        if (sorma::parseNumber(text, milliCelsius)) out.push_back({name, milliCelsius / 1000 + 273.15});
    };
    for (auto& chip : fs::directory_iterator("/sys/class/hwmon", none))
        for (auto& file : fs::directory_iterator(chip.path(), none)) {
            std::string name = file.path().filename();
            if (!name.starts_with("temp") || !name.ends_with("_input")) continue;
            std::string label = firstLine(chip.path() / (name.substr(0, name.size() - 5) + "label"));
            add(firstLine(chip.path() / "name") + "." + (label.empty() ? name.substr(0, name.size() - 6) : label), file.path());
        }
    if (!out.empty()) return out;       // the thermal zones would tell the same again
    for (auto& zone : fs::directory_iterator("/sys/class/thermal", none))
        if (fs::exists(zone.path() / "temp", none)) add(firstLine(zone.path() / "type"), zone.path() / "temp");
    return out;
}

Clock clock() {
    timespec r{};
    clock_getres(CLOCK_MONOTONIC, &r);
    return {seconds(CLOCK_REALTIME), seconds(CLOCK_MONOTONIC), seconds(CLOCK_BOOTTIME),
            double(r.tv_sec) + double(r.tv_nsec) / 1e9};
}

}  // namespace host
