/* The board: which pin is which output, and what the box can do.
 *
 * Outputs are numbered as in docs/reference/trigger-protocol.md, from 1; bit 0 of a 16-bit mask is output 1.
 *   1 to 6   PORTC0-5   Arduino A0-A5
 *   7 to 12  PORTD2-7   Arduino 2-7
 *   13, 14   PORTB0-1   Arduino 8, 9     strobes
 *   15, 16   PORTB2-3   Arduino 10, 11   synchronisation LEDs
 */
#ifndef BOARD_H
#define BOARD_H

#define FIRMWARE_VERSION "1.1.0"

#define OUTPUTS 16
#define FIRST_STROBE 13
#define LAST_STROBE 14

#define INTERLOCK_BIT 4 /* PB4, Arduino 12: low is closed */
#define STATUS_BIT 5    /* PB5, Arduino 13: the board's own LED */

#define PORTB_OUTPUTS 0x0F
#define PORTC_OUTPUTS 0x3F
#define PORTD_OUTPUTS 0xFC

/* What the ports hold besides outputs: the interlock's pull-up; pull-ups on the serial pins. */
#define PORTB_REST (1 << INTERLOCK_BIT)
#define PORTC_REST 0x00
#define PORTD_REST 0x03

#define TICK_NS 500
#define TICKS_PER_MS 2000UL
#define TICKS_PER_OVERFLOW 65536UL

#define MAX_DELAY 60000000UL /* 30 s */
#define MAX_WIDTH 16000000UL /* 8 s */
#define MAX_STROBE_WIDTH 200000UL /* 100 ms */
#define MAX_EDGES 32
#define MAX_SHOTS 64
#define MAX_INTERVAL 1000000000UL /* 500 s: half of what a signed 32-bit difference can tell */
#define MAX_HOLD_MS 300000UL
#define MIN_GAP 4
#define MIN_LEAD 2000UL
#define MIN_REST 2000UL /* from a shot's last edge to the next shot's start */
#define SILENCE_MS 3000UL

/* While it fires: how long it goes on without a sign of life of the host. */
#define DEAD_MAN_MS 3000
#define MIN_DEAD_MAN_MS 500
#define MAX_DEAD_MAN_MS 30000

/* Of a strobe: least time from the end of a pulse to the next one's begin, and the largest part of
 * the time for which it may be on, as one in so many. */
#define STROBE_REST 8000UL /* 4 ms */
#define STROBE_DUTY 4

#define CAPTURE_ID_SIZE 12
#define NAME_SIZE 16
#define LINE_SIZE 95

#endif
