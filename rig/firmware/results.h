/* What became of the last captures. Kept in RAM that a reset does not clear.
 *
 * A reset may come between any two instructions. So the part that is written while firing is made
 * of single bytes whose every value means something, and the instant is there before the phase
 * that says it counts. Only what ARM writes once is covered by a checksum. */
#ifndef RESULTS_H
#define RESULTS_H

#include <avr/pgmspace.h>
#include <stdbool.h>
#include <stdint.h>

#include "board.h"
#include "clock.h"

#define RESULTS 4

/* Far apart, so that a byte gone wrong is none of them. */
enum phase {
    PHASE_ARMED = 0x1E,
    PHASE_FIRING = 0x2D,
    PHASE_FIRED = 0x4B,
    PHASE_PARTIAL = 0x78,
    PHASE_NOT_FIRED = 0x87,
};

/* Why a capture, or what is armed, came to its end before its time. */
enum why {
    WHY_NONE,
    WHY_TTL,
    WHY_SILENCE,
    WHY_INTERLOCK,
    WHY_OVERTIME,
    WHY_DISARM,
    WHY_ABORT,
    WHY_RESET,
};

PGM_P why_name(uint8_t why);

struct result {
    char cap[CAPTURE_ID_SIZE]; /* padded with NULs */
    uint32_t boot;
    uint16_t age; /* counts captures, over resets */
    uint8_t of;
    uint16_t check; /* of all above */
    volatile uint8_t phase;
    volatile uint8_t shots;
    volatile uint8_t late;
    volatile uint8_t why; /* an enum why, before the phase that it explains */
    struct instant start; /* zero until fired */
};

/* It ends before its time. */
void result_end(struct result *result, enum phase phase, enum why why);

/* After a start: drop what is not whole, close what was open. */
void results_start(void);

/* A new result in place of the oldest. */
struct result *results_add(const char *cap, uint8_t of, uint32_t boot);

/* By name, padded; NULL when it is not among the last. */
struct result *results_find(const char *cap);

/* The newest; NULL when there is none. */
struct result *results_newest(void);

PGM_P phase_name(uint8_t phase);

#endif
