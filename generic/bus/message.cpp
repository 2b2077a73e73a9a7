#include "bus/message.h"

namespace sorma {

const char* toText(Method method) {
    switch (method) {
        case Method::exec: return "EXEC";
        case Method::ctrl: return "CTRL";
        case Method::dbx: break;
    }
    return "DBX";
}

bool fromText(std::string_view text, Method& out) {
    for (Method m : {Method::exec, Method::ctrl, Method::dbx}) {
        if (text != toText(m)) continue;
        out = m;
        return true;
    }
    return false;
}

}  // namespace sorma
