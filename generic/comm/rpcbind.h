// rpcbind.h -- registers programs with the rpcbind of a host and looks them up, through libtirpc. Each of these functions
// blocks. program, offset: program number minus 0x20000000.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sorma {

std::string hex(std::uint32_t number);
// The port of a registered program, 0 when it is not registered.
int rpcbindLookup(const std::string& host, std::uint32_t program);
// Register a TCP port; offset 0 takes the first free number. Returns the offset. Fails with COMM REFUSED, COMM LIMIT.
std::uint32_t rpcbindRegister(std::uint32_t offset, const std::string& host, int port);
void rpcbindUnregister(std::uint32_t offset);
// Offsets of the daemons that are registered at a host; none when it does not answer. May take a minute.
std::vector<std::uint32_t> rpcbindPrograms(const std::string& host);

}  // namespace sorma
