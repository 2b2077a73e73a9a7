#include "bus/fence.h"

#include <algorithm>

#include "bus/client.h"
#include "bus/sorm.h"

namespace sorma {

namespace {

std::uint64_t newSerial() {
    static std::atomic<std::uint64_t> last{0};
    return ++last;
}

}  // namespace

Fence::Fence() : serial(newSerial()) {}

void Fences::add(Fence* fence) {
    list_.push_back(fence);
    sorm_.markFenced();
}

void Fences::remove(Fence* fence) {
    std::erase(list_, fence);
    sorm_.markFenced();
}

bool Fences::cover(std::string_view object) const {
    return std::any_of(list_.begin(), list_.end(), [&](auto* fence) { return fence->covers(object); });
}

void Fences::need(std::string_view object, const PrincipalPointer& author) const {
    if (list_.empty() || RealtimeOwner::current()) return;
    CallContext* context = CallContext::current();
    if (!author && !(context && context->client)) return;           // this process itself
    const PrincipalPointer& who = author ? author : context->client->principal;
    const bool trusted = !who || (sorm_.access.rights(who, object) & Rights(Right::call));
    for (std::size_t i = 0; i < list_.size(); ++i) {
        if (!list_[i]->covers(object)) continue;
        bool elsewhere = false;
        try {
            list_[i]->need(object, context && context->heard.fence == list_[i]->serial ? context->heard.epoch : 0, trusted, elsewhere);
        } catch (...) {
            if (context && elsewhere) context->elsewhere = true;
            throw;
        }
    }
}

}  // namespace sorma
