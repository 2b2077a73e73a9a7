#include "bus/listText.h"

namespace sorma {

void appendListElement(std::string& list, std::string_view element) {
    if (!list.empty()) list += ' ';
    if (element.empty()) {
        list += "{}";
        return;
    }
    bool special = false, bracesWork = true;
    int depth = 0;
    for (char c : element) {
        switch (c) {
            case '{': ++depth; special = true; break;
            case '}': if (--depth < 0) bracesWork = false; special = true; break;
            case '\\': bracesWork = false; special = true; break;     // a backslash before a newline or brace differs inside braces
            case ' ': case '\t': case '\n': case '\r': case '\v': case '\f':
            case '"': case '[': case ']': case '$': case ';': case '#': special = true; break;
            default: break;
        }
    }
    if (!special) {
        list += element;
    } else if (bracesWork && depth == 0) {
        list += '{';
        list += element;
        list += '}';
    } else {
        for (char c : element) {
            switch (c) {
                case '\n': list += "\\n"; continue;
                case '\t': list += "\\t"; continue;
                case '\r': list += "\\r"; continue;
                case '\v': list += "\\v"; continue;
                case '\f': list += "\\f"; continue;
                case '{': case '}': case '\\': case ' ': case '"': case '[': case ']': case '$': case ';': case '#':
                    list += '\\';
                    break;
                default: break;
            }
            list += c;
        }
    }
}

}  // namespace sorma
