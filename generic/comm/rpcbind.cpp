#include "comm/rpcbind.h"

#include <netdb.h>
#include <netinet/in.h>
#include <rpc/rpc.h>
#include <rpc/rpcb_clnt.h>
#include <unistd.h>

#include <cstring>
#include <memory>

#include "bus/catalogue.h"
#include "comm/wire.h"

namespace sorma {

namespace {

const Prototype kRegister{Severity::error, "COMM REFUSED", 1,
    "cannot register program 0x{} with this host's rpcbind: {}; is rpcbind running?"};
const Prototype kNoFree{Severity::error, "COMM LIMIT", 0, "no free program number: 0x20000001 .. 0x200003ff are all registered"};
constexpr std::uint32_t kLastOffset = 0x3ff;

struct NetworkId {
    netconfig* config = getnetconfigent("tcp");
    ~NetworkId() { if (config) freenetconfigent(config); }
};

bool registerOne(std::uint32_t offset, const std::string& host, int port) {
    NetworkId tcp;
    if (!tcp.config) fail(kRegister, hex(wire::kProgramBase + offset), "no network identifier \"tcp\" in /etc/netconfig");
    addrinfo hints{};
    hints.ai_family = AF_INET;
    hints.ai_flags = AI_NUMERICSERV;
    addrinfo* list = nullptr;
    if (int code = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &list))
        fail(kRegister, hex(wire::kProgramBase + offset), gai_strerror(code));
    std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> owner(list, freeaddrinfo);
    netbuf address{};
    address.buf = list->ai_addr;
    address.len = address.maxlen = list->ai_addrlen;
    return rpcb_set(wire::kProgramBase + offset, wire::kVersion, tcp.config, &address);
}

}  // namespace

std::string hex(std::uint32_t v) {
    char text[16];
    std::snprintf(text, sizeof text, "%x", v);
    return text;
}

int rpcbindLookup(const std::string& host, std::uint32_t program) {
    NetworkId tcp;
    if (!tcp.config) return 0;
    sockaddr_storage found{};
    netbuf address{};
    address.buf = &found;
    address.maxlen = sizeof found;
    if (!rpcb_getaddr(wire::kProgramBase + program, wire::kVersion, tcp.config, &address, host.c_str())) return 0;
    return ntohs(found.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(&found)->sin6_port
                                             : reinterpret_cast<sockaddr_in*>(&found)->sin_port);
}

std::uint32_t rpcbindRegister(std::uint32_t offset, const std::string& host, int port) {
    if (offset != 0) {
        if (!registerOne(offset, host, port))
            fail(kRegister, hex(wire::kProgramBase + offset), "refused (another daemon may hold the number)");
        return offset;
    }
    // A registered number may be a leftover of a daemon that died: then nothing listens at its port.
    for (offset = 1; offset <= kLastOffset; ++offset) {
        int taken = rpcbindLookup("127.0.0.1", offset);
        if (taken == 0) {
            if (registerOne(offset, host, port)) return offset;
            fail(kRegister, hex(wire::kProgramBase + offset), "refused");
        }
    }
    fail(kNoFree);
}

void rpcbindUnregister(std::uint32_t offset) {
    NetworkId tcp;
    if (tcp.config) rpcb_unset(wire::kProgramBase + offset, wire::kVersion, tcp.config);
}

std::vector<std::uint32_t> rpcbindPrograms(const std::string& host) {
    std::vector<std::uint32_t> found;
    NetworkId tcp;
    rpcblist* list = tcp.config ? rpcb_getmaps(tcp.config, host.c_str()) : nullptr;
    for (rpcblist* at = list; at; at = at->rpcb_next) {
        auto& map = at->rpcb_map;
        const std::uint32_t offset = std::uint32_t(map.r_prog) - wire::kProgramBase;
        if (map.r_vers == wire::kVersion && offset >= 1 && offset <= kLastOffset && map.r_netid && std::string_view(map.r_netid) == "tcp")
            found.push_back(offset);
    }
    if (list) xdr_free(reinterpret_cast<xdrproc_t>(xdr_rpcblist_ptr), &list);
    return found;
}

}  // namespace sorma
