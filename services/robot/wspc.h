// wspc.h -- a guard as a service object; motions name it in their option -guards.
#pragma once

#include <string>
#include <vector>

#include <sorma.h>

#include "guard.h"

namespace robot {

class Wspc final : public sorma::Service {
public:
    static sorma::Class describe();
    void born() override { (void)guard(); }
    void changed(std::span<const sorma::Option* const>) override;
    void exec(sorma::Message& m) override;

    Guard guard() const;                    // fails with OPTION VALUE

private:
    double speed_ = Guard::kAny, force_ = Guard::kAny, moment_ = Guard::kAny;
    std::vector<double> inside_, outside_, pattern_, singular_{0, 0, 0};
    std::string frame_ = "tool";
    sorma::Reference arm_;
};

}  // namespace robot
