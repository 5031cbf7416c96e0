/* The three output ports as one. */
#ifndef PORTS_H
#define PORTS_H

#include <avr/io.h>
#include <stdint.h>

#include "board.h"

/* All outputs low. The status LED stays as it is: it is nobody's shutter. */
static inline __attribute__((always_inline)) void ports_low(void)
{
    PORTB &= (uint8_t)~PORTB_OUTPUTS;
    PORTC = PORTC_REST;
    PORTD = PORTD_REST;
}

/* What is driven now, as a mask of outputs. */
static inline uint16_t ports_pins(uint8_t b, uint8_t c, uint8_t d)
{
    return (uint16_t)((c & PORTC_OUTPUTS) | ((uint16_t)(d & PORTD_OUTPUTS) << 4) |
                      ((uint16_t)(b & PORTB_OUTPUTS) << 12));
}

static inline void status_led(uint8_t on)
{
    if (on) {
        PORTB |= _BV(STATUS_BIT);
    } else {
        PORTB &= (uint8_t)~_BV(STATUS_BIT);
    }
}

#endif
