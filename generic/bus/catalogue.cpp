#include "bus/catalogue.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <new>
#include <tuple>

#include <fmt/args.h>
#include <fmt/format.h>

#include "bus/deadline.h"
#include "bus/kept.h"
#include "bus/requestText.h"

namespace sorma {

namespace {

struct Real {
    double value;
};

}  // namespace

}  // namespace sorma

// "{}" is the number as people read it, anything else {fmt}'s own.
template <> struct fmt::formatter<sorma::Real> : fmt::formatter<double> {
    bool plain = false;
    constexpr auto parse(fmt::format_parse_context& context) {
        plain = context.begin() == context.end() || *context.begin() == '}';
        return fmt::formatter<double>::parse(context);
    }
    auto format(const sorma::Real& number, fmt::format_context& context) const {
        if (!plain) return fmt::formatter<double>::format(number.value, context);
        return fmt::format_to(context.out(), "{}", sorma::plainNumber(number.value));
    }
};

namespace sorma {

namespace {

// Both are ready before any constructor runs and outlive every destructor: prototypes of other libraries come before
// and leave after anything of this file that would need either.
constinit std::mutex theMutex;
constinit Prototype* theFirst = nullptr;

const char* withoutFolders(const char* path) {
    const char* slash = std::strrchr(path, '/');
    return slash ? slash + 1 : path;
}

std::string toText(const MessageArg& arg) {
    switch (arg.kind) {
        case MessageArg::Kind::real: return numberText(arg.real);
        case MessageArg::Kind::integer: return std::to_string(arg.integer);
        case MessageArg::Kind::text: break;
    }
    return cutText(arg.text, kQuotedText);
}

const Prototype kFailed{Severity::error, "SERVICE FAILED", 1, "{}: {}"};
const Prototype kFailedSomewhere{Severity::error, "SERVICE FAILED", 0, "{}"};

Trail failure(std::string_view so, std::string_view what) {
    Trail trail;
    Entry e = so.empty() ? makeEntry(kFailedSomewhere, {MessageArg::of(what)})
                         : makeEntry(kFailed, {MessageArg::of(so), MessageArg::of(what)});
    e.so = so;
    trail.add(std::move(e));
    return trail;
}

}  // namespace

Prototype::Prototype(Severity severity, const char* symbol, int details, const char* text, Where where)
    : severity(severity), symbol(symbol), details(details), text(text), file(withoutFolders(where.file)),
      line(where.line) {
    std::lock_guard lock(theMutex);
    next_ = theFirst;
    if (theFirst) theFirst->previous_ = this;
    theFirst = this;
}

Prototype::~Prototype() {
    std::lock_guard lock(theMutex);
    (previous_ ? previous_->next_ : theFirst) = next_;
    if (next_) next_->previous_ = previous_;
}

std::vector<const Prototype*> catalogue() {
    std::vector<const Prototype*> all;
    std::lock_guard lock(theMutex);
    for (const Prototype* p = theFirst; p; p = p->next_) all.push_back(p);
    std::sort(all.begin(), all.end(), [](const Prototype* a, const Prototype* b) {
        return std::tuple(std::string_view(a->symbol), std::string_view(a->file), a->line) <
               std::tuple(std::string_view(b->symbol), std::string_view(b->file), b->line);
    });
    return all;
}

Entry makeEntry(const Raised& raised, std::initializer_list<MessageArg> args) {
    const Prototype& p = raised.prototype;
    Entry e;
    e.severity = p.severity;
    e.symbol = p.symbol;
    e.file = withoutFolders(raised.where.file);
    e.line = raised.where.line;
    e.time = wallNow();
    fmt::dynamic_format_arg_store<fmt::format_context> store;
    int index = 0;
    for (auto& arg : args) {
        std::string text = toText(arg);
        if (index++ < p.details) e.details.push_back(text);
        // Numbers as such, where the prototype says how to show them.
        if (arg.kind == MessageArg::Kind::real) store.push_back(Real{arg.real});
        else if (arg.kind == MessageArg::Kind::integer) store.push_back(arg.integer);
        else store.push_back(std::move(text));
    }
    try {
        e.text = fmt::vformat(p.text, store);
    } catch (const fmt::format_error&) {        // a slip in the prototype must not hide what happened
        e.text = p.text;
        for (auto& arg : args) e.text += ' ' + toText(arg);
    }
    return e;
}

const char* Error::what() const noexcept {
    const Entry* cause = trail.cause();
    return cause ? cause->text.c_str() : "unknown error";
}

std::vector<std::string> Error::code() const {
    const Entry* cause = trail.cause();
    if (!cause) return {};
    auto words = cause->code();
    if (cause->symbol != Entry::kForeign) words.erase(words.begin());
    return words;
}

bool Error::is(std::string_view symbol) const {
    const Entry* cause = trail.cause();
    return cause && cause->symbol == symbol;
}

Trail trailOfCurrentException(std::string_view so) {
    try {
        throw;
    } catch (const Error& e) {
        Trail trail = e.trail;
        for (auto& entry : trail.entries())
            if (entry.so.empty() && entry.daemon.empty()) entry.so = so;
        return trail;
    } catch (const std::bad_alloc&) {
        return failure(so, "out of memory");
    } catch (const std::exception& e) {
        return failure(so, e.what());
    } catch (...) {
        return failure(so, "an exception of unknown type");
    }
}

}  // namespace sorma
