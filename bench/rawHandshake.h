// rawHandshake.h -- what a handshake costs OpenSSL alone: both ends in one thread, their bytes by memory.
#pragma once

#include <memory>
#include <string>

namespace bench {

class RawHandshake {
public:
    // own: a file with a key and its certificate, which both ends show.   authority: a file with the certificate that has signed it.
    RawHandshake(const std::string& own, const std::string& authority);
    ~RawHandshake();

    void full();                // until the client has its ticket
    void resumed();             // with the ticket of the last one

private:
    struct Ends;
    std::unique_ptr<Ends> ends_;
};

}  // namespace bench
