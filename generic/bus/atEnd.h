// atEnd.h -- does something when a block is left, also by an exception.
#pragma once

#include <utility>

namespace sorma {

template <class F> class AtEnd {
public:
    explicit AtEnd(F body) : body_(std::move(body)) {}
    ~AtEnd() { body_(); }
    AtEnd(const AtEnd&) = delete;
    AtEnd& operator=(const AtEnd&) = delete;

private:
    F body_;
};

}  // namespace sorma
