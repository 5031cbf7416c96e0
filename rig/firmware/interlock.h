/* The interlock: a contact to ground. Open, nothing fires. */
#ifndef INTERLOCK_H
#define INTERLOCK_H

#include <avr/io.h>
#include <avr/pgmspace.h>
#include <stdbool.h>
#include <stdint.h>

#include "board.h"

/* A flash's pulse couples into the wires for less than this; a contact opens for longer. */
#define GLITCH_READINGS 12 /* 5 cycles each: 4 us */

/* It opened, and interlock_poll has not said so yet. Set by whoever sees it first. */
extern volatile bool interlock_opened;

void interlock_start(void);

/* What the box says of it: opens at once, closes when it has been closed for 10 ms. */
bool interlock_closed(void);

/* Follow the contact; call often. Answers whether it has opened since the last call. */
bool interlock_poll(void);

PGM_P interlock_name(bool closed);

/* One reading: open, or a glitch. */
static inline __attribute__((always_inline)) bool interlock_reads_open(void)
{
    return PINB & _BV(INTERLOCK_BIT);
}

/* Whether it is open and no glitch; takes 4 us when it is. */
static inline __attribute__((always_inline)) bool interlock_open_now(void)
{
    for (uint8_t i = 0; i < GLITCH_READINGS; i++) {
        if (!interlock_reads_open()) {
            return false;
        }
    }
    return true;
}

/* Whether it opened and interlock_poll has not said so yet. For code with interrupts off. */
static inline bool interlock_tripped(void)
{
    return interlock_opened || interlock_open_now();
}

#endif
