// bookkeeping.h -- what DBX -stats and -audit of an object show: two observers of requests, which every SORM has.
//
// Statistics count the CTRLs and DBXs of each object and measure one EXEC in 64, from its coming to its answer: the clock
// costs as much as a call. The audit keeps the last CTRLs of each object: who, when, what, and how it ended. An entry is made
// when the request comes, so one that never ends is there, too.
//
// Objects in other processes keep their own books.
//
// An object gives an option a value itself (Service, method store in Tcl): then that is its origin, for DBX -why.
//
// Threads: the SORM's.
#pragma once

#include <memory>

#include "bus/option.h"
#include "bus/request.h"
#include "bus/statistics.h"

namespace sorma {

// Adds what an object of this process has done.
void addFigures(Figures& sum, const Service& service);

// The option has a new value, by the object itself.   settling: in its settle(). When the value is the one of before the last change of the
// option, that change is taken back: its origin is the one of before, too, and CTRL -undo does not know the change any more.
void noteFound(Service& service, std::size_t option, const Value& value, bool settling);

std::unique_ptr<Observer> makeStatistics();
std::unique_ptr<Observer> makeAudit(Sorm& sorm);

}  // namespace sorma
