// proxy.h -- stands for a service object of another process: every request goes there, every answer and every error
// comes back in the daemon's own words. DBX -connection adds what the proxy itself knows.
#pragma once

#include <memory>

#include "bus/service.h"
#include "comm/connection.h"

namespace sorma {

class Proxy : public Service {
public:
    // target: the object's name at the daemon. settings: of the SORM, looked at for each call.
    Proxy(std::string target, std::shared_ptr<Connection> connection, const Settings& settings);
    ~Proxy() override;

    void exec(Message& m) override;
    void ctrl(Message& m) override;
    void dbx(Message& m) override;
    void oneway(Method method, Message request) override;
    std::unique_ptr<Listening> listen(std::string pattern, std::size_t keep, Listener listener) override;
    std::vector<Pin> pins(std::string_view pin, std::size_t length) const override;
    std::string location() const override { return connection_->who(); }

    // A client's own recipe for the remote object: sent now, and again to each daemon that takes the old one's place.
    // later: before the first call that is begun, rather than now.
    void setRecipe(std::vector<std::string> words, bool later);

    Connection& connection() { return *connection_; }
    const std::string& target() const { return target_; }
    static Class describe();

protected:
    void carry(const PendingPointer& pending, Method method) override;
    Deadline patience() const override { return Deadline::in(settings_.timeout); }

private:
    void forward(Method method, Message& m);

    std::string target_;
    std::shared_ptr<Connection> connection_;
    const Settings& settings_;
    std::uint64_t restart_ = 0;
    std::vector<std::string> recipe_;       // not sent yet
};

}  // namespace sorma
