// proxy.h -- stands for a service object of another process.
//
// Every request goes to the daemon, and the answer comes back unchanged, also when it is an error. Only two requests are
// answered here: DBX -connection and CTRL -restore. And when this process has the same class, the proxy refuses wrong words and
// arguments itself, as the daemon would (bus/ahead.h).
//
// When another daemon takes the place of the one before, the values that CTRL had set are lost. The proxy then says so with
// the next answer, as a warning; or it sets them again, when CTRL -restore 1 has asked for it. Either way this is settled
// before any request reaches the new daemon, whichever way it goes there: see Connection::restore.
//
// Threads:  belongs to the thread of its SORM.
// Blocking: exec, ctrl, dbx, listen and pins block until the daemon answers, for at most Settings::timeout or the deadline
//           of the request that is being executed. For carry and oneway see Connection::begin and Connection::oneway.
// Errors:   as Connection::call.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <memory>

#include "bus/network.h"
#include "bus/service.h"
#include "comm/connection.h"

namespace sorma {

class Proxy : public Service {
public:
    // Finds the connection again after the dictionary's locations have changed.
    struct Line {
        const std::uint64_t& changes;                           // counts the changes, see Sorm::locationChanges
        std::function<std::shared_ptr<Connection>()> find;      // returns null when there is none; may throw Error
    };
    // target: the object's name at the daemon.   settings: read at each call. relayFor: who asked for this proxy, when it
    // was not the owner of this process; null: the owner. The daemon is told that such requests are relayed, and does not
    // give them the owner's rights.
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
    bool holdsSecrets() const override { return secrets_ != Secrets::none; }
    // Has the object secret options? later: it is asked before the next request. untold: it does not tell us. In the last two
    // cases Sorm::awaitSecrets has its name.
    enum class Secrets : std::uint8_t { none, some, later, untold };
    void setSecrets(Secrets secrets);
    // What the daemon says of the object for bus/ahead.h.   doubts: Connection::doubts when it was asked.
    void setFacts(std::vector<std::int64_t> facts, std::uint64_t doubts);

    // The client's own recipe for the remote object: it is sent as a CTRL, and again to each daemon that takes the place of
    // the one before.   words: as for CTRL, perhaps with -restore BOOLEAN first.   probe: now blocks and throws as ctrl does;
    // later sends it before the next request, whose answer says what the daemon refuses.
    void setRecipe(std::vector<std::string> words, Probe probe);

    Connection& connection() { return *connection_; }
    const std::string& target() const { return target_; }
    // True while its daemon has never answered and the proxy has neither a recipe nor -restore. Its name may be mistyped.
    bool isNowhere() const { return connection_->boots() == 0 && recipe_.empty() && !restore_; }
    static Class describe();

protected:
    void carry(const PendingPointer& pending, Method method) override;
    Deadline patience() const override { return Deadline::in(settings_.timeout); }

private:
    void forward(Method method, Message& m);        // send it, blocking; m becomes the reply
    // Answer it here if it is DBX -connection or CTRL -restore BOOLEAN. False: it is for the daemon.
    bool answers(Method method, Message& m);
    void remember(std::vector<std::string> words);  // words of a CTRL that was done, or sent one-way
    // Have the daemon told what the one before knew.   here: it is that daemon's successor; else another place.
    void restore(bool here);
    void learnSecrets();                            // ask, and go on: what is sent next does not wait for the answer
    // Refuse the request here if the daemon would, and this is certain. m stays as it is.
    void check(Method method, const Message& m) {
        if (facts_) checkByFacts(method, m);
    }
    void checkByFacts(Method method, const Message& m);
    void mark(Trail& trail, Method method, const Message& m) const;
    bool certain() const { return facts_->doubts == connection_->doubts() && connection_->connected(); }       // do the facts hold?
    void askFacts();
    void restoreValues(const std::string& options); // options: the answer to DBX -info options
    void restoreValue(std::size_t count, std::vector<std::string> words);     // count: options in words
    // A request that goes before all others. A failure is said with the next answer of this proxy, after the word what.
    void send(Method method, std::vector<std::string> words, std::string what, std::function<void(const Message&)> then = nullptr);
    void notice(const std::string& text);           // for the next answer
    bool noticed() const { return !notice_.empty() || !connection_->remarks().empty(); }
    void sayNotice(Message& m);                     // add notice_ to the reply, as a warning, and what the connection remarks
    void listenForRestart();                        // have restore() called
    // The connection to use. Looks first whether the dictionary's locations have changed, and what it has to be told.
    Connection& line() {
        if (line_.changes != seen_) [[unlikely]] follow();
        if (untold_) [[unlikely]] restore(false);
        if (secrets_ == Secrets::later) [[unlikely]] learnSecrets();
        return *connection_;
    }
    void follow();

    std::string target_;
    std::shared_ptr<Connection> connection_;
    const std::shared_ptr<const Settings> shared_;
    const Settings& settings_ = *shared_;
    Line line_;
    std::uint64_t seen_;                    // line_.changes when connection_ was found
    const PrincipalPointer relayFor_;
    std::uint64_t restart_ = 0;             // number from Connection::onRestart, 0: none
    bool restore_ = false;
    Secrets secrets_ = Secrets::none;
    struct Facts {
        std::vector<std::int64_t> numbers;          // empty: not told
        std::uint64_t doubts;                       // Connection::doubts when they were asked for
    };
    static constexpr std::uint64_t kUnasked = UINT64_MAX;
    std::shared_ptr<Facts> facts_;                  // null: the daemon has told none at first, and is not asked again
    std::shared_ptr<const Class> known_;            // the class here to which they fit; null: there is none
    std::uint64_t classes_ = 0;                     // Sorm::classChanges when it was looked for
    bool untold_ = false;                           // restore() has to be called before the next request
    std::deque<std::vector<std::string>> set_;      // CTRL requests that this daemon has done, the oldest first; 100 at most
    std::string notice_;                            // warning for the next answer
    std::vector<std::string> recipe_;
};

}  // namespace sorma
