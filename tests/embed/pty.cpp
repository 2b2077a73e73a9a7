// pty ROWS COLUMNS COMMAND ...  -- a program in a pseudo-terminal of its own, for who has only pipes.
//
// Prints "PID DEVICE" first. Then: standard input is what is typed, standard output what the terminal is sent. When
// standard input ends the terminal hangs up. Ends as the program did: with its exit code, or by the same signal.
#include <poll.h>
#include <pty.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>

namespace {

// False: nobody takes it any more.
bool writeAll(int fd, const char* data, ssize_t size) {
    while (size > 0) {
        ssize_t n = write(fd, data, static_cast<size_t>(size));
        if (n < 0) return false;
        data += n;
        size -= n;
    }
    return true;
}

// What is typed goes to the terminal and what the program says out, until one of them ends.
void relay(int terminal) {
    char buffer[4096];
    pollfd both[2] = {{STDIN_FILENO, POLLIN, 0}, {terminal, POLLIN, 0}};
    while (poll(both, 2, -1) > 0) {
        if (both[1].revents) {
            ssize_t n = read(terminal, buffer, sizeof buffer);
            if (n <= 0 || !writeAll(STDOUT_FILENO, buffer, n)) return;
        }
        if (both[0].revents) {
            ssize_t n = read(STDIN_FILENO, buffer, sizeof buffer);
            if (n <= 0 || !writeAll(terminal, buffer, n)) return;
        }
    }
}

} // namespace

int main(int argc, char** argv) {
    if (argc < 4) {
        fputs("usage: pty ROWS COLUMNS COMMAND ...\n", stderr);
        return 2;
    }
    signal(SIGPIPE, SIG_IGN);
    winsize size{};
    size.ws_row = static_cast<unsigned short>(atoi(argv[1]));
    size.ws_col = static_cast<unsigned short>(atoi(argv[2]));
    int terminal = -1;
    char device[64];
    pid_t child = forkpty(&terminal, device, nullptr, &size);
    if (child < 0) {
        perror("pty");
        return 1;
    }
    if (child == 0) {
        signal(SIGPIPE, SIG_DFL);
        execvp(argv[3], argv + 3);
        perror(argv[3]);
        _exit(127);
    }
    printf("%d %s\n", static_cast<int>(child), device);
    fflush(stdout);
    relay(terminal);
    close(terminal);
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status)) {
        rlimit none{0, 0};          // the program's core is enough
        setrlimit(RLIMIT_CORE, &none);
        signal(WTERMSIG(status), SIG_DFL);
        raise(WTERMSIG(status));
    }
    return WEXITSTATUS(status);
}
