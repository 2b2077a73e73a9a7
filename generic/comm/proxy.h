// proxy.h -- stands for a service object of another process: every request goes there, every answer and every error
// comes back in the daemon's own words. DBX -connection adds what the proxy itself knows.
#pragma once

#include <deque>
#include <functional>
#include <memory>

#include "bus/service.h"
#include "comm/connection.h"

namespace sorma {

class Proxy : public Service {
public:
    // Which connection leads to it, when the dictionary's locations have changed since.
    struct Line {
        const std::uint64_t& changes;                           // as Sorm::locationChanges
        std::function<std::shared_ptr<Connection>()> find;      // null: none does; it may throw, too
    };
    // target: the object's name at the daemon. settings: of the SORM, looked at for each call.
    // relayFor: whose wish it is, when it is not the owner's: then the daemon is told that these are not our own requests.
    Proxy(std::string target, std::shared_ptr<Connection> connection, std::shared_ptr<const Settings> settings, Line line, PrincipalPointer relayFor);
    ~Proxy() override;

    void exec(Message& m) override;
    void ctrl(Message& m) override;
    void dbx(Message& m) override;
    void oneway(Method method, Message request) override;
    std::unique_ptr<Listening> listen(std::string pattern, std::size_t keep, Listener listener) override;
    std::vector<Pin> pins(std::string_view pin, std::size_t length) const override;
    std::string location() const override { return connection_->who(); }
    bool isElsewhere() const override { return true; }

    // Values that CTRL has set are gone with their daemon. The next call says so; or, with restore, they are set again.
    // A client's own recipe for the remote object: sent now, and again to each daemon that takes the old one's place.
    // later: before the first call that is begun, rather than now.
    void setRecipe(std::vector<std::string> words, bool later);

    Connection& connection() { return *connection_; }
    const std::string& target() const { return target_; }
    // Its daemon has never answered, and nobody has given it anything to keep: a name that was mistyped, perhaps.
    bool isNowhere() const { return connection_->boots() == 0 && wish_.empty() && !restore_; }
    static Class describe();

protected:
    void carry(const PendingPointer& pending, Method method) override;
    Deadline patience() const override { return Deadline::in(settings_.timeout); }

private:
    void forward(Method method, Message& m);
    // What the proxy itself answers, without a word to the daemon: DBX -connection, CTRL -restore BOOLEAN.
    bool answers(Method method, Message& m);
    void remember(std::vector<std::string> words);  // of a CTRL that was done
    void another();                                 // daemon than before has answered
    void restore(const std::string& options);       // as DBX -info options says them
    void send(Method method, std::vector<std::string> words, std::function<void(const std::string& text)> then, const char* why);
    std::string forwardWords(Method method, std::vector<std::string> words);
    void hear();
    void sayNotice(Message& m);
    // Before each call: a location that has changed has moved all names that lead through it, and this object among them.
    Connection& line() {
        if (line_.changes != seen_) [[unlikely]] follow();
        return *connection_;
    }
    void follow();

    std::string target_;
    std::shared_ptr<Connection> connection_;
    const std::shared_ptr<const Settings> shared_;
    const Settings& settings_ = *shared_;
    Line line_;
    std::uint64_t seen_;                    // of line_.changes
    const PrincipalPointer relayFor_;
    std::uint64_t restart_ = 0;
    bool restore_ = false;
    std::deque<std::vector<std::string>> set_;      // CTRL requests that this daemon has done, the oldest first
    std::string notice_;                            // to be said with the next answer
    std::vector<std::string> wish_;         // the recipe
    std::vector<std::string> recipe_;       // the same while it has not been sent
};

}  // namespace sorma
