// callee.h -- the far side of the floors for calls inside the process. It is a shared library of its own, so that the
// compiler cannot look through a call.
#pragma once

#include <memory>

#include "sorma.h"

namespace bench {

SORMA_EXPORT void plainFunction();

class SORMA_EXPORT Plain {
public:
    virtual ~Plain();
    virtual void call() = 0;
    virtual void copy(const double* in, double* out) = 0;       // ten numbers
    virtual void add(double* values, std::size_t n) = 0;        // to each one 1
};
SORMA_EXPORT std::unique_ptr<Plain> makePlain();

// A service class like most: its signature is checked, its EXEC works on the numbers in place.
SORMA_EXPORT sorma::Class describeAdder();

}  // namespace bench
