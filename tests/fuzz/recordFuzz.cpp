// recordFuzz.cpp -- what a stranger sends. As a stream: however it is cut, the same records come out of it, and each byte is in
// one of them at most. As one record: decode it as every kind of message; what can be decoded is encoded again and must decode
// to the same.
#include <cstdlib>
#include <string>
#include <vector>

#include "comm/record.h"
#include "comm/wire.h"
#include "../embed/divided.h"

using namespace sorma;

namespace {

// The records of a stream that comes in parts of this size, and what is left then.
std::vector<std::string> divide(std::string_view stream, std::size_t part) {
    record::Assembler pieces;
    Buffer rest;
    auto found = divided(stream, part, 100, pieces, rest);
    found.push_back(std::to_string(pieces.dropping()) + " " + std::to_string(pieces.size()) + " " + std::to_string(rest.size()));
    return found;
}

void readStream(std::string_view stream) {
    const auto all = divide(stream, stream.size() + 1);
    for (std::size_t part : {1, 3, 64})
        if (divide(stream, part) != all) std::abort();
    std::size_t bytes = 0;
    record::Reader records(stream.data(), stream.size(), SIZE_MAX);
    for (std::string_view record; records.next(record);) bytes += record::kMarkSize + record.size();
    if (bytes > stream.size() || records.at() != stream.data() + bytes) std::abort();
    Buffer copy;
    copy.append(stream.data(), stream.size());
    if (record::wholeBefore(copy, copy.size()) != bytes) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string_view record(reinterpret_cast<const char*>(data), size);
    readStream(record);
    {
        XdrReader r(record);
        auto envelope = wire::readEnvelope(r);
        if (envelope.kind == 0) wire::readCallHeader(r, envelope.xid);
        else (void)wire::readReplyHeader(r);
    }
    {
        XdrReader r(record);
        wire::Request request;
        Message m;
        if (wire::readRequest(r, request, m)) {
            Buffer out;
            wire::writeCall(out, 1, wire::kProgram, request, m);
            XdrReader back(out.data() + record::kMarkSize, out.size() - record::kMarkSize);
            wire::readCallHeader(back, wire::readEnvelope(back).xid);
            wire::Request again;
            Message same;
            if (!wire::readRequest(back, again, same)) std::abort();
            if (again.name != request.name || again.slot != request.slot || again.method != request.method) std::abort();
            if (same.text != m.text || same.ints != m.ints || same.any != m.any || same.words != m.words) std::abort();
            if (same.floats.size() != m.floats.size()) std::abort();
        }
    }
    {
        XdrReader r(record);
        wire::Times times;
        Message m;
        if (wire::readReply(r, times, m)) {
            Buffer out;
            wire::writeReply(out, 1, times, m);
            XdrReader back(out.data() + record::kMarkSize, out.size() - record::kMarkSize);
            wire::readEnvelope(back);
            if (!wire::readReplyHeader(back).empty()) std::abort();
            Message same;
            if (!wire::readReply(back, times, same) || same.code != m.code || same.trail != m.trail) std::abort();
        }
    }
    {
        XdrReader r(record);
        wire::Hello hello;
        wire::readHello(r, hello);
    }
    {
        XdrReader r(record);
        wire::Welcome welcome;
        wire::readWelcome(r, welcome);
    }
    return 0;
}
