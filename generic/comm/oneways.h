// oneways.h -- the one-way requests of this process to one daemon: nobody answers them.
//
// One that is not on its way when the connection breaks goes to the next daemon; one whose last byte the kernel has taken does
// not. If one will never be sent, whenDropped is called.
//
// Threads: belongs to the thread of its SORM.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "bus/message.h"
#include "comm/calls.h"

namespace sorma {

class Oneways {
public:
    static constexpr Link::Tag kTag = Slots::kControl;      // of their bytes in the link

    Oneways(Link& link, Calls& calls, const Settings& settings) : link_(link), calls_(calls), settings_(settings) {}

    // As Connection::oneway. mayBlock: it may wait for room.
    void send(const std::string& name, Method method, const Message& m, const PrincipalPointer& relayFor, bool mayBlock);
    void resume();                                      // requests may be sent again: send what waits
    void unsent(const Buffer& records, std::size_t taken);      // the link is lost, and has taken so many bytes of them
    void failed(const Error& why, bool final);          // to connect
    std::string finish(Deadline deadline);              // as Connection::finish
    bool waiting() const { return !kept_.empty(); }     // for a connection
    void forget() { kept_.release(); }                  // nobody is told
    std::uint64_t dropped() const { return dropped_; }

    std::function<void(Trail)> whenDropped;             // as Connection has it

private:
    std::size_t backlog() const { return kept_.size() + link_.backlog(); }      // [bytes]
    void makeRoom(std::size_t most, Deadline deadline); // block until the backlog is no more than that, or the deadline
    void keep(const char* records, std::size_t size);
    void drop(std::size_t count, const std::string& why);
    void dropKept(const std::string& why);

    Link& link_;
    Calls& calls_;
    const Settings& settings_;
    Buffer kept_;                           // those that wait for the next connection
    std::int64_t since_ = 0;                // [ns] since when the first of them waits
    std::uint64_t dropped_ = 0;             // so many were never sent
    std::string why_;                       // the last of them
};

}  // namespace sorma
