// figuresText.h -- the figures of a process in the text format of Prometheus.
//
// The number of series has a limit. The first 64 classes and 32 cycles that are seen have series of their own for ever. All others
// together are "other".
#pragma once

#include <set>
#include <string>

#include <sorma.h>

namespace metrics {

class Labels {
public:
    explicit Labels(std::size_t most) : most_(most) {}
    // The label's value for a name: itself, escaped, or "other".
    std::string of(const std::string& name);

private:
    const std::size_t most_;
    std::set<std::string> known_;
};

class FiguresText {
public:
    std::string make(sorma::Sorm& sorm);

private:
    bool classes(std::string& out, sorma::Sorm& sorm);      // are there cycles?
    void cycles(std::string& out, sorma::Sorm& sorm);
    Labels classes_{64}, cycles_{32};
};

}  // namespace metrics
