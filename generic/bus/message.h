// message.h -- a request or a reply of a service object.
//
// There is one structure for both: EXEC reads the request in it and writes the reply into it. Clearing keeps the memory, so
// a message that is used again does not allocate.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bus/catalogue.h"
#include "bus/principal.h"
#include "bus/trail.h"

namespace sorma {

class Pending;

enum class Method : std::uint8_t { exec, ctrl, dbx };
const char* toText(Method method);                      // "EXEC", "CTRL", "DBX"
bool fromText(std::string_view text, Method& out);      // upper case only

class Message {
public:
    std::string text;                   // UTF-8
    std::vector<double> floats;
    std::vector<std::int64_t> ints;
    std::vector<unsigned char> any;     // bytes of any kind
    std::vector<std::string> words;     // words of CTRL and DBX; of EXEC those beyond the four parts above
    int code = 0;                       // 0: done; < 0: failed; > 0: done, with warnings or a result number of the class
    Trail trail;
    // The author, who must have the right to all that its words ask for; null: the owner of this process. Messages that a
    // program makes itself have null. EXEC gets null, too, unless the class acts on words (Class::actsOnWords): the code of
    // a class acts as the owner. Not part of the content.
    PrincipalPointer author;
    std::shared_ptr<Pending> later;     // set by a service that answers later (bus/reply.h); not part of the content

    // Empty every part but the trail: warnings that came before the result stay. The memory stays, too.
    void clear() {
        text.clear();
        floats.clear();
        ints.clear();
        any.clear();
        words.clear();
        code = 0;
        if (author || later) [[unlikely]] forget();
    }
    // Empty the trail as well, for another request.
    void reset() {
        clear();
        trail.clear();
    }

    void swap(Message& other) noexcept {        // std::swap would need a third message
        text.swap(other.text);
        floats.swap(other.floats);
        ints.swap(other.ints);
        any.swap(other.any);
        words.swap(other.words);
        std::swap(code, other.code);
        trail.swap(other.trail);
        author.swap(other.author);
        later.swap(other.later);
    }

    void forget();                      // clears author and later. Not inline, since few messages have them

    // Add an entry to the trail; the call continues.
    template <class... Args> void warn(Raised raised, const Args&... args) {
        trail.add(makeEntry(raised, {MessageArg::of(args)...}));
    }

    bool operator==(const Message& o) const {
        return text == o.text && floats == o.floats && ints == o.ints && any == o.any && words == o.words && code == o.code &&
               trail == o.trail;
    }
};

}  // namespace sorma
