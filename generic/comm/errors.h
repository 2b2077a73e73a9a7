// errors.h -- the errors of COMM, for calls that got no answer from a service.
//
// Each message says what became of the request. It was never sent, or sent but not started; the daemon refused it; or it was sent and
// may have run. The error codes tell a caller what it may do:
//
//     ADDRESS UNRESOLVED   correct the name or the dictionary
//     DIRECTORY ASKED      the directory of names has not answered yet; the link tries again by itself
//     COMM REFUSED         start the daemon; never sent, so it may be sent again
//     COMM TIMEOUT         the message says whether the request may have run
//     COMM LOST            the connection broke after the request was sent: it may have run
//     COMM CANCELLED       the caller, or the request of which this one was a part, has been cancelled
//     COMM LIMIT, TOO_BIG  a limit of this process or of the daemon; not executed
//     COMM PROTOCOL        what answers there is not a SORMA daemon, or of another version
//     COMM DENIED          the daemon does not allow it
#pragma once

#include "bus/catalogue.h"

namespace sorma::errors {

inline const Prototype kUnresolved{Severity::error, "ADDRESS UNRESOLVED", 1, "{}: {}"};
inline const Prototype kAsked{Severity::error, "DIRECTORY ASKED", 1, "{}: {}; never sent"};
inline const Prototype kRefused{Severity::error, "COMM REFUSED", 1, "{}: cannot connect to {}: {}; never sent; {}"};
inline const Prototype kConnectTimeout{Severity::error, "COMM TIMEOUT", 1, "{}: no connection to {} within the deadline; never sent"};
inline const Prototype kTimeoutSent{Severity::error, "COMM TIMEOUT", 1,
    "{}: no answer in {} from {}; the request was sent and may have run"};
inline const Prototype kTimeoutUnsent{Severity::error, "COMM TIMEOUT", 1,
    "{}: {} did not come back in {} ({}); the request was never sent"};
inline const Prototype kTimeoutLate{Severity::error, "COMM TIMEOUT", 1,
    "{}: the deadline had passed before the request was started; it was not executed"};
inline const Prototype kLost{Severity::error, "COMM LOST", 1,
    "{}: the connection to {} (daemon {}, {} old) was lost: {}; the request was sent and {}, so whether it ran is unknown; {}"};
inline const Prototype kBound{Severity::error, "COMM LOST", 1, "{}: what was under way at {} cannot go on: {}"};
inline const Prototype kTimeoutPart{Severity::error, "COMM TIMEOUT", 1,
    "{}: no answer in {} from {}; the request was sent in part, and may still run"};
inline const Prototype kTimeoutCut{Severity::error, "COMM TIMEOUT", 1,
    "{}: {} did not come back in {} ({}); only a part of the request was sent, so it did not run"};
inline const Prototype kGivenUp{Severity::error, "COMM CANCELLED", 1,
    "{}: the request that it was part of has been cancelled; {} was told, and it may have run"};
inline const Prototype kGivenUpUnsent{Severity::error, "COMM CANCELLED", 1,
    "{}: the request that it was part of has been cancelled; it was never sent"};
inline const Prototype kUnanswered{Severity::error, "COMM TIMEOUT", 1,
    "{}: {} did not answer in {}; it was asked to {}, which is cancelled"};
inline const Prototype kProtocol{Severity::error, "COMM PROTOCOL", 1, "{}: {} does not answer like a SORMA daemon: {}; {}"};
inline const Prototype kTooBig{Severity::error, "COMM TOO_BIG", 1,
    "{}: the {} has {} bytes, {} takes at most {}; raise it there: sorma::configure -maxmessage BYTES"};
inline const Prototype kLimit{Severity::error, "COMM LIMIT", 1, "{}: {}"};
inline const Prototype kDaemonLimit{Severity::error, "COMM LIMIT", 1, "{}: refused by {}: {}; never started"};
inline const Prototype kReplyGone{Severity::error, "COMM LOST", 1,
    "{}: the request was executed, but its reply of {} bytes was too large for {} to keep until the connection was back"};
inline const Prototype kNoObject{Severity::error, "SERVICE GONE", 1, "there is no service object \"{}\"; subscribing does not make one"};
inline const Prototype kCode{Severity::error, "SERVICE FAILED", 1, "{}: EXEC returned code {}"};
inline const Prototype kStopped{Severity::error, "COMM CANCELLED", 1, "{}: the call was cancelled by its caller; it may have run"};
inline const Prototype kClientGone{Severity::error, "COMM CANCELLED", 1, "{}: its client has ended, or was disconnected for too long"};
inline const Prototype kRelay{Severity::error, "COMM DENIED", 1, "{}: a daemon serves only its own objects; use the address of the daemon that has this one"};
inline const Prototype kSequence{Severity::error, "COMM PROTOCOL", 1, "{}: sequence {} of slot {} does not follow {}"};

// An error that is not thrown here: as fail() takes them.
template <class... Args> Trail trailOf(Raised raised, const Args&... args) { return Trail(makeEntry(raised, {MessageArg::of(args)...})); }
template <class... Args> Error errorOf(Raised raised, const Args&... args) { return Error(makeEntry(raised, {MessageArg::of(args)...})); }

}  // namespace sorma::errors
