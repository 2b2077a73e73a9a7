// identity.h -- who is at the other end of a connection, as the kernel says.
//
// For a Unix socket: user, groups and process of the peer. For TCP from this host: the user who owns the other socket, which
// the kernel is asked for once, by netlink (sock_diag). For TCP from another host: its address.
#pragma once

#include "bus/call.h"

namespace sorma {

struct Identity {
    Caller caller;                      // for people: messages, lists, statistics
    PrincipalPointer principal;         // for the policy; null: the owner, which is this user or root by Unix socket
};

// Never blocks and never fails: when the kernel does not say, the principal is anyone.
// fd: a connected socket.   tcp: true for TCP, false for Unix-domain.
Identity identify(int fd, bool tcp);

}  // namespace sorma
