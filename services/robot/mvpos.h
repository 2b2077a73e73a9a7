// mvpos.h -- position-controlled motions.
#pragma once

#include "mover.h"

namespace robot {

class Mvpos final : public Mover {
public:
    static sorma::Class describe();
    void born() override;
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;

private:
    std::size_t width() const;              // floats of a position
    void tellDry(sorma::Message& m, const std::vector<double>& given);
    Job::Plan plan(const Now& now, const std::vector<double>& given, bool follows);
    std::vector<PathMotion::Leg> legs(const Now& now, const std::vector<double>& given);
    Knot knot(const double* floats, const Now& now, const Knot& after);
    Knot taught(const std::string& who, const Now& now);
    void teach(sorma::Args args, sorma::Message& m);

    std::string as_ = "joints", move_ = "joints", relativeTo_ = "world";
    sorma::Named<sorma::Kind::segment> increments_;
    std::vector<double> target_;
    double jointSpeed_ = 0.8, jointAcceleration_ = 2, blend_ = 0;
    bool dry_ = false;
};

}  // namespace robot
