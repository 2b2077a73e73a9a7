// directories.cpp -- directories WORD ...: a process with the directory that these words of a dictionary's line choose; none: local.
//
// It reads commands from standard input, a line each, and answers each with a line. News are lines "changed NAME WHEN"; WHEN: [us since 1970].
//
//     claim NAME IDENTITY ADDRESS ...     {}
//     claimed NAME                        none | asking WHY | owned EPOCH | taken WHOSE | lost WHY
//     find NAME                           known EPOCH AGE IDENTITY ADDRESS ... | asking WHY | absent WHY | away WHY;   AGE: 0, or old
//     finds NAME NUMBER                   how long a find takes [ns], of so many
//     release NAME ...                    {}
//     entries                             NAME ...
//     turns                               how often the loop has turned: after two of them all news so far are known
//     place NAME                          known ADDRESS | asks WHY | absent WHY, as requests see it
#include <cstdio>
#include <iostream>
#include <sstream>

#include <unistd.h>

#include "comm/comm.h"
#include "sorma.h"
#include "directory/rows.h"

using namespace sorma;

namespace {

using Found = Directory::Found::State;
using Claim = Directory::Claim::State;

std::string ask(Comm& comm, std::istringstream& in) {
    std::string command, name;
    in >> command >> name;
    Directory& directory = *comm.directory().get();
    if (command == "claim") {
        Directory::Entry entry{name};
        in >> entry.identity;
        entry.machine = thisMachine();
        for (std::string address; in >> address;) entry.addresses.push_back(address);
        directory.claim(entry);
        return "{}";
    }
    if (command == "claimed") {
        const auto claim = directory.claimed(name);
        constexpr const char* kStates[] = {"none", "asking", "owned", "taken", "lost"};
        const std::string state = kStates[std::size_t(claim.state)];
        return claim.state == Claim::owned ? state + " " + std::to_string(claim.epoch) : state + " " + claim.why;
    }
    if (command == "find") {
        const auto found = directory.find(name);
        constexpr const char* kStates[] = {"known", "asking", "absent", "away"};
        std::string out = kStates[std::size_t(found.state)];
        if (found.state != Found::known) return out + " " + found.why;
        out += " " + std::to_string(found.entry.epoch) + (found.age > 0 ? " old " : " 0 ") + found.entry.identity;
        for (auto& address : found.entry.addresses) out += " " + address;
        return out;
    }
    if (command == "finds") {
        std::int64_t number = 1;
        in >> number;
        std::size_t known = 0;
        const std::int64_t begin = monotonicNow();
        for (std::int64_t i = 0; i < number; ++i) known += directory.find(name).state == Found::known;
        const std::int64_t took = monotonicNow() - begin;
        return known == std::size_t(number) ? std::to_string(double(took) / double(number)) : "it is not known";
    }
    if (command == "release") {
        std::vector<std::string> names{name};
        while (in >> name) names.push_back(name);
        directory.release(names);
        return "{}";
    }
    if (command == "entries") {
        std::string out;
        for (auto& entry : directory.entries()) out += (out.empty() ? "" : " ") + entry.name;
        return out;
    }
    if (command == "turns") return std::to_string(comm.reactor().turns());
    if (command == "place") {
        const auto place = comm.directory().place(Address::parse(name));
        constexpr const char* kStates[] = {"known", "asks", "absent"};
        return std::string(kStates[std::size_t(place.state)]) + " " + (place.why.empty() ? place.target.toText() : place.why);
    }
    return "unknown command " + command;
}

}  // namespace

int main(int argc, char** argv) {
    Sorm sorm;
    Comm comm(sorm);
    directory::addRows();
    if (argc > 1) sorm.dictionary().add("@directory", {argv + 1, argv + argc}, "the test");
    try {
        comm.directory().get()->changed = [](const std::string& name) { std::printf("changed %s %lld\n", name.c_str(), static_cast<long long>(wallNow())); };
    } catch (const Error& e) {
        std::printf("error {%s} %s\n", e.code().size() > 1 ? e.code()[1].c_str() : "", e.what());
        return 1;
    }
    std::printf("ready\n");
    std::fflush(stdout);
    std::string text;
    bool end = false;
    comm.reactor().watch(0, [&] {
        char bytes[4096];
        const ssize_t n = read(0, bytes, sizeof bytes);
        end = n <= 0;
        if (n > 0) text.append(bytes, std::size_t(n));
        for (std::size_t at; (at = text.find('\n')) != text.npos; text.erase(0, at + 1)) {
            std::istringstream in(text.substr(0, at));
            std::printf("%s\n", ask(comm, in).c_str());
        }
        std::fflush(stdout);
    });
    while (!end) {
        comm.reactor().poll(-1);
        std::fflush(stdout);
    }
}
