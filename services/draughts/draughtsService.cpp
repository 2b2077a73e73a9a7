// draughts -- the game as a service object: legal moves and their paths, what a camera saw, draws, records, and a player.
//
//     draughts.a EXEC legal                       -> TMSG {31-26 31-27 ...}
//     draughts.a EXEC play 32-28                  -> TMSG 32-28 IMSG 3 2 32 28
//     draughts.a EXEC go                          -> its own move, at -level
//     draughts.a EXEC analyse depth 20            -> the best line; publishes progress meanwhile; ends when it is cancelled
//
// Threads: a search has one of its own, which knows copies alone; what it tells comes through the SORM's mailbox.
#include <sorma.h>

#include <charconv>
#include <system_error>
#include <thread>

#include "draughts/camera.h"
#include "draughts/endgames.h"
#include "draughts/game.h"
#include "draughts/level.h"

namespace {

using draughts::Game;
using draughts::Move;
using draughts::Progress;
using sorma::Message;
using sorma::Prototype;
using sorma::Severity;

const Prototype kWord{Severity::error, "DRAUGHTS WORD", 2,
                      "{}: bad word \"{}\": must be analyse, explain, fen, go, legal, new, path, pdn, picture, play, state, or undo"};
const Prototype kUsage{Severity::error, "DRAUGHTS SYNTAX", 1, "{}: wrong words: should be \"{}\""};
const Prototype kMove{Severity::error, "DRAUGHTS MOVE", 1, "{}: {}"};
const Prototype kAmbiguous{Severity::error, "DRAUGHTS AMBIGUOUS", 1, "{}: {}"};
const Prototype kFen{Severity::error, "DRAUGHTS FEN", 1, "{}: {}"};
const Prototype kPdn{Severity::error, "DRAUGHTS PDN", 1, "{}: {}"};
const Prototype kSight{Severity::error, "DRAUGHTS SIGHT", 1, "{}: {}"};
const Prototype kBusy{Severity::error, "DRAUGHTS BUSY", 1, "{}: a search is under way: wait for it, or cancel it"};
const Prototype kOver{Severity::error, "DRAUGHTS OVER", 1, "{}: the game is over, {}: {}"};
const Prototype kChanged{Severity::error, "DRAUGHTS CHANGED", 1, "{}: the position has changed during the search; its move was {}"};
const Prototype kUndo{Severity::error, "DRAUGHTS UNDO", 1, "{}: {} moves have been played, {} cannot be taken back"};
const Prototype kGone{Severity::error, "SERVICE GONE", 1, "{}: the service object has been removed"};
const Prototype kNote{Severity::warning, "DRAUGHTS NOTE", 1, "{}: {}"};
const Prototype kColours{Severity::error, "OPTION VALUE", 2, "{}: {} \"{}\" must be two different characters, White's and Black's, neither . nor ?"};

class Draughts : public sorma::Service {
public:
    static sorma::Class describe() {
        using enum sorma::Field;
        return sorma::Class::of<Draughts>("draughts", "plays draughts: rules, records, and an engine")
            .choice("-variant", &Draughts::variant_, {"intl", "braz", "engl"},
                    {.help = "international 10x10, Brazilian 8x8, English 8x8; another one begins a new game"})
            .integer("-level", &Draughts::level_, {.low = 1, .high = draughts::kFullLevel, .help = "of go: 1 a child, 10 full strength"})
            .integer("-seed", &Draughts::seed_, {.low = 0, .high = 1e9, .help = "variety of openings; 0: always the same move"})
            .real("-time", &Draughts::time_, {.unit = "s", .low = 0.001, .high = 86400, .help = "for a move at most"})
            .integer("-depth", &Draughts::depth_, {.low = 0, .high = 99, .help = "limit in moves of both sides; 0: none"})
            .integer("-nodes", &Draughts::nodes_, {.low = 0, .help = "limit in positions; 0: none"})
            .integer("-threads", &Draughts::threads_, {.low = 1, .high = 64, .help = "of a search"})
            .integer("-hash", &Draughts::hash_, {.unit = "MB", .low = 1, .high = 65536, .help = "memory of a search"})
            .flag("-endgames", &Draughts::useEndgames_, {.help = "8x8: use tables for four pieces; made at first use"})
            .named("-endgamesFile", &Draughts::endgamesFile_, {.help = "where they are kept; empty: in the user's cache folder", .fixed = true})
            .flag("-idle", &Draughts::idle_, {.help = "search at idle priority"})
            .text("-colours", &Draughts::colours_, {.help = "characters of White's and Black's pieces in what a camera saw"})
            .action("-stop", &Draughts::stopAction, "", "end the search with what it has found", 0, 0, sorma::Right::call)
            .concurrency(sorma::Concurrency::concurrent)
            .words("legal | play move | path move | undo ?moves? | state | go | analyse ?time s? ?depth n? ?nodes n? | explain | "
                   "fen ?position? | pdn | picture | new")
            .reads(text, {}, "", "play, path: the move; explain: the board as seen; fen: the position; pdn: the game")
            .writes(text, {}, "", "what was asked for")
            .writes(ints, {}, "", "play, path, go: n, n squares on which the piece stops, squares of the victims; analyse: depth, nodes")
            .writes(floats, {}, "", "go, analyse: score for the side to move [men], time [s]")
            .repeatable({"legal", "state"})
            .example("draughts EXEC legal");
    }

    ~Draughts() override {
        endSearch();
        dropTable();
    }

    void changed(std::span<const sorma::Option* const> options) override {
        for (auto* o : options) {
            if (o->name == "-colours") checkColours();
            if (o->name == "-variant" && variant_ != game_.rules().name) {
                if (job_) fail(kBusy, name());
                begin();
            }
            if (o->name == "-hash" && job_) fail(kBusy, name());
            if (o->name == "-hash") dropTable();
        }
    }
    void born() override {
        checkColours();
        begin();
    }
    void removing() override {
        if (job_) {
            auto reply = job_->reply;
            endSearch();
            reply.fail(sorma::Error(sorma::makeEntry(kGone, {sorma::MessageArg::of(name())})));
        }
        dropTable();
    }

    void exec(Message& m) override {
        std::string word = m.words.empty() ? "" : m.words[0];
        using Body = void (Draughts::*)(Message&);
        static const std::pair<const char*, Body> kWords[] = {
            {"analyse", &Draughts::analyse}, {"explain", &Draughts::explain}, {"fen", &Draughts::fen},   {"go", &Draughts::go},
            {"legal", &Draughts::legal},     {"new", &Draughts::fresh},       {"path", &Draughts::path}, {"pdn", &Draughts::pdn},
            {"picture", &Draughts::picture}, {"play", &Draughts::play},       {"state", &Draughts::state}, {"undo", &Draughts::undo}};
        for (auto& [name, body] : kWords) {
            if (word != name) continue;
            try {
                return (this->*body)(m);
            } catch (const draughts::Bad& e) {
                refuse(e);
            }
        }
        fail(kWord, name(), word);
    }

    void dumpState(std::string& out) const override {
        out += "# position " + draughts::toFen(game_.rules(), game_.position()) + "\n";
        out += "# moves " + std::to_string(game_.moves().size()) + "\n";
        out += std::string("# searching ") + (job_ ? "1" : "0") + "\n";
        out += "# endgames " + std::string(endgames_ ? "here" : "not needed yet") + "\n";
    }

    std::string selftest() override {
        auto n = draughts::perft(game_.rules(), draughts::startPosition(game_.rules()), 5);
        std::uint64_t right = variant_ == "intl" ? 27117 : variant_ == "braz" ? 7473 : 7361;
        if (n != right) return "perft 5: " + std::to_string(n) + " instead of " + std::to_string(right);
        return "ok: perft 5 is " + std::to_string(n);
    }

private:
    struct Job {
        sorma::Reply reply;
        sorma::KeptCallPointer call;
        draughts::Search search;
        sorma::Charge charge;               // for its threads
        std::thread thread;
        bool plays;
        std::size_t ply;
        draughts::Position position;
        Job(const draughts::Rules& rules, draughts::Transpositions& table) : search(rules, table) {}
    };

    [[noreturn]] void refuse(const draughts::Bad& e) const {
        if (e.symbol == "AMBIGUOUS") fail(kAmbiguous, name(), e.what());
        if (e.symbol == "FEN") fail(kFen, name(), e.what());
        if (e.symbol == "PDN") fail(kPdn, name(), e.what());
        if (e.symbol == "SIGHT") fail(kSight, name(), e.what());
        fail(kMove, name(), e.what());
    }

    void checkColours() const {
        auto bad = [](char c) { return c == '.' || c == '?' || c <= ' ' || c >= 127; };
        if (colours_.size() != 2 || colours_[0] == colours_[1] || bad(colours_[0]) || bad(colours_[1]))
            fail(kColours, name(), "-colours", colours_);
    }

    void begin() {
        game_ = Game(*draughts::findGame(variant_));
        dropTable();
        endgames_.reset();
    }

    // The one argument of a word: a word, or the request's text.
    std::string argument(const Message& m, const char* usage) const {
        if (m.words.size() > 2 || (m.words.size() == 2 && !m.text.empty())) fail(kUsage, name(), usage);
        return m.words.size() == 2 ? m.words[1] : m.text;
    }
    void alone(const Message& m) const {
        if (m.words.size() != 1 || !m.text.empty()) fail(kUsage, name(), m.words[0]);
    }

    // ---- the game ----

    void answerMove(Message& m, const draughts::Position& p, const Move& move) const {
        draughts::MoveRoute path = draughts::routeOf(game_.rules(), p, move);
        m.clear();
        m.text = draughts::hubMove(game_.rules(), move);
        m.ints.push_back(std::int64_t(path.squares.size()));
        m.ints.insert(m.ints.end(), path.squares.begin(), path.squares.end());
        m.ints.insert(m.ints.end(), path.victims.begin(), path.victims.end());
    }

    void legal(Message& m) {
        alone(m);
        draughts::MoveList list;
        draughts::generate(game_.rules(), game_.position(), list);
        m.clear();
        for (auto& move : list) m.text += (m.text.empty() ? "" : " ") + draughts::hubMove(game_.rules(), move);
    }
    void path(Message& m) {
        Move move = draughts::parseMove(game_.rules(), game_.position(), argument(m, "path move"));
        answerMove(m, game_.position(), move);
    }
    void play(Message& m) {
        Move move = draughts::parseMove(game_.rules(), game_.position(), argument(m, "play move"));
        answerMove(m, game_.position(), move);
        make(move);
    }
    void make(const Move& move) {
        game_.play(move);
        tellPosition("move", draughts::hubMove(game_.rules(), move));
    }
    void tellPosition(const char* event, std::string text) {
        Message told;
        told.text = std::move(text);
        publish(event, told);
    }
    void undo(Message& m) {
        std::size_t n = 1;
        if (m.words.size() > 2 || !m.text.empty()) fail(kUsage, name(), "undo ?moves?");
        if (m.words.size() == 2) {
            auto& w = m.words[1];
            auto [end, error] = std::from_chars(w.data(), w.data() + w.size(), n);
            if (error != std::errc() || end != w.data() + w.size()) fail(kUsage, name(), "undo ?moves?");
        }
        if (n > game_.moves().size()) fail(kUndo, name(), game_.moves().size(), n);
        for (std::size_t i = 0; i < n; ++i) game_.undo();
        m.clear();
        m.text = draughts::toFen(game_.rules(), game_.position());
        tellPosition("position", m.text);
    }
    void fresh(Message& m) {
        alone(m);
        game_ = Game(game_.rules());
        m.clear();
        m.text = draughts::toFen(game_.rules(), game_.position());
        tellPosition("position", m.text);
    }
    void state(Message& m) {
        alone(m);
        draughts::Status s = game_.status();
        auto count = [](int n, int limit) { return std::to_string(n) + "/" + std::to_string(limit); };
        m.clear();
        m.text = std::string("side ") + (game_.position().side == draughts::Side::white ? "white" : "black") + " moves " +
                 std::to_string(game_.moves().size()) + " result " + s.result + " reason {" + s.reason + "} repeated " +
                 std::to_string(s.repeated) + " kingMoves " + count(s.kingMoves, s.kingMovesLimit) + " fewPieces " +
                 count(s.small, s.smallLimit);
    }
    void fen(Message& m) {
        std::string text = argument(m, "fen ?position?");
        if (!text.empty()) {
            game_ = Game(game_.rules(), draughts::parseFen(game_.rules(), text));
            tellPosition("position", draughts::toFen(game_.rules(), game_.position()));
        }
        m.clear();
        m.text = draughts::toFen(game_.rules(), game_.position());
    }
    void pdn(Message& m) {
        std::string text = argument(m, "pdn");
        if (!text.empty()) {
            game_ = Game::fromPdn(game_.rules(), text);
            tellPosition("position", draughts::toFen(game_.rules(), game_.position()));
        }
        m.clear();
        m.text = game_.toPdn();
    }
    void picture(Message& m) {
        alone(m);
        m.clear();
        m.text = draughts::toPicture(game_.rules(), game_.position());
    }
    // code 0: it is that move; 1: nothing has changed; 2: several fit; 3: none, the text says what is wrong.
    void explain(Message& m) {
        draughts::Sight sight = draughts::explain(game_.rules(), game_.position(), argument(m, "explain"), colours_[0], colours_[1]);
        if (sight.moves.size() == 1 && !sight.unchanged) return answerMove(m, game_.position(), sight.moves[0]);
        m.clear();
        m.code = sight.unchanged ? 1 : sight.moves.empty() ? 3 : 2;
        if (sight.unchanged) m.text = "nothing has changed";
        else if (sight.moves.empty()) m.text = sight.wrong;
        else
            for (auto& move : sight.moves) m.text += (m.text.empty() ? "" : " ") + draughts::hubMove(game_.rules(), move);
    }

    // ---- the search ----

    void go(Message& m) {
        alone(m);
        if (auto s = game_.status(); s.over) fail(kOver, name(), s.result, s.reason);
        draughts::Limits limits{.depth = int(depth_), .nodes = std::uint64_t(nodes_), .time = time_};
        draughts::SearchSettings settings;
        draughts::atLevel(int(level_), std::uint64_t(seed_), game_.moves().size(), limits, settings);
        search(m, limits, settings, true);
    }

    void analyse(Message& m) {
        const char* usage = "analyse ?time s? ?depth n? ?nodes n?";
        if (m.words.size() % 2 == 0 || !m.text.empty()) fail(kUsage, name(), usage);
        draughts::Limits limits;
        for (std::size_t i = 1; i < m.words.size(); i += 2) {
            const std::string &what = m.words[i], &value = m.words[i + 1];
            auto read = [&](auto& out, auto low, auto high) {
                auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), out);
                if (error != std::errc() || end != value.data() + value.size() || !(out >= low && out <= high)) fail(kUsage, name(), usage);
            };
            if (what == "time") read(limits.time, 0.0, 1e6);
            else if (what == "depth") read(limits.depth, 1, 99);
            else if (what == "nodes") read(limits.nodes, std::uint64_t(1), UINT64_MAX);
            else fail(kUsage, name(), usage);
        }
        if (m.words.size() == 1) limits = {.depth = int(depth_), .nodes = std::uint64_t(nodes_), .time = time_};
        draughts::MoveList list;
        draughts::generate(game_.rules(), game_.position(), list);
        if (!list.size()) {
            auto s = game_.status();
            fail(kOver, name(), s.result, s.reason);
        }
        search(m, limits, {}, false);
    }

    void search(Message& m, draughts::Limits limits, draughts::SearchSettings settings, bool plays) {
        if (job_) fail(kBusy, name());
        sorma::Charge charge(sorm().budget.ofCaller(), sorma::Account::Use::threads);
        charge.need(name(), std::size_t(threads_) * sorma::Account::kThread);
        needTable(charge.account());
        bool small = table_->size() < std::size_t(hash_) << 19;
        const draughts::Rules& rules = game_.rules();
        auto job = std::make_shared<Job>(rules, *table_);
        job->charge = std::move(charge);
        job->plays = plays;
        job->ply = game_.moves().size();
        job->position = game_.position();
        job->call = sorma::CallContext::keep();
        settings.threads = int(threads_);
        settings.idle = idle_;
        job->reply = later(m);
        job->reply.message().clear();
        if (small)
            job->reply.message().warn(kNote, name(), "no memory for -hash " + std::to_string(hash_) + " MB: using " +
                                                         std::to_string(table_->size() >> 10) + " kB");
        job->search.prepare();
        job_ = job;
        job->reply.onCancel([job] { job->search.stop(); });
        bool tables = useEndgames_ && rules.width == 8;
        std::string file = endgamesFile_.empty() ? draughts::Endgames::defaultFile(rules) : endgamesFile_.use(*this);
        auto post = [box = sorm().mailbox(), weak = std::weak_ptr(job), this](std::function<void()> work) {
            // The job is ours while the object lives; it goes before the object does.
            box->post([weak, work = std::move(work), this] {
                if (auto here = weak.lock(); here && here == job_) work();
            });
        };
        auto think = [this, j = job.get(), post, &rules, limits, settings, tables, file, endgames = endgames_,
                                   game = game_.reversible()]() mutable {
            std::string note;
            if (tables && !endgames) {
                double told = -1;
                endgames = draughts::Endgames::provide(rules, file, [&](double part) {
                    if (part - told >= 0.05 || part == 1) {
                        told = part;
                        post([this, part] { tellEndgames(part); });
                    }
                    return !j->reply.cancelled() && !j->search.stopped();
                }, note);
            }
            settings.endgames = endgames.get();
            Progress best;
            std::string wrong;
            try {
                best = j->search.run(game, limits, settings, [&](const Progress& p) { post([this, p] { tellProgress(p); }); });
            } catch (const std::exception& e) {
                wrong = e.what();
            }
            post([this, best, note, endgames, wrong] { ended(best, note, endgames, wrong); });
        };
        try {
            job->thread = std::thread(std::move(think));
        } catch (const std::system_error& e) {
            job_ = nullptr;
            job->reply.fail(e);
        }
    }

    static void fill(Message& m, const draughts::Rules& rules, const Progress& p) {
        m.text.clear();
        for (auto& move : p.line) m.text += (m.text.empty() ? "" : " ") + draughts::hubMove(rules, move);
        m.floats = {p.score / 100.0, p.time};
        m.ints = {p.depth, std::int64_t(std::min<std::uint64_t>(p.nodes, INT64_MAX))};
    }
    void tellProgress(const Progress& p) {
        Message m;
        fill(m, game_.rules(), p);
        sorma::CallContext context(job_->call);
        publish("progress", m);
    }
    void tellEndgames(double part) {
        Message m;
        m.floats = {part};
        sorma::CallContext context(job_->call);
        publish("endgames", m);
    }
    void ended(const Progress& best, const std::string& note, const std::shared_ptr<const draughts::Endgames>& endgames,
               const std::string& wrong) {
        auto job = std::exchange(job_, nullptr);
        job->thread.join();
        job->charge.clear();
        if (tableLeaves_) dropTable();
        if (endgames) endgames_ = endgames;
        Message& m = job->reply.message();
        if (!note.empty()) m.warn(kNote, name(), note);
        auto of = [](const auto& v) { return sorma::MessageArg::of(v); };
        const draughts::Rules& rules = game_.rules();
        if (!wrong.empty()) return job->reply.fail(sorma::Error(sorma::makeEntry(kNote, {of(name()), of(wrong)})));
        if (!job->plays) {
            fill(m, rules, best);
            return job->reply.complete();
        }
        std::string move = draughts::hubMove(rules, best.line[0]);
        if (game_.moves().size() != job->ply || game_.position() != job->position)
            return job->reply.fail(sorma::Error(sorma::makeEntry(kChanged, {of(name()), of(move)})));
        // A player who is not waited for any more has not moved.
        if (job->reply.cancelled()) return job->reply.complete();
        answerMove(m, game_.position(), best.line[0]);
        m.floats = {best.score / 100.0, best.time};
        sorma::CallContext context(job->call);
        make(best.line[0]);
        job->reply.complete();
    }
    // The table is on the account of the client that searched last, and goes when that client ends.
    void needTable(const sorma::AccountPointer& account) {
        const sorma::ClientPointer client = sorma::CallContext::currentClient();
        if (table_ && tableClient_ == client && tableCharge_.account() == account) return;
        const std::size_t wanted = table_ ? table_->size() : std::size_t(hash_) << 20;
        if (account != tableCharge_.account() || !table_) {
            sorma::Charge fresh(account, sorma::Account::Use::tables);
            fresh.need(name(), wanted);
            tableCharge_ = std::move(fresh);
        }
        if (!table_) table_ = std::make_unique<draughts::Transpositions>(wanted);
        tableCharge_.force(table_->size());
        if (tableClient_) tableClient_->release(tableLease_);
        tableClient_ = client;
        if (client) tableLease_ = client->hold(name(), [this] { clientEnded(); });
    }
    void clientEnded() {
        tableClient_ = nullptr;
        if (!job_) return dropTable();
        job_->search.stop();                // ended() drops the table
        tableLeaves_ = true;
    }
    void dropTable() {
        if (auto client = std::exchange(tableClient_, nullptr)) client->release(tableLease_);
        table_.reset();
        tableCharge_.clear();
        tableLeaves_ = false;
    }
    void stopAction(sorma::Args, Message& m) {
        if (job_) job_->search.stop();
        m.text += job_ ? "stopped" : "no search";
    }
    void endSearch() {
        auto job = std::exchange(job_, nullptr);
        if (!job) return;
        job->search.stop();
        job->thread.join();
        job->charge.clear();
    }

    std::string variant_ = "intl", colours_ = "yr";
    sorma::Named<sorma::Kind::file> endgamesFile_;
    std::int64_t level_ = 10, seed_ = 0, depth_ = 0, nodes_ = 0, threads_ = 1, hash_ = 64;
    double time_ = 5;
    bool useEndgames_ = true, idle_ = false;
    Game game_{draughts::kIntl};
    std::unique_ptr<draughts::Transpositions> table_;
    sorma::Charge tableCharge_;
    sorma::ClientPointer tableClient_;      // whose lease it is; null: this process
    sorma::Client::Lease tableLease_ = 0;
    bool tableLeaves_ = false;              // that client has ended: the table goes with the search under way
    std::shared_ptr<const draughts::Endgames> endgames_;
    std::shared_ptr<Job> job_;              // the search under way
};

}  // namespace

extern "C" SORMA_EXPORT int Draughts_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::draughts", "1.0", {Draughts::describe()});
}
