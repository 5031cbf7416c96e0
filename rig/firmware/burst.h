/* Plays the edge list, shot after shot, from the timer's interrupt. */
#ifndef BURST_H
#define BURST_H

#include <stdint.h>

#include "clock.h"
#include "results.h"

/* Lateness of each shot of the last burst. */
extern uint8_t burst_late[MAX_SHOTS];

/* Start the first shot `lead` ticks from now and answer when that is. `interval` from shot to
 * shot. The list must be made, interrupts must be off. */
struct instant burst_start(struct result *result, uint32_t lead, uint32_t interval);

/* Stop now, all outputs low. May be called when nothing runs, also from an interrupt. */
void burst_stop(void);

/* Which side of struct edge's `late` holds the last complete shot. */
uint8_t burst_side(void);

#endif
