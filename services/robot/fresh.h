// fresh.h -- a unit for circuits: the newest record of a buffer while it is renewed, else zeros.
//
// For forces and hand controllers: when they are not renewed, they must not move the arm any more.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <sorma.h>

#include "bus/incident.h"

#include "bufferInput.h"

namespace robot {

class Fresh final : public sorma::Service, public sorma::HasIncidents {
public:
    static sorma::Class describe();
    void born() override;
    void exec(sorma::Message& m) override;
    std::vector<sorma::Pin> pins(std::string_view, std::size_t) const override;
    void dumpState(std::string& out) const override;
    void tellIncidents(sorma::Incidents& out) const override;

private:
    enum State { none, renewed, expired, damaged };
    void watch();
    bool old(const shmem::Stamp& stamp);
    State read();
    using Key = sorma::Named<sorma::Kind::segment>;
    Key key() const;

    Key key_;
    std::int64_t floats_ = 7;
    double expiry_ = 0.1;
    BufferInput tap_{7, 7};
    std::vector<double> record_;
    std::uint64_t counter_ = 0;             // of the newest record; 0: none since the buffer was found
    std::int64_t since_ = 0;                // [ns] the tick that saw it first
    State state_ = none;
    std::array<std::uint64_t, 4> ticks_{};  // by state
    sorma::Tally expiries_, damages_;       // how often these states began
    sorma::Timer timer_;
};

}  // namespace robot
