// In place of tls.cpp, where there is no OpenSSL: what wants TLS fails.
#include "bus/catalogue.h"
#include "comm/keys.h"
#include "comm/tls.h"
#include "comm/tlsProbe.h"
#include "comm/visitor.h"

namespace sorma::tls {

namespace {
const Prototype kWithout{Severity::error, "TLS REFUSED", 1, "{}: no TLS: this SORMA was built without OpenSSL; nothing was sent; install libssl-dev, and build it again"};
}

const Transport& rowFor(const Transport& row, const Address& address, const std::string& who) {
    if (&row == &tcpTransport && wanted(address, who)) fail(kWithout, who);
    return row;
}
void check(const std::string& daemon) { fail(kWithout, daemon); }
Line offered(Line line, const Offer&) { return line; }
bool secure(const Line&) { return false; }
Judge judge(const Offer&) {
    return [](const Line&) { return std::string(); };
}
std::string trouble(const Offer&) { return {}; }
Trail remarks(const Line&, const std::string&) { return {}; }
std::string visitor(const std::string&, const std::string& who) { fail(kWithout, who); }

}  // namespace sorma::tls
