#include "comm/ownership.h"

#include <algorithm>

#include "bus/catalogue.h"
#include "bus/glob.h"

namespace sorma {

namespace {

const Prototype kNotOwner{Severity::error, "DIRECTORY NOT_OWNER", 1,
    "{}: {} does not own the name {} now: {}; {}; the request was not executed"};
const Prototype kStale{Severity::error, "DIRECTORY STALE", 1,
    "{}: the request is for epoch {} of the name {}, and its owner {} has epoch {}; the request was not executed; ask again"};

std::string reason(const Directory::Claim& claim) {
    switch (claim.state) {
        case Directory::Claim::State::none: return "it does not claim it";
        case Directory::Claim::State::taken: return "somebody else has it";
        default: return claim.why;
    }
}

}  // namespace

Ownership::Ownership(std::shared_ptr<Directory> directory, Directory::Entry self, std::vector<std::string> patterns)
    : directory_(std::move(directory)), self_(std::move(self)), patterns_(std::move(patterns)) {}

bool Ownership::covers(std::string_view object) const {
    return std::any_of(patterns_.begin(), patterns_.end(), [&](auto& pattern) { return globMatch(pattern, object); });
}

Ownership::Owner Ownership::owner() const {
    const Directory::Found found = directory_->find(self_.name);
    if (found.state != Directory::Found::State::known) return {false, "nobody is known to own it"};
    if (found.entry.identity == self_.identity) return {false, "its next owner is not known yet"};
    return {true, "its owner is " + found.entry.identity};
}

void Ownership::need(std::string_view object, std::int64_t epoch, bool trusted, bool& elsewhere) {
    const Directory::Claim claim = directory_->claimed(self_.name);
    if (claim.state != Directory::Claim::State::owned) {
        const Owner other = owner();
        elsewhere = other.known || epoch > last_;
        fail(kNotOwner, object, self_.identity, self_.name, reason(claim), other.text);
    }
    last_ = claim.epoch;
    if (epoch > claim.epoch) {
        if (trusted) doubted_ = bootNow();
        elsewhere = true;
        fail(kNotOwner, object, self_.identity, self_.name, "it has epoch " + std::to_string(claim.epoch) + " of it", "the caller knows an owner with epoch " + std::to_string(epoch));
    }
    // Renewed later than that: then it is ours.
    if (doubted_ != 0 && claim.asked <= doubted_)
        fail(kNotOwner, object, self_.identity, self_.name, "a caller knew a later owner than epoch " + std::to_string(claim.epoch), "the directory has not said yet who it is");
    doubted_ = 0;
    if (epoch != 0 && epoch < claim.epoch) {
        elsewhere = true;
        fail(kStale, object, epoch, self_.name, self_.identity, claim.epoch);
    }
}

}  // namespace sorma
