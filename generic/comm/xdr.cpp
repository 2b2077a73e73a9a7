#include "comm/apart.h"

namespace sorma {

namespace {

#ifdef __x86_64__
// Four words at a time: a third of the time of one by one, where the numbers are in the cache. Packages are built for processors without AVX2, so
// this is asked at run time.
[[gnu::target("avx2")]] std::size_t swapFours(char* to, const char* from, std::size_t words) {
    typedef unsigned char Bytes [[gnu::vector_size(32)]];
    std::size_t done = 0;
    for (; done + 4 <= words; done += 4) {
        Bytes four;
        std::memcpy(&four, from + 8 * done, 32);
        four = __builtin_shufflevector(four, four, 7, 6, 5, 4, 3, 2, 1, 0, 15, 14, 13, 12, 11, 10, 9, 8, 23, 22, 21, 20, 19, 18, 17, 16, 31, 30, 29,
                                       28, 27, 26, 25, 24);
        std::memcpy(to + 8 * done, &four, 32);
    }
    return done;
}
#endif

}  // namespace

void swapMany(char* to, const char* from, std::size_t words) {
    std::size_t done = 0;
#ifdef __x86_64__
    static const bool fours = __builtin_cpu_supports("avx2");
    if (fours) done = swapFours(to, from, words);
#endif
    for (; done < words; ++done) swapWords(to + 8 * done, from + 8 * done, 1);
}

XdrReader::XdrReader(std::string_view record, record::Apart& apart) : XdrReader(record) {
    hole_ = record.data() + apart.at();
    apart_ = &apart;
}

template <class T> void XdrReader::takeApart(std::vector<T>& out) {
    hole_ = nullptr;
    if (!apart_ || !apart_->give(out)) spoil();
}
template void XdrReader::takeApart(std::vector<double>& out);
template void XdrReader::takeApart(std::vector<std::int64_t>& out);

}  // namespace sorma
