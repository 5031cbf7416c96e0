#include "clock.h"

#include <avr/interrupt.h>
#include <util/atomic.h>

volatile union halves clock_overflows;

ISR(TIMER1_OVF_vect)
{
    clock_overflows.all++;
}

/* Normal mode, never stopped and never set: a timer that is written to loses ticks. */
void clock_start(void)
{
    TIMSK1 = _BV(TOIE1);
    TCCR1A = 0;
    TCCR1B = _BV(CS11);
}

uint32_t clock_ticks(void)
{
    uint32_t ticks;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        ticks = clock_ticks_locked();
    }
    return ticks;
}

struct instant clock_now(void)
{
    struct instant now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        uint32_t overflows = clock_overflows.all;
        uint16_t low = TCNT1;
        if ((TIFR1 & _BV(TOV1)) && low < 0x8000) {
            overflows++;
        }
        now.low = (overflows << 16) | low;
        now.high = (uint16_t)(overflows >> 16);
    }
    return now;
}

struct instant clock_instant(uint32_t ticks)
{
    struct instant instant = clock_now();
    if (ticks > instant.low) {
        instant.high--; /* noted before the low half wrapped */
    }
    instant.low = ticks;
    return instant;
}

void instant_add(struct instant *instant, uint32_t ticks)
{
    instant->low += ticks;
    if (instant->low < ticks) {
        instant->high++;
    }
}
