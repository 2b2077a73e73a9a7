// recordFuzz.cpp -- what a stranger sends as a record: decode as every kind of message; what can be decoded is encoded
// again and must decode to the same.
#include <cstdlib>

#include "comm/wire.h"

using namespace sorma;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string_view record(reinterpret_cast<const char*>(data), size);
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
            XdrReader back(out.data() + wire::kMarkSize, out.size() - wire::kMarkSize);
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
            XdrReader back(out.data() + wire::kMarkSize, out.size() - wire::kMarkSize);
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
