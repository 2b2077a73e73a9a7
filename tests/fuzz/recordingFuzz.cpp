// recordingFuzz.cpp -- a hostile recording. The file: reading ends. As records of a block: what can be read is a message, and written
// again it gives the same.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <string>

#include "mend.h"
#include "recording/reader.h"
#include "recording/writer.h"

using namespace sorma;
using namespace sorma::recording;

namespace {

std::string readAll(const std::string& file) {
    std::string seen;
    try {
        Reader reader(file);
        Message m;
        for (Record r; reader.next(r);) seen += r.read(m) ? std::to_string(m.text.size() + m.words.size()) : "-";
        for (auto& d : reader.damages())
            if (d.at + d.bytes > reader.bytes()) std::abort();
    } catch (const FileError&) {
        seen = "refused";
    }
    return seen;
}

void asRecord(std::string_view bytes) {
    Record r;
    r.content = bytes.substr(1);
    r.parts = std::uint8_t(bytes[0]);
    Message m, again;
    if (!r.read(m)) return;
    Block block;
    if (!block.add({}, &m)) return;
    BlockReader reader(block.finish(1, 2), 1, 2);
    Record read;
    if (!reader.next(read) || !read.read(again)) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    static const int fd = memfd_create("recording", 0);
    static const std::string file = "/proc/self/fd/" + std::to_string(fd);
    std::string bytes(reinterpret_cast<const char*>(data), size);
    asRecord(bytes);
    for (const bool mended : {false, true}) {
        if (mended) {
            mend<FileHead>(bytes, 0);
            mend<BlockHead>(bytes, sizeof(FileHead));
            if (bytes.size() >= sizeof(FileEnd)) mend<FileEnd>(bytes, bytes.size() - sizeof(FileEnd));
        }
        if (ftruncate(fd, 0) != 0 || pwrite(fd, bytes.data(), bytes.size(), 0) != ssize_t(bytes.size())) std::abort();
        readAll(file);
    }
    return 0;
}
