// buffers.h -- the snapshot buffers that simlab writes, and those that it reads.
//
// Threads: one.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <shmem/ring.h>

namespace simlab {

// Reads the newest record of a buffer whose writer may be missing, come and end. Records that are older than this object are
// ignored: they were meant for another run.
class Input {
public:
    Input(std::string key, std::size_t floats) : key_(std::move(key)), floats_(floats), born_(shmem::nanoseconds()) {}

    // Is there a record that has not been taken yet? It is in floats() then: float 0 is its time. Neither allocates nor waits; when
    // there is no writer it looks for one now and then.
    bool take();
    const double* floats() const { return record_.data(); }
    std::uint64_t counter() const { return seen_; }
    bool alive() const { return reader_ && !reader_->retired() && reader_->segment()->writing().alive(); }     // who writes runs
    void lookNow() { naps_ = 0; }       // for a writer, at the next take()
    // Sleep until there is one to take, or until a time [ns, monotonic]. May return early.
    void wait(std::int64_t until) const;

    const std::string& key() const { return key_; }
    const std::string& problem() const { return problem_; }     // why the buffer cannot be read; empty: nothing is wrong

private:
    void attach();
    const std::string key_;
    const std::size_t floats_;
    const std::int64_t born_;
    std::optional<shmem::Reader> reader_;
    std::vector<double> record_;
    std::uint64_t seen_ = 0;
    std::string problem_;
    int naps_ = 0;                      // until the next look for a writer
};

// Records of one kind: float 0 is the lab time, what follows is given in pieces.
class Output {
public:
    Output(const std::string& key, std::size_t floats, const std::string& program, std::size_t blocks = 256,
           std::size_t any = 0)
        : writer_(key, {blocks, floats, any}, program), record_(floats) {
        writer_.checksums(any == 0);            // for pictures it would take half a millisecond
    }
    Output& at(double time) { return record_[0] = time, used_ = 1, *this; }
    template <std::size_t n> Output& put(const std::array<double, n>& values) {
        for (double v : values) record_[used_++] = v;
        return *this;
    }
    Output& put(double value) { return record_[used_++] = value, *this; }
    void write(const void* any = nullptr) { writer_.write(record_.data(), any); }

private:
    shmem::Writer writer_;
    std::vector<double> record_;
    std::size_t used_ = 1;
};

}  // namespace simlab
