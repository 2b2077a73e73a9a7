// named.h -- the value of an option or word that names a file, a folder, a segment of shared memory or a program.
//
// The author of such a value needs a right to what it names. This is asked when the value is set and, by Named, when it is used.
// The text of a Named comes out only for a Permit. So a class that forgets to ask does not compile.
//
//     class Picture : public sorma::Service {
//         static sorma::Class describe() { return ... .named("-file", &Picture::file_, {.help = "the picture"}) ... }
//         void exec(Message& m) override { read(file_.use(*this)); }
//         sorma::Named<sorma::Kind::file> file_;
//     };
//
// Threads: the SORM's.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "bus/access.h"
#include "bus/catalogue.h"
#include "bus/principal.h"

namespace sorma {

class Service;

// The meaning of a text or number. For the last five its author needs a right.
//     colour     string such as #ff8000
//     time       int or double, seconds since 1970
//     file       string   files, for its real path
//     folder     string   files, for its real path
//     segment    string, a key of shared memory, or the beginning of many   files, for /dev/shm/KEY
//     program    string, to run   program, for the object
//     address    string, where a device is: tcp:HOST:PORT, serial:PATH,...   files, for that, or for the real path
enum class Kind : std::uint8_t { plain, file, colour, time, folder, segment, program, address };
const char* toText(Kind kind);                  // "" "file" "colour" "time" "folder" "segment" "program" "address"
bool fromText(std::string_view text, Kind& out);

// The right that the author of such a value needs, and for what. None for most.
struct KindRight {
    Right right;
    std::string subject;
};
std::optional<KindRight> rightOf(Kind kind, const std::string& value, const std::string& object);
constexpr bool carriesRight(Kind kind) { return kind == Kind::file || kind >= Kind::folder; }

// Ask for that right, for an object. Fails with COMM DENIED.
Permit needKind(const Service& user, const PrincipalPointer& author, Kind kind, const std::string& value);
// Is it the permit that needKind gives for this value? Else fails with POLICY PERMIT.
void checkKind(const Permit& permit, Kind kind, const std::string& value);

template <Kind kind> class Named {
    static_assert(carriesRight(kind));

public:
    Named() = default;
    // author: who wrote it; null: the owner, or the class itself.
    Named(std::string text, PrincipalPointer author = nullptr) : text_(std::move(text)), author_(std::move(author)) {}
    Named(const char* text) : text_(text) {}

    bool empty() const { return text_.empty(); }
    // The object of that name, for one that is about to use it. Fails with COMM DENIED when the author has no right to that.
    const std::string& use(const Service& user) const { return get(permit(user)); }
    Permit permit(const Service& user) const { return needKind(user, author_, kind, text_); }
    // permit: of permit(); for messages and comparisons, which reach nothing, Permit::owner().
    const std::string& get(const Permit& permit) const {
        checkKind(permit, kind, text_);
        return text_;
    }

private:
    std::string text_;
    PrincipalPointer author_;
};

}  // namespace sorma
