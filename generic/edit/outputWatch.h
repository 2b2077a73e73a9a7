// outputWatch.h -- says when something is about to be written to a channel.
//
// Stacked upon standard output and error while a person may be typing: whoever writes there from a callback does not
// know that a line is being edited.
#pragma once

#include <functional>

#include "tcl/tclShim.h"

namespace sorma::edit {

class OutputWatch {
public:
    // Stacks itself upon the channel; nothing when there is none. before: called before each piece of output, with the
    // bytes; must not write to the channel.
    OutputWatch(Tcl_Interp* interp, int standardChannel, std::function<void(const char* bytes, int size)> before);
    ~OutputWatch();
    OutputWatch(const OutputWatch&) = delete;
    OutputWatch& operator=(const OutputWatch&) = delete;

private:
    struct Driver;                      // lives as long as Tcl's channel, which may end before or after us
    Tcl_Interp* interp_;
    Driver* driver_ = nullptr;
};

}  // namespace sorma::edit
