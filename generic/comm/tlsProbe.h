// tlsProbe.h -- the probe of RPC with TLS (RFC 9289, section 4.1): what is said in clear before the handshake. Only the files of tls include it.
//
// What is looked at stays in the socket until it is whole. Not a byte more is taken than the probe, or its answer, has.
#pragma once

#include <cstdint>
#include <string>

#include "bus/name.h"
#include "comm/transport.h"

namespace sorma::tls {

// As keys::pinned(), of a daemon that may be spoken to in clear. Fails with TLS KEY when nobody can say.
std::string pinnedSince(const std::string& name, const std::string& who);
// Does an attempt to reach an address begin with the probe? Fails with TLS PINNED, KEY.
bool wanted(const Address& address, const std::string& who);

namespace probe {

inline constexpr std::size_t kSize = 44;                // [bytes]
std::string ask();                                      // the probe
std::string answer(std::uint32_t xid);                  // with STARTTLS
// Could these bytes be the beginning of a probe, of whatever program?
bool isLike(const char* bytes, std::size_t size, std::uint32_t& xid);
// The socket becomes ready when so many bytes are there, or when the other end has closed. Else half a probe would keep us busy.
void wakeAt(const Line& line, std::size_t bytes);
// Has the other end closed? Asked before a look: then the look sees all that will ever come.
bool closing(const Line& line);

enum class Answer : std::uint8_t { notYet, start, plain };
// Reads the answer.   where: the address. Fails with COMM REFUSED, COMM LIMIT, COMM PROTOCOL.
Answer read(Line& line, const std::string& where, const std::string& who);

}  // namespace probe

}  // namespace sorma::tls
