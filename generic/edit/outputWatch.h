// outputWatch.h -- calls back before something is written to a channel.
//
// It is stacked upon standard output and standard error while a line may be edited, since scripts that write there know
// nothing of the line.
//
// Threads: the interpreter's.
#pragma once

#include <functional>

#include "tcl/tclShim.h"

namespace sorma::edit {

class OutputWatch {
public:
    // Stacks itself upon the channel; does nothing when there is none. before: called before each piece of output, with its
    // bytes; it must not write to the channel.
    OutputWatch(Tcl_Interp* interp, int standardChannel, std::function<void(const char* bytes, int size)> before);
    ~OutputWatch();
    OutputWatch(const OutputWatch&) = delete;
    OutputWatch& operator=(const OutputWatch&) = delete;

private:
    struct Driver;                      // deleted with Tcl's channel, which may be before or after this
    Tcl_Interp* interp_;
    Driver* driver_ = nullptr;
};

}  // namespace sorma::edit
