/* What the box says by itself: numbered, kept for LOG?, and sent when the line is free. */
#ifndef EVENTS_H
#define EVENTS_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"
#include "clock.h"
#include "results.h"

enum event_kind {
    EVENT_BOOT,
    EVENT_ARMED,
    EVENT_DONE,
    EVENT_FIRED,
    EVENT_DISARMED,
    EVENT_EXPIRED,
    EVENT_ABORTED,
    EVENT_FAULT,
    EVENT_INTERLOCK,
};

/* Note an event. Of `result` the name is taken, and what belongs to the kind. */
void events_add(enum event_kind kind, const struct result *result, uint8_t detail);

/* As above for DONE, of the shot before last counted from 1. */
void events_add_done(const struct result *result, uint8_t shot, struct instant start, uint8_t late);

/* BOOT, whose count and id do not fit elsewhere. */
void events_add_boot(uint32_t boot, uint16_t id, uint8_t cause);

/* Send the oldest event not sent yet; whether there was one. */
bool events_send(void);

/* Whether an event is still kept. */
bool events_kept(uint16_t number);

/* Say an event that is kept: ev=, name= and its fields. */
void events_say(uint16_t number);

/* Number of the last event; 0 before the first. */
uint16_t events_last(void);

#endif
