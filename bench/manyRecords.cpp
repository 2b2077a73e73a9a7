// manyRecords.cpp -- makes the file of a recording of so many records: an hour of requests and replies at 200 objects of four daemons.
//
//     bench/manyRecords FILE RECORDS
//
// One request in 5000 has failed, and has a trail. One in 1000 takes a second. The random numbers are the same each time.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <random>
#include <string>

#include "bus/message.h"
#include "recording/writer.h"

using namespace sorma;
using namespace sorma::recording;

namespace {

constexpr std::int64_t kBegan = 1'700'000'000'000'000'000, kHour = 3'600'000'000'000;      // [ns]

void make(const std::string& file, std::int64_t records) {
    constexpr unsigned kSources = 4, kObjects = 50, kFails = 5000, kLong = 1000;
    const std::string sources[kSources] = {"robot", "vision", "cell", "speech"};
    std::string objects[kObjects];
    for (unsigned i = 0; i < kObjects; ++i) objects[i] = (i % 2 ? "carry.c" : "pump.p") + std::to_string(i);
    struct Reply {
        unsigned source, object;
        std::uint64_t number;
        std::int64_t began;
        bool failed;
    };
    std::multimap<std::int64_t, Reply> replies;
    std::mt19937_64 random(36);
    Writer writer(file);
    Block block;
    Message request, reply, error;
    request.floats = {1.5};
    reply.ints = {7};
    error.code = -1;
    Entry entry;
    entry.symbol = "OPTION RANGE", entry.details = {"pump", "-rate"}, entry.text = "-rate 7 is outside 0.01 .. 1.5";
    error.trail.add(entry);
    const auto add = [&](const Facts& facts, const Message& m) {
        block.add(facts, &m);
        if (block.full()) writer.write(block);
    };
    const auto answer = [&](std::int64_t until) {
        for (; !replies.empty() && replies.begin()->first <= until; replies.erase(replies.begin())) {
            const auto& [time, r] = *replies.begin();
            add({Kind::reply, Method::exec, sources[r.source], objects[r.object], {}, r.failed ? -1 : 0, time, r.number, time - r.began}, r.failed ? error : reply);
        }
    };
    const std::int64_t requests = records / 2, step = kHour / (requests > 0 ? requests : 1);
    for (std::int64_t i = 0; i < requests; ++i) {
        const std::int64_t time = kBegan + i * step;
        answer(time);
        const unsigned source = unsigned(random() % kSources), object = unsigned(random() % kObjects);
        const std::int64_t took = random() % kLong == 0 ? 1'000'000'000 : 20'000 + std::int64_t(random() % 400'000);
        request.floats[0] = double(i);
        add({Kind::request, Method::exec, sources[source], objects[object], "anna@lab", 0, time, std::uint64_t(i + 1)}, request);
        replies.emplace(time + took, Reply{source, object, std::uint64_t(i + 1), time, random() % kFails == 0});
    }
    answer(INT64_MAX);
    if (!block.empty()) writer.write(block);
    writer.close();
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3) return std::fprintf(stderr, "usage: manyRecords FILE RECORDS\n"), 2;
    try {
        make(argv[1], std::atoll(argv[2]));
    } catch (const std::exception& e) {
        return std::fprintf(stderr, "manyRecords: %s\n", e.what()), 1;
    }
}
