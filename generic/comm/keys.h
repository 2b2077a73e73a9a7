// keys.h -- the folder with the keys of this user. The program sorma-keys fills it.
//
//     authority.pem      the authority that has signed our own certificate; its key, authority.key, is on one host alone
//     trusted.pem        other authorities: who has a certificate of theirs is known, and may nothing by itself
//     NAME.pem           a private key and its certificate, in one file, so that both are replaced at once
//     own                the NAME that this host has
//     pins               names of daemons that were reached with TLS, and since when
//     revoked            names, or serial numbers, of certificates that hold no longer
//     crl.pem            lists of the authorities that say the same
//
// It is $SORMA_KEYS, else $XDG_CONFIG_HOME/sorma/keys, else ~/.config/sorma/keys. Knows nothing of TLS.
//
// Threads: any.
#pragma once

#include <initializer_list>
#include <set>
#include <string>

namespace sorma::keys {

std::string folder();                                   // empty: there is no home
std::string file(const std::string& name);              // of the folder
// Is there an authority, or a name of our own? Then TLS is what we speak.
bool present();
// The name whose certificate a daemon shows, or a client (daemon empty); empty: there is none.
std::string ownName(const std::string& daemon);
// Changes when one of these files does.
std::string stamp(std::initializer_list<std::string> names);
// Why a file cannot be read that is there; empty: it can, or there is none.
std::string unreadable(const std::string& name);
// The date since when a daemon is known to speak TLS; empty: it is not.
std::string pinned(const std::string& name);
// Write it down. Returns why that cannot be, with the file; empty: it is.
std::string pin(const std::string& name);
std::set<std::string> revoked();
// Why a private key must not be used: who else may read it. Empty: it may be.
std::string exposed(const std::string& path);

}  // namespace sorma::keys
