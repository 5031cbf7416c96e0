#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "runner.h"

#define MAX_TIMED 64

enum pace pace = PACE_OFF;

struct timed {
    uint64_t cycle;
    char order[256];
};

static struct timed timed[MAX_TIMED];
static int timed_count;
static const bool never = false;

static size_t from_hex(const char *text, uint8_t *bytes, size_t room)
{
    size_t count = 0;
    unsigned value;
    for (; count < room && sscanf(text, "%2x", &value) == 1; text += 2) {
        bytes[count++] = (uint8_t)value;
    }
    return count;
}

static void print_hex(const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        printf("%02x", bytes[i]);
    }
}

/* The orders that may also come at a cycle. */
static bool do_now(const char *order)
{
    static uint8_t bytes[1 << 16];
    unsigned value;
    int read = 0;
    if (!strcmp(order, "interlock open") || !strcmp(order, "interlock closed")) {
        board_interlock(order[10] == 'o');
    } else if (sscanf(order, "reset %u", &value) == 1) {
        board_reset((uint8_t)value);
    } else if (!strncmp(order, "send ", 5)) {
        serial_send(bytes, from_hex(order + 5, bytes, sizeof bytes));
    } else if (sscanf(order, "poke %u %n", &value, &read) == 1 && read) {
        size_t count = from_hex(order + read, bytes, sizeof bytes);
        for (size_t i = 0; i < count; i++) {
            board_poke((uint16_t)(value + i), bytes[i]);
        }
    } else {
        return false;
    }
    return true;
}

static avr_cycle_count_t alarm_rings(struct avr_t *of, avr_cycle_count_t when, void *parameter)
{
    (void)of;
    (void)when;
    (void)parameter;
    for (int i = 0; i < timed_count;) {
        if (timed[i].cycle > board_cycle()) {
            i++;
            continue;
        }
        struct timed due = timed[i];
        timed[i] = timed[--timed_count];
        do_now(due.order);
    }
    order_attach();
    return 0;
}

void order_attach(void)
{
    uint64_t soonest = UINT64_MAX;
    for (int i = 0; i < timed_count; i++) {
        soonest = timed[i].cycle < soonest ? timed[i].cycle : soonest;
    }
    avr_cycle_timer_cancel(avr, alarm_rings, NULL);
    if (timed_count) {
        uint64_t now = board_cycle();
        avr_cycle_timer_register(avr, soonest > now ? soonest - now : 1, alarm_rings, NULL);
    }
}

static bool schedule(const char *line)
{
    unsigned long long cycle;
    int read = 0;
    if (sscanf(line, "at %llu %n", &cycle, &read) != 1 || !read || timed_count == MAX_TIMED) {
        return false;
    }
    timed[timed_count].cycle = cycle;
    snprintf(timed[timed_count].order, sizeof timed[0].order, "%s", line + read);
    timed_count++;
    order_attach();
    return true;
}

/* run CYCLES, or: line CYCLES, which stops behind the first line end that the box sends. */
static void run(const char *line, unsigned long long cycles)
{
    const uint8_t *bytes;
    serial_poll();
    board_run(board_cycle() + cycles, line[0] == 'l' ? &serial_line_ended : &never);
    printf("ok %llu ", (unsigned long long)board_cycle());
    size_t count = serial_taken(&bytes);
    print_hex(bytes, count);
    printf("\n");
    serial_taken_clear();
}

static void peek(unsigned address, unsigned count)
{
    printf("ok ");
    print_hex(avr->data + address, count);
    printf("\n");
}

bool order_do(char *line)
{
    unsigned long long cycles;
    unsigned address, count;
    line[strcspn(line, "\n")] = 0;
    if (sscanf(line, "run %llu", &cycles) == 1 || sscanf(line, "line %llu", &cycles) == 1) {
        run(line, cycles);
    } else if (sscanf(line, "peek %u %u", &address, &count) == 2) {
        peek(address, count);
    } else if (!strncmp(line, "pace ", 5)) {
        pace = line[5] == 'r' ? PACE_REAL : line[5] == 'f' ? PACE_FULL : PACE_OFF;
        printf("ok\n");
    } else if (!strcmp(line, "cycle")) {
        printf("ok %llu\n", (unsigned long long)board_cycle());
    } else if (!strcmp(line, "quit")) {
        return false;
    } else {
        printf(do_now(line) || schedule(line) ? "ok\n" : "error %s\n", line);
    }
    board_log_flush();
    fflush(stdout);
    return true;
}
