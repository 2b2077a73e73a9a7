#include "recording.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "bus/fnv.h"
#include <recording/crc32c.h>

namespace recorder {

namespace {

using sorma::crc32c;

constexpr std::size_t kMostKey = 200;

struct ChannelText {                // as it stands in the file
    std::uint64_t blocks, floats, any;
    char key[kMostKey + 8];
};

std::uint32_t sumOfVersion1(const void* bytes, std::size_t n, std::uint32_t before) {
    sorma::Fnv<std::uint32_t> hash(before);
    hash.add(bytes, n);
    return hash.value();
}
std::uint32_t checkOf(Head head) {
    head.check = 0;
    return crc32c(&head, sizeof head);
}

// A key becomes a file's name when it is exported, so what is in the file is not trusted.
bool isKey(const std::string& key) {
    if (key.empty() || key.size() > kMostKey || key[0] == '.') return false;
    for (unsigned char c : key)
        if (c == '/' || c < ' ') return false;
    return true;
}

}  // namespace

// ---- writing ----

RecordingWriter::RecordingWriter(std::string file) : file_(std::move(file)), out_(std::fopen(file_.c_str(), "wb")) {
    if (!out_) throw FileError("cannot write " + file_ + ": " + std::strerror(errno));
    Head head;
    head.monotonic = shmem::nanoseconds();
    head.wall = shmem::nanoseconds(CLOCK_REALTIME) / 1000;
    head.check = checkOf(head);
    put(&head, sizeof head);
    flush();
}

void RecordingWriter::put(const void* bytes, std::size_t n) {
    if (n > 0 && std::fwrite(bytes, n, 1, out_.get()) != 1)
        throw FileError("cannot go on writing " + file_ + ": " + std::strerror(errno) + "; what is before is whole (-partial)");
}
void RecordingWriter::put(Frame frame, const void* a, std::size_t aBytes, const void* b, std::size_t bBytes) {
    frame.check = 0;
    frame.check = crc32c(b, bBytes, crc32c(a, aBytes, crc32c(&frame, sizeof frame)));
    put(&frame, sizeof frame);
    put(a, aBytes);
    put(b, bBytes);
    ++frames_;
}

std::uint32_t RecordingWriter::announce(const Channel& channel) {
    ChannelText text{channel.shape.blocks, channel.shape.floats, channel.shape.any, {}};
    std::strncpy(text.key, channel.key.c_str(), kMostKey);
    Frame frame;
    frame.channel = Frame::kNewChannel;
    put(frame, &text, sizeof text);
    return channels_++;
}

void RecordingWriter::write(const Record& r) {
    Frame frame;
    frame.channel = r.channel;
    frame.counter = r.stamp.counter;
    frame.monotonic = r.stamp.monotonic;
    frame.wall = r.stamp.wall;
    put(frame, r.floats.data(), r.floats.size() * sizeof(double), r.any.data(), r.any.size());
}

void RecordingWriter::flush() {
    if (std::fflush(out_.get()) != 0) throw FileError("cannot go on writing " + file_ + ": " + std::strerror(errno));
}

void RecordingWriter::close() {
    Frame frame;
    frame.channel = Frame::kEnd;
    frame.counter = frames_;
    put(frame, nullptr, 0);
    flush();
}

// ---- reading ----

RecordingReader::RecordingReader(std::string file, bool partial)
    : file_(std::move(file)), partial_(partial), in_(std::fopen(file_.c_str(), "rb")) {
    if (!in_) throw FileError("cannot read " + file_ + ": " + std::strerror(errno));
    if (std::fseek(in_.get(), 0, SEEK_END) == 0) size_ = std::uint64_t(std::max(std::ftell(in_.get()), 0L));
    std::rewind(in_.get());
    const bool whole = std::fread(&head_, sizeof head_, 1, in_.get()) == 1;
    Head first;
    first.magic[16] = '1';
    if (whole && std::memcmp(head_.magic, Head().magic, sizeof head_.magic) == 0) {
        if (head_.check != recorder::checkOf(head_)) refuse("its head is broken: what it holds does not agree with its check sum");
        sum_ = crc32c;
    } else if (whole && std::memcmp(head_.magic, first.magic, sizeof head_.magic) == 0 && head_.check == 0) {
        sum_ = sumOfVersion1;
        first_ = sorma::Fnv<std::uint32_t>().value();
    } else {
        first.magic[16] = '3';
        const bool ofBus = whole && std::memcmp(head_.magic, first.magic, sizeof head_.magic) == 0;
        refuse(ofBus ? "this is a recording of the bus, not of buffers alone: EXEC records, sorma::at and sorma-replay read it" : "this is no recording");
    }
    if (head_.order != Head().order) refuse("it was recorded by a machine of the other byte order");
    at_ = sizeof head_;
}

void RecordingReader::refuse(const std::string& why) const {
    throw FileError(file_ + " at byte " + std::to_string(at_) + ": " + why);
}

std::uint32_t RecordingReader::checkOf(Frame frame) const {
    frame.check = 0;
    return sum_(&frame, sizeof frame, first_);
}

bool RecordingReader::get(void* to, std::size_t n) {
    if (n == 0 || std::fread(to, n, 1, in_.get()) == 1) return true;
    if (std::ferror(in_.get())) refuse(std::string("cannot read on: ") + std::strerror(errno));
    return cut();
}
bool RecordingReader::cut() const {
    if (partial_) return false;
    refuse("it ends before its end mark: it was cut, or its recorder was killed; -partial 1 takes the " + std::to_string(frames_) +
           " frames before that");
}

bool RecordingReader::next(Record& r) {
    constexpr const char* kBroken = "this frame is broken: what it holds does not agree with its check sum";
    for (;;) {
        Frame frame;
        if (!get(&frame, sizeof frame)) return false;
        std::size_t bytes = 0;
        if (frame.channel == Frame::kEnd) {
            if (frame.check != checkOf(frame)) refuse(kBroken);
            if (frame.counter != frames_)
                refuse("the end mark speaks of " + std::to_string(frame.counter) + " frames, here are " + std::to_string(frames_));
            if (at_ + sizeof frame != size_) refuse("something follows its end mark, which is the last thing in a recording");
            return false;
        } else if (frame.channel == Frame::kNewChannel) {
            ChannelText text;
            if (!get(&text, bytes = sizeof text)) return false;
            if (frame.check != sum_(&text, sizeof text, checkOf(frame))) refuse(kBroken);
            text.key[kMostKey] = 0;
            if (!isKey(text.key)) refuse("\"" + std::string(text.key) + "\" is no key of a buffer");
            if (text.floats > shmem::kMostFloats || text.any > shmem::kMostAny || text.blocks > shmem::kMostBlocks)
                refuse("no buffer can be as large as " + std::string(text.key));
            channels_.push_back({text.key, {text.blocks, text.floats, text.any}});
        } else {
            if (frame.channel >= channels_.size()) refuse(kBroken);
            const shmem::Shape& shape = channels_[frame.channel].shape;
            bytes = shape.floats * sizeof(double) + shape.any;
            // Before anything is allocated for it.
            if (at_ + sizeof frame + bytes > size_) return cut();
            r.channel = frame.channel;
            r.stamp = {frame.counter, frame.monotonic, frame.wall};
            r.floats.resize(shape.floats);
            r.any.resize(shape.any);
            if (!get(r.floats.data(), shape.floats * sizeof(double)) || !get(r.any.data(), shape.any)) return false;
            const std::uint32_t floats = sum_(r.floats.data(), shape.floats * sizeof(double), checkOf(frame));
            if (frame.check != sum_(r.any.data(), shape.any, floats)) refuse(kBroken);
        }
        at_ += sizeof frame + bytes;
        ++frames_;
        if (frame.channel < Frame::kNewChannel) return true;
    }
}

}  // namespace recorder
