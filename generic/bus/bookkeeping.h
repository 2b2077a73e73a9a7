// bookkeeping.h -- what DBX -stats and -audit of an object show: two observers of requests, which every SORM has.
//
// Statistics count the CTRLs and DBXs of each object and measure one EXEC in 64, from its coming to its answer: the clock
// costs as much as a call. The audit keeps the last CTRLs of each object: who, when, what, and how it ended. An entry is made
// when the request comes, so one that never ends is there, too.
//
// Objects in other processes keep their own books.
//
// Threads: the SORM's.
#pragma once

#include <memory>

#include "bus/request.h"
#include "bus/statistics.h"

namespace sorma {

// Adds what an object of this process has done.
void addFigures(Figures& sum, const Service& service);

std::unique_ptr<Observer> makeStatistics();
std::unique_ptr<Observer> makeAudit(Sorm& sorm);

}  // namespace sorma
