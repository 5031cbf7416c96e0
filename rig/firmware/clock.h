/* The box's clock: 48 bits of 0.5 us ticks, Timer1 and a count of its overflows. */
#ifndef CLOCK_H
#define CLOCK_H

#include <avr/io.h>
#include <stdint.h>

struct instant {
    uint32_t low;
    uint16_t high;
};

/* A number as two halves: shifting halves into place costs the edge interrupt time. */
union halves {
    uint32_t all;
    struct {
        uint16_t low;
        uint16_t high;
    };
};

extern volatile union halves clock_overflows;

void clock_start(void);

/* The low 32 bits, which wrap every 36 minutes: for differences only. */
uint32_t clock_ticks(void);

struct instant clock_now(void);

/* The full instant of a tick count noted less than 30 minutes ago. */
struct instant clock_instant(uint32_t ticks);

void instant_add(struct instant *instant, uint32_t ticks);

/* For interrupts, and for code that has switched them off. An overflow that happened but is not
 * counted yet shows in TOV1; without it a reading just after one would be 33 ms too early. */
static inline __attribute__((always_inline)) uint32_t clock_ticks_locked(void)
{
    union halves ticks;
    ticks.low = TCNT1;
    ticks.high = clock_overflows.low;
    if ((TIFR1 & _BV(TOV1)) && ticks.low < 0x8000) {
        ticks.high++;
    }
    return ticks.all;
}

#endif
