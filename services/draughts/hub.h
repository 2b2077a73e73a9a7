// hub.h -- protocol 2 of the Hub user interface: lines in, lines out; an engine that any draughts program can drive.
//
// Source: rhalbersma/scan, protocol.txt; beyond it the parameters variant, level, seed, hash, threads, endgames and plain.
// Threads: line() belongs to one thread; a search runs on its own, and writes from there.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

#include "draughts/endgames.h"
#include "draughts/game.h"
#include "draughts/search.h"

namespace draughts {

class Hub {
public:
    // write: called with a line without its end, one call at a time, from any thread.
    explicit Hub(std::function<void(const std::string&)> write) : write_(std::move(write)) {}
    ~Hub() { finish(); }

    // False: quit.
    bool line(std::string_view text);
    // End a search and wait for it.
    void finish();
    // Wait for the end of a search that ends by itself.
    void wait();

private:
    using Pairs = std::map<std::string, std::string>;
    void say(const std::string& text);
    void error(const std::string& text);
    void hello();
    void setParameter(const Pairs& pairs);
    void init();
    void setPosition(const Pairs& pairs);
    void setLevel(const Pairs& pairs);
    void go(const std::string& how);
    void report(const Progress& p);

    std::function<void(const std::string&)> write_;
    std::mutex writing_;
    enum { fresh, waiting, ready } state_ = fresh;

    const Rules* rules_ = &kIntl;
    std::size_t hash_ = 64;                 // [MB]
    int threads_ = 1, level_ = 10;
    std::uint64_t seed_ = 0;
    bool plain_ = false, useEndgames_ = true;
    std::string endgamesFile_;              // empty: Endgames::defaultFile

    std::unique_ptr<Transpositions> table_;
    std::shared_ptr<const Endgames> endgames_;
    std::unique_ptr<Search> search_;
    std::unique_ptr<Game> game_;
    Limits limits_;
    std::thread thread_;
    std::atomic<bool> searching_{false}, pondering_{false};
};

}  // namespace draughts
