#include "interlock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board.h"
#include "burst.h"
#include "clock.h"

#define SETTLE_TICKS (10 * TICKS_PER_MS)

/* A flash's pulse couples into the wires for less than this; a contact opens for longer. */
#define GLITCH_READINGS 12 /* 5 cycles each: 4 us */

static volatile bool tripped;
static bool closed;
static uint32_t open_seen;

static inline __attribute__((always_inline)) bool open_now(void)
{
    for (uint8_t i = 0; i < GLITCH_READINGS; i++) {
        if (!(PINB & _BV(INTERLOCK_BIT))) {
            return false;
        }
    }
    return true;
}

/* Stops the pulses itself: the main loop may be waiting for the serial line. */
ISR(PCINT0_vect)
{
    if (open_now()) {
        burst_stop();
        tripped = true;
    }
}

void interlock_start(void)
{
    PCMSK0 = _BV(PCINT4);
    PCICR = _BV(PCIE0);
    closed = !open_now();
}

bool interlock_closed(void)
{
    return closed;
}

bool interlock_tripped(void)
{
    return tripped || open_now();
}

bool interlock_poll(void)
{
    bool opened = open_now();
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        opened |= tripped;
        tripped = false;
    }
    if (opened) {
        open_seen = clock_ticks();
        closed = false;
    } else if (!closed && clock_ticks() - open_seen >= SETTLE_TICKS) {
        closed = true;
    }
    return opened;
}

PGM_P interlock_name(bool is_closed)
{
    return is_closed ? PSTR("CLOSED") : PSTR("OPEN");
}
