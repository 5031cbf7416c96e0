#define _GNU_SOURCE
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include "runner.h"

#define SLICE_CYCLES (CLOCK_HZ / 4000)
#define SLICE_NS 250000
#define FORGIVEN_NS 50000000

static uint64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static uint64_t cycles_ns(uint64_t cycles)
{
    return cycles * 125 / 2;
}

/* How long to wait so that the processor is not ahead of the wall clock. A machine too slow for
 * it, or asleep, is forgiven: the processor does not run after lost time. */
static int ahead_ns(void)
{
    static uint64_t epoch; /* wall clock at cycle 0 */
    uint64_t due = epoch + cycles_ns(board_cycle());
    uint64_t now = now_ns();
    if (!epoch || due + FORGIVEN_NS < now || due > now + FORGIVEN_NS) {
        epoch = now - cycles_ns(board_cycle());
        return 0;
    }
    return due > now ? (int)(due - now) : 0;
}

/* Wait for orders and bytes; false when the other side has gone or said so. */
static bool listen_for(int wait_ns)
{
    static char line[1 << 17];
    static size_t length;
    struct pollfd fds[] = {{STDIN_FILENO, POLLIN, 0}, {serial_fd(), POLLIN, 0}};
    struct timespec wait = {0, wait_ns};
    if (ppoll(fds, pace == PACE_OFF ? 1 : 2, wait_ns < 0 ? NULL : &wait, NULL) <= 0) {
        return true;
    }
    if (fds[0].revents) {
        ssize_t count = read(STDIN_FILENO, line + length, sizeof line - 1 - length);
        if (count <= 0) {
            return false;
        }
        length += (size_t)count;
        char *end;
        while ((end = memchr(line, '\n', length))) {
            *end = 0;
            if (!order_do(line)) {
                return false;
            }
            length -= (size_t)(end + 1 - line);
            memmove(line, end + 1, length);
        }
    }
    return true;
}

int main(int count, char **arguments)
{
    static const bool never = false;
    if (count != 3) {
        fprintf(stderr, "usage: %s firmware.elf edges.log\n", arguments[0]);
        return 2;
    }
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const char *port = serial_open();
    board_load(arguments[1], arguments[2]);
    printf("ready %s\n", port);
    fflush(stdout);
    for (;;) {
        int wait_ns = pace == PACE_OFF ? -1 : pace == PACE_FULL ? 0 : ahead_ns();
        if (!listen_for(wait_ns)) {
            return 0;
        }
        if (pace != PACE_OFF && (pace == PACE_FULL || ahead_ns() < SLICE_NS)) {
            serial_poll();
            board_run(board_cycle() + SLICE_CYCLES, &never);
            serial_taken_clear();
            board_log_flush();
        }
    }
}
