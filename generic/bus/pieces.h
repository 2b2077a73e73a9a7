// pieces.h -- a reply in pieces, each made when the reader wants it: so the reply may be larger than memory. People call it a
// stream. The events that an object publishes are something else: bus/stream.h.
//
// The author of a class:
//
//     std::unique_ptr<sorma::Pieces> inPieces(sorma::Message& request) override {
//         return sorma::piecesOf([file = open(request)](sorma::Message& piece, std::size_t most) { file->read(piece.any, most); });
//     }
//
// A reader, here or in another process:
//
//     sorma::Reading reading(object, request);
//     for (sorma::Message piece; reading.next(piece);) use(piece);
//
// Each piece is one request: NAME DBX -stream next STREAM NUMBER. A reader sends a few in advance. The writer makes a piece when
// such a request is there. So a writer without requests does nothing, and both need memory for a few pieces only.
//
// Threads: the SORM's, but for Pieces::wake.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>

#include "bus/message.h"
#include "bus/reference.h"
#include "bus/reply.h"

namespace sorma {

// The writer of one reply, made by Service::inPieces. All pieces together are the reply.
// Owner: the stream, which deletes the writer at its end, so a writer may keep a pointer to its object. A stream ends early when its reader
// has closed it, has ended or lost the right, or has not read for Sorm::streamTime. Removing the object ends it, too.
class Pieces {
public:
    virtual ~Pieces() = default;
    // Write the next piece into an empty message. A message without text, floats, ints and any is the end. Throw: the stream ends
    // with that error. False: there is no piece yet; it is called again after wake().   most: how large a piece the reader wants [bytes].
    // Must be short, as exec. It may run the event loop: then it is not called again before it has returned.
    virtual bool next(Message& piece, std::size_t most) = 0;
    // Does next() more than give what is there already? A serial object then begins nothing else until it has returned true.
    virtual bool works() const { return true; }
    // Memory that it holds [bytes], charged to the reader.
    virtual std::size_t heap() const { return 0; }

protected:
    // There is a piece, or the end. Any thread, while it exists.
    void wake() const { wake_(); }

private:
    friend class OpenPieces;
    std::function<void()> wake_;
};

// A writer whose function always has a piece, or the end.
std::unique_ptr<Pieces> piecesOf(std::function<void(Message& piece, std::size_t most)> next);
// A writer that cuts a reply, which is there as a whole, or comes later.
std::unique_ptr<Pieces> piecesOf(Message&& reply);
std::unique_ptr<Pieces> piecesOf(PendingPointer reply);

// Is it the end of a stream: has it no text, floats, ints and any?
inline bool isEnd(const Message& piece) { return piece.text.empty() && piece.floats.empty() && piece.ints.empty() && piece.any.empty(); }

// Reads a reply in pieces. Delete it to end it; the writer then stops.
class Reading {
public:
    struct How {
        std::size_t most = 256 << 10;       // of a piece [bytes]; the writer may give less, and where it cannot cut, more
        std::size_t ahead = 4;              // pieces that are asked for in advance
    };
    static constexpr std::size_t kMostPiece = 4 << 20, kMostAhead = 64;

    // Begins to read what the EXEC of an object answers. An object that knows nothing of pieces is read, too: its reply is cut.
    Reading(Reference object, const Message& request, How how);
    Reading(Reference object, const Message& request) : Reading(std::move(object), request, How()) {}
    ~Reading() { close(); }
    Reading(const Reading&) = delete;
    Reading& operator=(const Reading&) = delete;

    // Wait for the next piece. False: that was all. Throws the error that has ended the stream; COMM TIMEOUT when the deadline
    // passes, and then it may be called again.
    bool next(Message& piece, Deadline deadline = {});
    enum class Taken { piece, end, notYet };
    // The same without waiting. notYet: take again when coming() is done.
    Taken take(Message& piece);
    bool ready();                           // would take() not say notYet?
    const Future& coming() const { return asked_.front(); }     // unless it has ended
    bool ended() const { return ended_; }
    void close();                           // end it now

private:
    Future send(std::string words) const;
    void ask();
    void end();
    static void tellEnd(const Reference& object, const KeptCallPointer& context, std::string number);
    [[noreturn]] void failed();             // the exception under way ends it

    const Reference object_;
    const How how_;
    const KeptCallPointer context_;         // for which it reads
    std::deque<Future> asked_;              // in order; first of all the stream itself
    std::uint64_t stream_ = 0, next_ = 0;   // stream_ 0: not open yet; next_: the piece to ask for
    bool ended_ = false;
    Trail failure_;
};

}  // namespace sorma
