#include "edit/outputWatch.h"

#include <cerrno>

namespace sorma::edit {

struct OutputWatch::Driver {
    OutputWatch* owner;                // null: it has ended
    std::function<void(const char*, int)> before;
    Tcl_Channel channel = nullptr;

    static Tcl_Channel below(ClientData data) { return Tcl_GetStackedChannel(static_cast<Driver*>(data)->channel); }

    static int close(ClientData data, Tcl_Interp*, int flags) {
        if ((flags & (TCL_CLOSE_READ | TCL_CLOSE_WRITE)) != 0) return EINVAL;
        auto* d = static_cast<Driver*>(data);
        if (d->owner) d->owner->driver_ = nullptr;
        delete d;
        return 0;
    }
    static int input(ClientData, char*, int, int* error) {
        *error = EINVAL;
        return -1;
    }
    static int output(ClientData data, const char* bytes, int size, int* error) {
        auto* d = static_cast<Driver*>(data);
        if (d->owner) d->before(bytes, size);
        auto written = int(Tcl_WriteRaw(below(data), bytes, size));
        if (written < 0) *error = Tcl_GetErrno();
        return written;
    }
    static void watch(ClientData data, int mask) {
        Tcl_Channel b = below(data);
        Tcl_ChannelWatchProc(Tcl_GetChannelType(b))(Tcl_GetChannelInstanceData(b), mask);
    }
    static int handle(ClientData data, int direction, ClientData* result) {
        return Tcl_GetChannelHandle(below(data), direction, result);
    }
    static int option(ClientData data, Tcl_Interp* interp, const char* name, Tcl_DString* value) {
        Tcl_Channel b = below(data);
        auto* get = Tcl_ChannelGetOptionProc(Tcl_GetChannelType(b));
        if (get) return get(Tcl_GetChannelInstanceData(b), interp, name, value);
        return name ? Tcl_BadChannelOption(interp, name, "") : TCL_OK;
    }
    static int setOption(ClientData data, Tcl_Interp* interp, const char* name, const char* value) {
        Tcl_Channel b = below(data);
        auto* set = Tcl_ChannelSetOptionProc(Tcl_GetChannelType(b));
        if (set) return set(Tcl_GetChannelInstanceData(b), interp, name, value);
        return Tcl_BadChannelOption(interp, name, "");
    }
    static const Tcl_ChannelType type;
};

const Tcl_ChannelType OutputWatch::Driver::type{
    "outputWatch", TCL_CHANNEL_VERSION_5, TCL_CLOSE2PROC, input, output, nullptr, setOption, option, watch, handle,
    close, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr};

OutputWatch::OutputWatch(Tcl_Interp* interp, int standard, std::function<void(const char*, int)> before) : interp_(interp) {
    Tcl_Channel channel = Tcl_GetStdChannel(standard);
    if (!channel) return;
    Tcl_Flush(channel);
    auto* d = new Driver{this, std::move(before)};
    d->channel = Tcl_StackChannel(interp, &Driver::type, d, TCL_WRITABLE, channel);
    if (d->channel) driver_ = d;
    else delete d;
}

OutputWatch::~OutputWatch() {
    if (!driver_) return;
    driver_->owner = nullptr;
    if (!Tcl_InterpDeleted(interp_)) Tcl_UnstackChannel(interp_, driver_->channel);
}

}  // namespace sorma::edit
