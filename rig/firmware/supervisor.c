#include "supervisor.h"

#include <string.h>

#include "board.h"
#include "clock.h"
#include "ports.h"

/* Counted in overflows of the timer, 33 ms each. Two more than the limit needs, because a pulse
 * begins and is seen between them. */
#define LIMIT(width) ((width) / TICKS_PER_OVERFLOW + 2)

_Static_assert(LIMIT(MAX_WIDTH) < 255, "counted in bytes");

static uint8_t held[OUTPUTS];
static uint8_t last_look;
static uint8_t last_round;

static uint8_t limit(uint8_t output)
{
    bool strobe = output >= FIRST_STROBE && output <= LAST_STROBE;
    return strobe ? LIMIT(MAX_STROBE_WIDTH) : LIMIT(MAX_WIDTH);
}

bool supervisor_overtime(uint8_t round)
{
    uint8_t look = (uint8_t)clock_overflows.low;
    uint8_t passed = look - last_look;
    uint16_t pins = ports_pins(PORTB, PORTC, PORTD);
    bool overtime = false;
    last_look = look;
    if (round != last_round) {
        last_round = round;
        memset(held, 0, sizeof held);
    }
    for (uint8_t i = 0; i < OUTPUTS; i++, pins >>= 1) {
        if (!(pins & 1)) {
            held[i] = 0;
        } else if (passed > limit(i + 1) - held[i]) {
            overtime = true;
        } else {
            held[i] += passed;
        }
    }
    return overtime;
}
