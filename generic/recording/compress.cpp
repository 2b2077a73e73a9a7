#include "recording/compress.h"

#ifdef HAVE_ZSTD

#include <zstd.h>

#include <algorithm>
#include <memory>

namespace sorma::recording::compress {

namespace {

constexpr int kLevel = 1;           // 400 MB/s; the next ones cost more than they gain
constexpr std::size_t kStep = 1024 * 1024;

struct Free {
    void operator()(ZSTD_CCtx* c) const { ZSTD_freeCCtx(c); }
    void operator()(ZSTD_DCtx* d) const { ZSTD_freeDCtx(d); }
};

}  // namespace

bool available() { return true; }

bool pack(std::string_view plain, std::string& out) {
    thread_local const std::unique_ptr<ZSTD_CCtx, Free> context(ZSTD_createCCtx());
    if (!context) return false;
    out.resize(ZSTD_compressBound(plain.size()));
    const std::size_t n = ZSTD_compressCCtx(context.get(), out.data(), out.size(), plain.data(), plain.size(), kLevel);
    if (ZSTD_isError(n)) return false;
    out.resize(n);
    return true;
}

// In steps: what a hostile file says of its size costs no memory before it is true.
bool unpack(std::string_view packed, std::size_t plain, std::string& out) {
    thread_local const std::unique_ptr<ZSTD_DCtx, Free> context(ZSTD_createDCtx());
    out.clear();
    if (!context) return false;
    ZSTD_DCtx_reset(context.get(), ZSTD_reset_session_only);
    ZSTD_inBuffer in{packed.data(), packed.size(), 0};
    for (;;) {
        const std::size_t before = out.size(), read = in.pos;
        out.resize(std::min(plain, before + kStep));
        ZSTD_outBuffer to{out.data() + before, out.size() - before, 0};
        const std::size_t left = ZSTD_decompressStream(context.get(), &to, &in);
        out.resize(before + to.pos);
        if (ZSTD_isError(left)) return false;
        if (left == 0) return in.pos == in.size && out.size() == plain;
        if (to.pos == 0 && in.pos == read) return false;        // more is needed, or there is more than was said
    }
}

}  // namespace sorma::recording::compress

#else

namespace sorma::recording::compress {

bool available() { return false; }
bool pack(std::string_view, std::string&) { return false; }
bool unpack(std::string_view, std::size_t, std::string&) { return false; }

}  // namespace sorma::recording::compress

#endif
