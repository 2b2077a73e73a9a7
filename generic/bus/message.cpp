#include "bus/message.h"

namespace sorma {

void Message::forget() {
    author.reset();
    later.reset();
}

const char* toText(Method method) {
    switch (method) {
        case Method::exec: return "EXEC";
        case Method::ctrl: return "CTRL";
        case Method::dbx: break;
    }
    return "DBX";
}

bool fromText(std::string_view text, Method& out) {
    if (text == "EXEC") out = Method::exec;
    else if (text == "CTRL") out = Method::ctrl;
    else if (text == "DBX") out = Method::dbx;
    else return false;
    return true;
}

}  // namespace sorma
