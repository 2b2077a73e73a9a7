// alone.cpp KEY -- a program that has nothing to do with SORMA but for a snapshot buffer, which it writes and reads in place.
//
// Ends with its standard input. tests/install.test builds it with what is installed.
#include <shmem/ring.h>

#include <cstdio>
#include <exception>

int main(int, char** argv) {
    try {
        shmem::Writer writer(argv[1], {.blocks = 4, .floats = 3, .any = 0}, "alone");
        for (int i = 1; i <= 10; ++i) {
            auto& block = writer.begin();
            for (int k = 0; k < 3; ++k) block.floats()[k] = i * k;
            writer.end(block);
        }
        shmem::Reader reader(argv[1]);
        double sum = 0;
        auto view = reader.view(reader.count());
        for (std::uint64_t k = 0; k < reader.shape().floats; ++k) sum += view.floats[k];
        std::printf("record %d: %g %s\n", int(view.stamp.counter), sum, view.valid() ? "valid" : "overwritten");
        std::fflush(stdout);
        std::getchar();
    } catch (const std::exception& e) {
        std::printf("%s\n", e.what());
        return 1;
    }
}
