// fresh.h -- the newest record of a buffer, as long as somebody renews it; else zeros: a unit for circuits.
//
// For forces and hand controllers: what is not renewed must not go on moving the arm.
#pragma once

#include <string>
#include <vector>

#include <sorma.h>

#include "tap.h"

namespace robot {

class Fresh final : public sorma::Service {
public:
    static sorma::Class describe();
    void born() override;
    void exec(sorma::Message& m) override;
    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override;
    void dumpState(std::string& out) const override;

private:
    void watch();
    std::string key() const;

    std::string key_, problem_;
    std::int64_t floats_ = 7;
    double expiry_ = 0.1;
    Tap tap_{7, 7};
    std::vector<double> record_;
    std::uint64_t renewed_ = 0, expired_ = 0, damaged_ = 0;     // ticks
    sorma::Timer timer_;
};

}  // namespace robot
