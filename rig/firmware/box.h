/* The states of the box, and what leads from one to the other. */
#ifndef BOX_H
#define BOX_H

#include <avr/pgmspace.h>
#include <stdbool.h>
#include <stdint.h>

#include "clock.h"
#include "errors.h"
#include "results.h"

enum state { STATE_IDLE, STATE_ARMED, STATE_FIRING, STATE_FAULT };

struct arming {
    char cap[CAPTURE_ID_SIZE];
    uint16_t mask;
    uint8_t shots;
    uint32_t interval;
    uint32_t lead;
    uint32_t hold_ms;
    uint16_t dead_man_ms; /* 0: it fires to the end, whoever is there */
};

enum state box_state(void);
PGM_P state_name(void);

/* Why it is in FAULT: one of enum why. */
uint8_t box_fault_why(void);

/* The capture armed or last known; NULL when there is none. */
struct result *box_capture(void);

/* The capture whose edges and shots can be told; NULL when there is none. */
struct result *box_told(void);

/* When shot k, from 1, of that capture began. */
struct instant box_shot_start(uint8_t k);

/* Why it is not IDLE, as an error; E_NONE when it is. */
enum error box_not_idle(void);

/* Make the edge list and arm. E_RANGE is about the interval. */
enum error box_arm(const struct arming *arming);

/* The checks are the caller's: the state must be ARMED. E_FAULT when the interlock just opened. */
enum error box_fire(struct instant *start);

void box_disarm(void);
void box_abort(void);
void box_reset(void);

/* A request has come whole, its end at a tick: the host is alive. */
void box_heard(uint32_t tick);

/* Why not so soon: milliseconds for which a strobe must rest still. */
uint16_t box_rest_ms(void);

/* Do what time and pins ask for; call often. */
void box_poll(void);

/* Whether box_poll has something to do that no interrupt will announce again. */
bool box_pending(void);

#endif
