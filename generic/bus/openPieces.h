// openPieces.h -- the streams that are open at one object: DBX -stream, see bus/pieces.h. Only the files of Service include it.
//
//     -stream open BYTES {EXEC word ...}      ints: the number of the stream; BYTES: how large a piece the reader wants
//     -stream next STREAM NUMBER              its piece of that number, counted from 0; empty: there are no more
//     -stream close STREAM
//     -stream list                            for people
//
// Pieces are made in order, each when its request is there, however requests come. A stream belongs to the client and the
// author that have opened it, and ends with the client. A serial object makes one piece or executes one EXEC at a time; while a
// stream waits for its reader, the object does other work. Each piece needs the rights of the EXEC anew, and the object's lock. Its
// memory is on the account of the author.
//
//     none --open--> open --end, error, idle, rights lost--> over --close, the client ends, idle--> none
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>

#include "bus/client.h"
#include "bus/option.h"
#include "bus/pieces.h"

namespace sorma {

class OpenPieces {
public:
    static constexpr std::size_t kMostStreams = 64;     // of one client at one object
    static constexpr std::size_t kStream = 64 << 10;    // [bytes] what each is charged with, beside its own memory

    explicit OpenPieces(Service& service) : service_(service) {}
    ~OpenPieces() { endAll({}); }
    // A request -stream: answers in m, perhaps later.
    void request(Args args, Message& m);
    // The object is removed: all end. why: for those who wait for a piece.
    void endAll(const Trail& why);
    // A serial object may make a piece of the stream that has waited longest.
    void nextTurn();

private:
    struct One;
    using Pointer = std::shared_ptr<One>;
    void open(Args args, Message& m);
    void next(Args args, Message& m);
    std::unique_ptr<Pieces> begin(Message request);
    Pointer find(const std::string& number, const Message& m) const;   // of this client and author; null: there is none
    std::string list() const;
    void admit(const One& one);
    bool make(const Pointer& one, Message& piece);      // false: not yet
    bool takeTurn(const Pointer& one);                  // false: later, by nextTurn()
    void giveTurn(One& one);
    void serve(const Pointer& one);                     // those who wait
    void serveLater(const Pointer& one);
    void over(One& one, Trail why = {});                // there will be no more pieces
    void leave(One& one, const Trail& why);
    void erase(std::uint64_t number, const Trail& why);
    Trail closed() const;
    void clientLost(const Pointer& one);
    void watchIdle(const Pointer& one);

    Service& service_;
    std::map<std::uint64_t, Pointer> all_;
    std::deque<std::weak_ptr<One>> turns_;      // each has its null in Service::Record::waiting
};

}  // namespace sorma
