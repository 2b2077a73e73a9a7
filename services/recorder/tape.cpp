#include "tape.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <optional>

#include <sorma.h>

#include "bus/glob.h"

namespace recorder {

namespace {

constexpr std::int64_t kPoll = 5'000'000;           // [ns] a buffer of 256 records at 500 Hz holds a hundred times that
constexpr std::int64_t kLook = 200'000'000;         // [ns] between two looks for new buffers

}  // namespace

bool Plan::wants(const std::string& key) const {
    return std::any_of(buffers.begin(), buffers.end(), [&](auto& p) { return sorma::globMatch(p, key); });
}

// ---- Job ----

Job::Job(Work work, Done done)
    : thread_([this, work = std::move(work), done = std::move(done)] {
          Figures figures;
          std::exception_ptr error;
          try {
              figures = work(*this);
          } catch (...) {
              error = std::current_exception();
          }
          {
              std::lock_guard lock(mutex_);
              ended_ = true;
          }
          done(figures, error);
      }) {}

Job::~Job() {
    stop();
    thread_.join();
}

void Job::stop() {
    std::lock_guard lock(mutex_);
    stop_ = true;
    changed_.notify_all();
}

bool Job::rest(std::int64_t until) {
    std::unique_lock lock(mutex_);
    const auto left = std::chrono::nanoseconds(until - shmem::nanoseconds());
    if (left.count() > 0) changed_.wait_for(lock, left, [this] { return stop_; });
    return !stop_;
}

bool Job::ended() const {
    std::lock_guard lock(mutex_);
    return ended_;
}

// ---- recording ----

Recording::Recording(Plan plan) : plan_(std::move(plan)), out_(plan_.bus ? nullptr : std::make_unique<RecordingWriter>(plan_.file)) { look(); }

// ---- into the recording of a bus ----

void Recording::add(sorma::recording::Facts facts, std::uint32_t channel, const sorma::Message& m) {
    facts.source = plan_.program, facts.object = channels_[channel];
    plan_.bus->add(facts, m);
}

std::uint32_t Recording::announce(const Channel& channel) {
    if (out_) return out_->announce(channel);
    channels_.push_back(channel.key);
    sorma::Message m;
    m.ints = {std::int64_t(channel.shape.blocks), std::int64_t(channel.shape.floats), std::int64_t(channel.shape.any)};
    const auto number = std::uint32_t(channels_.size() - 1);
    add({.kind = sorma::recording::Kind::shape, .time = plan_.bus->now()}, number, m);
    return number;
}

void Recording::write(const Record& r) {
    if (out_) return out_->write(r);
    message_.floats = r.floats;
    message_.any = r.any;
    const std::int64_t offset = plan_.bus->now() - shmem::nanoseconds();
    add({.kind = sorma::recording::Kind::sample, .time = r.stamp.monotonic + offset, .number = r.stamp.counter}, r.channel, message_);
}

void Recording::lose(const Source& source, std::uint64_t records) {
    figures_.lost += records;
    if (!out_) add({.kind = sorma::recording::Kind::loss, .word = "overwritten before they were read", .time = plan_.bus->now(), .number = records}, source.channel, {});
}

// ---- both ----


void Recording::look() {
    for (auto& entry : shmem::Segment::list()) {
        if (!entry.key.starts_with(plan_.prefix) || sources_.contains(entry.key) || !entry.problem.empty()) continue;
        const std::string key = entry.key.substr(plan_.prefix.size());
        if (!plan_.wants(key)) continue;
        try {
            shmem::Reader reader(entry.key);
            const std::uint64_t newest = std::max<std::uint64_t>(reader.count(), 1);       // how things are at the beginning
            sources_.emplace(entry.key, Source{reader, announce({key, reader.shape()}), newest});
            seen_.insert(key);
        } catch (const shmem::Failure&) {           // it was removed meanwhile, or we may not read it
        }
    }
    nextLook_ = shmem::nanoseconds() + kLook;
}

void Recording::take(Source& s) {
    const std::uint64_t last = s.reader.count(), oldest = s.reader.oldest(last);
    if (s.next < oldest) lose(s, oldest - s.next), s.next = oldest;
    for (; s.next <= last; ++s.next) {
        if (used_ == batch_.size()) batch_.emplace_back();
        Record& r = batch_[used_];
        r.channel = s.channel;
        r.floats.resize(s.reader.shape().floats);
        r.any.resize(s.reader.shape().any);
        if (s.reader.read(s.next, r.floats.data(), r.any.data(), r.stamp)) ++used_;
        else lose(s, 1);
    }
}

void Recording::takeAll() {
    used_ = 0;
    for (auto i = sources_.begin(); i != sources_.end();) {
        const bool over = i->second.reader.retired();
        take(i->second);
        if (over) nextLook_ = 0, i = sources_.erase(i);
        else ++i;
    }
    std::sort(batch_.begin(), batch_.begin() + std::ptrdiff_t(used_),
              [](auto& a, auto& b) { return a.stamp.monotonic < b.stamp.monotonic; });
    for (std::size_t i = 0; i < used_; ++i) write(batch_[i]);
    figures_.records += used_;
    if (used_ > 0 && out_) out_->flush();
}

Figures Recording::run(Job& job) {
    for (bool on = true; on;) {
        on = job.rest(shmem::nanoseconds() + kPoll);
        if (shmem::nanoseconds() >= nextLook_ || !on) look();
        takeAll();
    }
    if (out_) out_->close();
    figures_.buffers = seen_.size();
    return figures_;
}

// ---- playing ----

Figures play(Job& job, const Plan& plan) {
    Record r;
    {
        RecordingReader all(plan.file, plan.partial);
        while (all.next(r))
            if (!job.rest(0)) return {};
        std::size_t bytes = 0;
        for (auto& c : all.channels())
            if (plan.wants(c.key)) bytes += shmem::segmentBytes(c.shape);
        plan.charge(bytes);
    }
    RecordingReader in(plan.file, plan.partial);
    std::map<std::string, std::optional<shmem::Writer>> writers;
    std::vector<shmem::Writer*> ofChannel;          // null: not played
    bool byClock = false;
    // Buffers are there before their first record, as with those that were recorded.
    const auto open = [&] {
        for (std::size_t i = ofChannel.size(); i < in.channels().size(); ++i) {
            const Channel& c = in.channels()[i];
            ofChannel.push_back(nullptr);
            if (!plan.wants(c.key)) continue;
            auto& writer = writers[c.key];
            for (std::size_t k = 0; k < i; ++k)     // another shape under the same key takes its place
                if (in.channels()[k].key == c.key) ofChannel[k] = nullptr;
            writer.reset();
            writer.emplace(plan.prefix + c.key, c.shape, plan.program);
            ofChannel[i] = &*writer;
            byClock = byClock || c.key == plan.clock;
        }
    };

    Figures figures;
    const std::int64_t begun = shmem::nanoseconds();
    double passed = 0;                              // [s] of the recording
    std::optional<double> last;                     // time of the clock's latest record
    while (in.next(r)) {
        open();
        shmem::Writer* writer = ofChannel[r.channel];
        if (!writer) continue;
        if (!byClock) {
            passed = std::max(passed, double(r.stamp.monotonic - in.head().monotonic) / 1e9);
        } else if (in.channels()[r.channel].key == plan.clock && !r.floats.empty()) {
            if (last && r.floats[0] > *last) passed += r.floats[0] - *last;        // back: the hardware was started again
            last = r.floats[0];
        }
        if (!job.rest(plan.speed > 0 ? begun + std::int64_t(passed / plan.speed * 1e9) : 0)) break;
        writer->write(r.floats.data(), r.any.data());
        ++figures.records;
    }
    figures.buffers = writers.size();
    return figures;
}

// ---- looking at it ----

Figures exportTables(Job& job, const Plan& plan) {
    RecordingReader in(plan.file, plan.partial);
    Figures figures;
    std::vector<File> files;
    std::map<std::string, int> keys;
    std::string line;
    Record r;
    while (in.next(r) && job.rest(0)) {
        for (std::size_t i = files.size(); i < in.channels().size(); ++i) {
            const Channel& c = in.channels()[i];
            files.emplace_back();
            if (!plan.wants(c.key)) continue;
            const int before = keys[c.key]++;       // of another shape
            const std::string file = plan.folder + "/" + c.key + (before > 0 ? "." + std::to_string(before + 1) : "") + ".csv";
            files[i].reset(std::fopen(file.c_str(), "w"));
            if (!files[i]) throw FileError("cannot write " + file + ": " + std::strerror(errno));
            line = "counter,seconds";
            for (std::size_t k = 0; k < c.shape.floats; ++k) line += ",float" + std::to_string(k);
            std::fputs((line + "\n").c_str(), files[i].get());
        }
        if (!files[r.channel]) continue;
        line = std::to_string(r.stamp.counter) + "," + sorma::numberText(double(r.stamp.monotonic - in.head().monotonic) / 1e9);
        for (double x : r.floats) line += "," + (std::isnan(x) ? std::string("NaN") : sorma::numberText(x));
        std::fputs((line + "\n").c_str(), files[r.channel].get());
        ++figures.records;
    }
    for (auto& f : files)
        if (f && (std::fflush(f.get()) != 0 || std::ferror(f.get())))
            throw FileError("cannot write tables in " + plan.folder + ": " + std::strerror(errno));
    figures.buffers = keys.size();
    return figures;
}

Figures list(Job& job, const Plan& plan, std::string& text) {
    RecordingReader in(plan.file, plan.partial);
    struct Seen {
        std::uint64_t records = 0, first = 0, last = 0;
        std::int64_t from = 0, until = 0;
    };
    std::vector<Seen> seen;
    Record r;
    Figures figures;
    while (in.next(r) && job.rest(0)) {
        seen.resize(in.channels().size());
        Seen& s = seen[r.channel];
        if (s.records++ == 0) s.first = r.stamp.counter, s.from = r.stamp.monotonic;
        s.last = r.stamp.counter;
        s.until = r.stamp.monotonic;
        ++figures.records;
    }
    seen.resize(in.channels().size());
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const Channel& c = in.channels()[i];
        const Seen& s = seen[i];
        if (!plan.wants(c.key)) continue;
        const std::uint64_t missing = s.records > 0 ? s.last - s.first + 1 - s.records : 0;
        text += (text.empty() ? "" : "\n") + c.key + " floats " + std::to_string(c.shape.floats) + " any " +
                std::to_string(c.shape.any) + " records " + std::to_string(s.records) + " seconds " +
                sorma::numberText(double(s.until - s.from) / 1e9) + " missing " + std::to_string(missing);
        ++figures.buffers;
    }
    return figures;
}

}  // namespace recorder
