// identity.h -- who is at the other end of a connection, as the kernel says.
//
// By Unix socket: user, groups and process of whoever connected. By TCP from this host: whose socket the other end is; the
// kernel is asked once, by netlink (sock_diag). By TCP from elsewhere: the address.
#pragma once

#include "bus/call.h"

namespace sorma {

struct Identity {
    Caller caller;
    PrincipalPointer principal;         // null: this user or root, by Unix socket
};

// fd: connected, TCP or Unix-domain.   tcp: which.
Identity identify(int fd, bool tcp);

}  // namespace sorma
