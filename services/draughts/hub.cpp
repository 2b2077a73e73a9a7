#include "draughts/hub.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "draughts/level.h"

namespace draughts {
namespace {

std::string clean(std::string_view text) {
    std::string out;
    for (char c : text.substr(0, 200)) out += c == '"' ? '\'' : c >= ' ' && c < 127 ? c : '?';
    return out;
}

std::string fixed(double value, int digits) {       // without regard to locale
    char text[64];
    auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, digits).ptr;
    return {text, end};
}

template <class T> bool number(const std::string& text, T& out) {
    auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    return error == std::errc() && end == text.data() + text.size();
}

// name=value name="a value" flag
std::map<std::string, std::string> pairsOf(std::string_view text) {
    std::map<std::string, std::string> out;
    std::size_t at = 0;
    while (at < text.size()) {
        if (text[at] == ' ' || text[at] == '\t') {
            ++at;
            continue;
        }
        std::size_t begin = at;
        while (at < text.size() && text[at] != '=' && text[at] != ' ') ++at;
        std::string name(text.substr(begin, at - begin)), value;
        if (at < text.size() && text[at] == '=') {
            ++at;
            bool quoted = at < text.size() && text[at] == '"';
            begin = at += quoted;
            at = std::min(text.find(quoted ? '"' : ' ', at), text.size());
            value = text.substr(begin, at - begin);
            at += quoted;
        }
        out[name] = value;
    }
    return out;
}

}  // namespace

void Hub::say(const std::string& text) {
    std::lock_guard lock(writing_);
    write_(text);
}

void Hub::error(const std::string& text) { say("error message=\"" + clean(text) + "\""); }

void Hub::wait() {
    if (thread_.joinable()) thread_.join();
}

void Hub::finish() {
    if (search_) search_->stop();
    wait();
}

bool Hub::line(std::string_view text) {
    while (!text.empty() && (text.back() == '\r' || text.back() == ' ')) text.remove_suffix(1);
    while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
    if (text.empty()) return true;
    std::size_t space = std::min(text.find(' '), text.size());
    std::string command(text.substr(0, space));
    Pairs pairs = pairsOf(text.substr(space));
    bool searching = searching_.load();
    if (command == "quit") return finish(), false;
    if (command == "ping") return say("pong"), true;
    if (command == "stop") {
        if (searching) search_->stop();
        return true;
    }
    if (command == "ponder-hit") {
        if (searching && pondering_.exchange(false)) {
            if (limits_.time > 0) search_->endIn(limits_.time * 0.7);
            else search_->stop();
        }
        return true;
    }
    if (searching) {
        error("\"" + command.substr(0, 30) + "\" during a search: only ping, stop, ponder-hit and quit may come; send stop first");
        return true;
    }
    wait();
    try {
        if (command == "hub") hello();
        else if (command == "set-param") setParameter(pairs);
        else if (command == "init") init();
        else if (command == "new-game" || command == "pos" || command == "level" || command == "go") {
            if (state_ != ready) throw Bad("HUB", command + " before init: send hub, set-param as needed, init, and wait for ready");
            if (command == "new-game") {
                table_->clear();
                game_ = std::make_unique<Game>(*rules_);
            } else if (command == "pos") setPosition(pairs);
            else if (command == "level") setLevel(pairs);
            else go(pairs.empty() ? "" : pairs.begin()->first);
        } else {
            throw Bad("HUB", "unknown command \"" + command.substr(0, 30) +
                                 "\": must be go, hub, init, level, new-game, ping, ponder-hit, pos, quit, set-param, or stop");
        }
    } catch (const std::exception& e) {
        error(e.what());
    }
    return true;
}

void Hub::hello() {
    say("id name=SORMA version=1.0 author=\"the SORMA project\"");
    say(std::string("param name=variant value=") + rules_->name + " type=enum values=\"intl braz engl\"");
    say("param name=level value=" + std::to_string(level_) + " type=int min=1 max=10");
    say("param name=threads value=" + std::to_string(threads_) + " type=int min=1 max=64");
    say("param name=hash value=" + std::to_string(hash_) + " type=int min=1 max=65536");
    say("param name=seed value=" + std::to_string(seed_) + " type=int min=0 max=1000000000");
    say(std::string("param name=endgames value=") + (useEndgames_ ? "true" : "false") + " type=bool");
    say("param name=endgames-file value=\"" + endgamesFile_ + "\" type=string");
    say(std::string("param name=plain value=") + (plain_ ? "true" : "false") + " type=bool");
    say("wait");
    state_ = waiting;
}

void Hub::setParameter(const Pairs& pairs) {
    auto found = pairs.find("name"), given = pairs.find("value");
    if (found == pairs.end() || given == pairs.end()) throw Bad("HUB", "expected set-param name=NAME value=VALUE");
    const std::string &name = found->second, &value = given->second;
    auto integer = [&](std::uint64_t low, std::uint64_t high) {
        std::uint64_t n = 0;
        if (!number(value, n) || n < low || n > high)
            throw Bad("HUB", name + " " + value.substr(0, 30) + " is not an integer in " + std::to_string(low) + " .. " + std::to_string(high));
        return n;
    };
    auto flag = [&] {
        if (value != "true" && value != "false") throw Bad("HUB", name + " must be true or false, got " + value.substr(0, 30));
        return value == "true";
    };
    if (name == "variant") {
        auto* rules = findGame(value);
        if (value == "normal") rules = &kIntl;      // what Scan calls it
        if (!rules) throw Bad("HUB", "variant must be intl, braz, or engl, got " + value.substr(0, 30));
        rules_ = rules;
    } else if (name == "level") level_ = int(integer(1, kFullLevel));
    else if (name == "threads") threads_ = int(integer(1, 64));
    else if (name == "hash") hash_ = integer(1, 65536);
    else if (name == "seed") seed_ = integer(0, 1000000000);
    else if (name == "endgames") useEndgames_ = flag();
    else if (name == "endgames-file") endgamesFile_ = value;
    else if (name == "plain") plain_ = flag();
    else return;                                    // others have other parameters
    if (state_ == ready) state_ = waiting;
}

void Hub::init() {
    std::size_t bytes = hash_ << 20;
    search_.reset();
    table_.reset();
    table_ = std::make_unique<Transpositions>(bytes);
    if (table_->size() < bytes / 2)
        say("message text=\"no memory for hash=" + std::to_string(hash_) + ": using " + fixed(double(table_->size()) / (1 << 20), 3) + " MB\"");
    endgames_.reset();
    if (useEndgames_ && !plain_ && rules_->width == 8) {
        std::string note;
        int last = -1;
        endgames_ = Endgames::provide(*rules_, endgamesFile_.empty() ? Endgames::defaultFile(*rules_) : endgamesFile_, [&](double part) {
            if (int tenth = int(part * 10); tenth != last) say("message text=\"computing endgames: " + std::to_string((last = tenth) * 10) + " %\"");
            return true;
        }, note);
        if (!note.empty()) say("message text=\"" + clean(note) + "\"");
    }
    search_ = std::make_unique<Search>(*rules_, *table_);
    game_ = std::make_unique<Game>(*rules_);
    state_ = ready;
    say("ready");
}

void Hub::setPosition(const Pairs& pairs) {
    auto pos = pairs.find("pos"), moves = pairs.find("moves");
    Game game(*rules_, pos == pairs.end() ? startPosition(*rules_) : parseHub(*rules_, pos->second));
    if (moves != pairs.end()) {
        std::string_view rest = moves->second;
        while (!rest.empty()) {
            std::size_t end = std::min(rest.find(' '), rest.size());
            if (end) game.play(parseMove(*rules_, game.position(), rest.substr(0, end)));
            rest.remove_prefix(std::min(end + 1, rest.size()));
        }
    }
    game_ = std::make_unique<Game>(std::move(game));
}

void Hub::setLevel(const Pairs& pairs) {
    Limits l;
    double time = 0, increment = 0;
    std::uint64_t moves = 0;
    for (auto& pair : pairs) {
        const std::string &name = pair.first, &value = pair.second;
        auto real = [&] {
            double x = 0;
            if (!number(value, x) || !(x >= 0 && x < 1e9)) throw Bad("HUB", "level: " + name + " must be a time in seconds, got " + value.substr(0, 30));
            return x;
        };
        auto integer = [&] {
            std::uint64_t n = 0;
            if (!number(value, n)) throw Bad("HUB", "level: " + name + " must be an integer below 2^64, got " + value.substr(0, 30));
            return n;
        };
        if (name == "depth") l.depth = int(std::clamp<std::uint64_t>(integer(), 1, 99));
        else if (name == "nodes") l.nodes = std::max<std::uint64_t>(integer(), 1);
        else if (name == "move-time") l.time = std::max(real(), 0.001);
        else if (name == "time") time = std::max(real(), 0.001);
        else if (name == "inc") increment = real();
        else if (name == "moves") moves = integer();
        else if (name == "infinite" || name == "analyze") l.infinite = true;
    }
    if (time > 0) {
        double left = moves ? double(std::min<std::uint64_t>(moves, 60)) : 35;
        // A search ends on average after some six tenths of its limit.
        l.time = std::max(std::min(time * 0.4, 1.6 * (time / (left + 1) + increment * 0.8)) - 0.01, 0.001);
    }
    limits_ = l;
}

void Hub::go(const std::string& how) {
    if (how != "think" && how != "ponder" && how != "analyze" && !how.empty())
        throw Bad("HUB", "go must be think, ponder, or analyze, got " + how.substr(0, 30));
    MoveList list;
    generate(*rules_, game_->position(), list);
    if (!list.size()) {
        error("no legal move: the game is over");
        return say("done");
    }
    Limits limits = limits_;
    if (how == "ponder" || how == "analyze") limits = {.infinite = true};
    else if (!limits.depth && !limits.nodes && limits.time <= 0) limits.infinite = true;
    SearchSettings settings{.endgames = endgames_.get(), .threads = threads_, .plain = plain_ ? 1 : 0};
    if (how != "analyze") atLevel(level_, seed_, game_->moves().size(), limits, settings);
    if (how == "ponder") limits.nodes = 0;
    if (limits.nodes || limits.time > 0 || limits.depth) limits.infinite = false;
    pondering_ = how == "ponder";
    searching_ = true;
    search_->prepare();
    auto think = [this, limits, settings, game = game_->reversible()] {
        std::string end;
        try {
            Progress best = search_->run(game, limits, settings, [this](const Progress& p) { report(p); });
            end = "done move=" + hubMove(*rules_, best.line[0]);
            if (best.line.size() > 1) end += " ponder=" + hubMove(*rules_, best.line[1]);
        } catch (const std::exception& e) {
            error(e.what());
            MoveList list;
            generate(*rules_, game.back(), list);
            end = "done move=" + hubMove(*rules_, list[0]);
        }
        // Before the line: who reads it may send the next command at once.
        searching_ = false;
        say(end);
    };
    try {
        thread_ = std::thread(think);
    } catch (const std::system_error&) {        // no thread to be had: then nothing is heard until it has ended
        if (limits.infinite) search_->endIn(1);
        think();
    }
}

void Hub::report(const Progress& p) {
    std::string line;
    for (auto& m : p.line) line += (line.empty() ? "" : " ") + hubMove(*rules_, m);
    say("info depth=" + std::to_string(p.depth) + " mean-depth=" + fixed(p.depth, 1) + " score=" + fixed(p.score / 100.0, 2) +
        " nodes=" + std::to_string(p.nodes) + " time=" + fixed(p.time, 2) +
        " nps=" + fixed(p.time > 0 ? double(p.nodes) / p.time / 1e6 : 0, 2) + " pv=\"" + line + "\"");
}

}  // namespace draughts
