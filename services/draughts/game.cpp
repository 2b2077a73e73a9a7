#include "draughts/game.h"

#include <algorithm>
#include <charconv>

namespace draughts {
namespace {

// The moves of each side that the game may last with so few pieces; 0: no limit.
int smallLimit(const Rules& rules, const Position& p) {
    const DrawLimits& d = rules.draws;
    auto limitFor = [&](Bits one, Bits many) {
        int n = countOf(many), kings = countOf(many & p.kings), k = countOf(one & p.kings);
        if (countOf(one) == 1 && k == 1) {
            Bits corner = bitOf(rules, rules.squares() - rules.half() + 1), diagonal = 0;
            for (Bits b = corner; b; b = rules.width == 10 ? Board<10>::step(b, upRight) & Board<10>::all : Board<8>::step(b, upRight) & Board<8>::all)
                diagonal |= b;
            if (n == 3 && kings >= (d.threeAreKings ? 3 : 1))
                return d.longDiagonal && (one & diagonal) ? d.longDiagonal : d.oneAgainstThree;
            if (n <= 2 && kings >= 1) return d.oneAgainstTwo;
        }
        if (countOf(one) == 2 && k == 2 && n == 2 && kings >= 1) return d.twoAgainstTwo;
        return 0;
    };
    int white = limitFor(p.white, p.black), black = limitFor(p.black, p.white);
    return white ? white : black;
}

bool isReversible(const Position& before, const Move& m) { return !m.captured && (before.kings >> m.from & 1); }

}  // namespace

void Game::play(const Move& m) {
    positions_.push_back(after(*rules_, position(), m));
    moves_.push_back(m);
    result = "*";
}

bool Game::undo() {
    if (moves_.empty()) return false;
    moves_.pop_back();
    positions_.pop_back();
    result = "*";
    return true;
}

std::vector<Position> Game::reversible() const {
    std::size_t first = moves_.size();
    while (first > 0 && isReversible(positions_[first - 1], moves_[first - 1])) --first;
    return {positions_.begin() + std::ptrdiff_t(first), positions_.end()};
}

Status Game::status() const {
    Status s;
    const Position& p = position();
    auto since = reversible();
    s.repeated = int(std::count(since.begin(), since.end(), p));
    s.kingMoves = int(since.size()) - 1;
    s.kingMovesLimit = 2 * rules_->draws.kingMoves;
    // A count begins when a limit begins to hold. A new one may end the game sooner, never later, while pieces remain few.
    int end = 0, begin = 0;
    for (int i = 0, last = 0; i <= int(moves_.size()); ++i) {
        int limit = smallLimit(*rules_, positions_[std::size_t(i)]);
        if (!limit) end = 0;
        else if (limit != last) {
            int fresh = i + 2 * limit;
            if (!end || fresh < end) end = fresh, begin = i;
        }
        last = limit;
    }
    if (end) {
        s.small = int(moves_.size()) - begin;
        s.smallLimit = end - begin;
    }

    MoveList list;
    generate(*rules_, p, list);
    auto ends = [&](const char* result, std::string reason) {
        s.over = true;
        s.result = result;
        s.reason = std::move(reason);
    };
    std::string book = std::string(" (") + rules_->book + ")";
    if (!list.size())
        ends(p.side == Side::white ? "0-1" : "1-0", std::string(p.side == Side::white ? "White" : "Black") +
                                                        (p.own() ? " cannot move" : " has no pieces left"));
    else if (s.repeated >= 3) ends("1/2-1/2", "the same position for the third time" + book);
    else if (s.kingMoves >= s.kingMovesLimit)
        ends("1/2-1/2", std::to_string(s.kingMovesLimit / 2) + " moves of each side with kings alone and without a capture" + book);
    else if (s.smallLimit && s.small >= s.smallLimit)
        ends("1/2-1/2", std::to_string(s.smallLimit / 2) + " moves of each side with so few pieces" + book);
    return s;
}

std::string Game::toPdn() const {
    std::string out;
    auto tag = [&](const std::string& name, const std::string& value) {
        out += "[" + name + " \"";
        for (char c : value) {
            if (c == '"' || c == '\\') out += '\\';
            out += c;
        }
        out += "\"]\n";
    };
    Status s = status();
    std::string end = s.over ? s.result : result;
    for (const char* name : {"Event", "Site", "Date", "Round", "White", "Black"}) {
        auto found = tags.find(name);
        tag(name, found != tags.end() ? found->second : *name == 'D' ? "????.??.??" : "?");
    }
    tag("Result", end);
    tag("GameType", rules_->pdn);
    if (positions_[0] != startPosition(*rules_)) {
        tag("SetUp", "1");
        tag("FEN", toFen(*rules_, positions_[0]));
    }
    for (auto& [name, value] : tags)
        if (out.find("[" + name + " ") == std::string::npos) tag(name, value);
    out += '\n';
    std::string line;
    auto word = [&](const std::string& w) {
        if (line.size() + w.size() + 1 > 79) out += line + "\n", line.clear();
        line += (line.empty() ? "" : " ") + w;
    };
    Side starts = rules_->blackBegins ? Side::black : Side::white;
    bool odd = positions_[0].side != starts;
    for (std::size_t i = 0; i < moves_.size(); ++i) {
        std::size_t half = i + odd;
        std::string number = half % 2 == 0 ? std::to_string(half / 2 + 1) + "." : i == 0 ? "1..." : "";
        if (!number.empty()) word(number);
        word(pdnMove(*rules_, positions_[i], moves_[i], rules_ == &kBraz));
    }
    word(end);
    return out + line + "\n";
}

namespace {

// Takes a game's text apart: first the tags, then the words of its moves.
class PdnText {
public:
    explicit PdnText(std::string_view text) : text_(text) {}

    std::map<std::string, std::string> tags() {
        std::map<std::string, std::string> tags;
        for (skipBlanks(); !over() && (text_[at_] == '[' || text_[at_] == ';' || text_[at_] == '%'); skipBlanks()) {
            if (text_[at_] != '[') {
                skipLine();
                continue;
            }
            begin_ = at_++;
            skipBlanks();
            std::size_t name = at_;
            while (!over() && !isBlank(text_[at_]) && text_[at_] != '"' && text_[at_] != ']') ++at_;
            std::string tag(text_.substr(name, at_ - name)), value;
            skipBlanks();
            if (tag.empty() || over() || text_[at_] != '"') throw wrong("expected a tag such as [White \"name\"]");
            for (++at_; !over() && text_[at_] != '"'; ++at_) {
                if (text_[at_] == '\\' && at_ + 1 < text_.size()) ++at_;
                value += text_[at_];
            }
            ++at_;
            skipBlanks();
            if (over() || text_[at_] != ']') throw wrong("tag " + tag + " has no end: expected \"]");
            ++at_;
            tags[tag] = value;
        }
        return tags;
    }

    // The next word that is neither in a comment nor in a variation. False: the game's text is over.
    bool next(std::string_view& word) {
        for (skipBlanks(); !over(); skipBlanks()) {
            begin_ = at_;
            char c = text_[at_];
            if (c == '{') {
                at_ = text_.find('}', at_);
                if (at_ == text_.npos) throw wrong("a comment has no end: expected a closing brace");
                ++at_;
            } else if (c == ';' || (c == '%' && (at_ == 0 || text_[at_ - 1] == '\n'))) {
                skipLine();
            } else if (c == '(' || c == ')') {
                depth_ += c == '(' ? 1 : -1;
                if (depth_ < 0) throw wrong("a variation ends that has not begun");
                ++at_;
            } else if (c == '[' && !depth_) {
                return false;               // the next game
            } else {
                while (!over() && !isBlank(text_[at_]) && std::string_view("{}();[").find(text_[at_]) == text_.npos) ++at_;
                if (at_ == begin_) throw wrong(std::string("unexpected \"") + c + "\"");
                word = text_.substr(begin_, at_ - begin_);
                if (!depth_ && word[0] != '$') return true;
            }
        }
        begin_ = text_.size();
        if (depth_) throw wrong("a variation has no end: expected )");
        return false;
    }

    // With the line of the tag or word that was read last.
    Bad wrong(const std::string& what) const {
        auto line = 1 + std::count(text_.begin(), text_.begin() + std::ptrdiff_t(std::min(begin_, text_.size())), '\n');
        return Bad("PDN", "line " + std::to_string(line) + ": " + what);
    }

private:
    static bool isBlank(char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; }
    bool over() const { return at_ >= text_.size(); }
    void skipBlanks() {
        while (!over() && isBlank(text_[at_])) ++at_;
    }
    void skipLine() { at_ = std::min(text_.find('\n', at_), text_.size()); }

    std::string_view text_;
    std::size_t at_ = 0, begin_ = 0;
    int depth_ = 0;                         // of variations
};

// "12." and "12..." may be tied to a move, and marks may follow it.
std::string_view moveIn(std::string_view word) {
    std::size_t digits = 0;
    while (digits < word.size() && word[digits] >= '0' && word[digits] <= '9') ++digits;
    if (digits < word.size() && word[digits] == '.') word = word.substr(std::min(word.find_first_not_of('.', digits), word.size()));
    while (!word.empty() && (word.back() == '!' || word.back() == '?' || word.back() == '*')) word.remove_suffix(1);
    return word;
}

}  // namespace

Game Game::fromPdn(const Rules& rules, std::string_view text) {
    PdnText reader(text);
    auto tags = reader.tags();
    if (auto type = tags.find("GameType"); type != tags.end()) {
        int n = 0;
        std::from_chars(type->second.data(), type->second.data() + type->second.size(), n);
        if (n != rules.gameType)
            throw Bad("PDN", "GameType \"" + type->second.substr(0, 40) + "\" is not that of " + rules.name + ", " +
                                 std::to_string(rules.gameType));
    }
    Game game(rules);
    if (auto fen = tags.find("FEN"); fen != tags.end()) game = Game(rules, parseFen(rules, fen->second));
    std::string result = "*";
    for (std::string_view word; reader.next(word);) {
        bool ends = false;
        for (const char* r : {"1-0", "0-1", "1/2-1/2", "2-0", "0-2", "1-1", "0-0", "*"}) ends = ends || word == r;
        if (ends) {
            result = word == "2-0" ? "1-0" : word == "0-2" ? "0-1" : word == "1-1" || word == "0-0" ? "1/2-1/2" : std::string(word);
            break;
        }
        word = moveIn(word);
        if (word.empty()) continue;
        try {
            game.play(parseMove(rules, game.position(), word));
        } catch (const Bad& e) {
            throw reader.wrong(std::string(e.what()) + ", after " + std::to_string(game.moves().size()) + " moves");
        }
    }
    for (const char* own : {"Result", "GameType", "SetUp", "FEN"}) tags.erase(own);
    game.tags = std::move(tags);
    game.result = result;
    return game;
}

}  // namespace draughts
