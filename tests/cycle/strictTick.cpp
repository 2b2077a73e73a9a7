// strictTick -- preloaded by a test: a program in which a tick of a cycle takes memory or a lock ends, and says so.
#include <dlfcn.h>
#include <pthread.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

namespace {

thread_local bool inTick = false;

void refuse(const char* what) {
    if (!inTick) return;
    inTick = false;
    const char* text[] = {"strictTick: ", what, " in a tick\n"};
    for (auto* t : text)
        if (write(STDERR_FILENO, t, std::strlen(t)) < 0) break;
    std::_Exit(99);
}

}  // namespace

extern "C" {

void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void __libc_free(void*);

void sormaTickMark(bool inside) { inTick = inside; }

void* malloc(size_t n) { return refuse("malloc"), __libc_malloc(n); }
void* calloc(size_t n, size_t size) { return refuse("calloc"), __libc_calloc(n, size); }
void* realloc(void* p, size_t n) { return refuse("realloc"), __libc_realloc(p, n); }
void free(void* p) {
    if (p) refuse("free");
    __libc_free(p);
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
    static auto* real = reinterpret_cast<int (*)(pthread_mutex_t*)>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
    refuse("pthread_mutex_lock");
    return real(mutex);
}

}
