#include "json.h"

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "bus/requestText.h"

namespace etcd {

Json Json::parse(std::string_view text) {
    auto all = std::make_shared<const nlohmann::json>(nlohmann::json::parse(text, nullptr, false));
    Json out;
    if (all->is_discarded()) return out;
    out.at_ = all.get();
    out.all_ = std::move(all);
    return out;
}

Json Json::operator[](std::string_view name) const {
    Json out;
    if (!at_ || !at_->is_object()) return out;
    const auto found = at_->find(name);
    if (found == at_->end()) return out;
    out.all_ = all_;
    out.at_ = &*found;
    return out;
}

std::vector<Json> Json::items() const {
    std::vector<Json> out;
    if (!at_ || !at_->is_array()) return out;
    for (auto& item : *at_) {
        out.emplace_back().all_ = all_;
        out.back().at_ = &item;
    }
    return out;
}

std::string Json::text() const {
    if (!at_) return {};
    if (at_->is_string()) return at_->get<std::string>();
    return at_->is_number() || (at_->is_boolean() && at_->get<bool>()) ? at_->dump() : std::string();
}

std::int64_t Json::number() const { return std::strtoll(text().c_str(), nullptr, 10); }

bool Json::empty() const { return !at_ || (at_->is_structured() ? at_->empty() : text().empty()); }

std::string quoted(std::string_view text) { return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace); }

std::string base64(std::string_view bytes) {
    std::string out = "\"";
    sorma::appendBase64(out, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    return out + '"';
}

std::string plain(const std::string& base64) {
    std::vector<unsigned char> bytes;
    if (!sorma::parseBase64(base64, bytes)) return {};
    return {bytes.begin(), bytes.end()};
}

}  // namespace etcd
