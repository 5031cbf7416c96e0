#include "interlock.h"

#include <util/atomic.h>

#include "clock.h"

#define SETTLE_TICKS (10 * TICKS_PER_MS)

volatile bool interlock_opened;
static bool closed;
static uint32_t open_seen;

void interlock_start(void)
{
    PCMSK0 = _BV(PCINT4);
    PCICR = _BV(PCIE0);
    closed = !interlock_open_now();
}

bool interlock_closed(void)
{
    return closed;
}

bool interlock_poll(void)
{
    bool opened = interlock_open_now();
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        opened |= interlock_opened;
        interlock_opened = false;
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
