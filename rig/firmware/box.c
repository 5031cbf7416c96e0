#include "box.h"

#include <avr/interrupt.h>
#include <stddef.h>
#include <util/atomic.h>

#include "board.h"
#include "burst.h"
#include "edges.h"
#include "events.h"
#include "interlock.h"
#include "ports.h"
#include "store.h"
#include "supervisor.h"

static uint8_t state;
static uint8_t fault_why;
static struct result *current; /* of the last ARM since the start */
static struct arming armed;
static uint32_t armed_at;
static uint32_t heard_at;
static uint8_t told_shots; /* DONE events so far */
static bool telling;       /* events of a burst are still to come */

enum state box_state(void)
{
    return state;
}

PGM_P state_name(void)
{
    switch (state) {
    case STATE_IDLE:
        return PSTR("IDLE");
    case STATE_ARMED:
        return PSTR("ARMED");
    case STATE_FIRING:
        return PSTR("FIRING");
    default:
        return PSTR("FAULT");
    }
}

uint8_t box_fault_why(void)
{
    return fault_why;
}

struct result *box_capture(void)
{
    return results_newest();
}

struct result *box_told(void)
{
    return current;
}

struct instant box_shot_start(uint8_t k)
{
    struct instant start = current->start;
    while (--k) {
        instant_add(&start, armed.interval);
    }
    return start;
}

enum error box_not_idle(void)
{
    switch (state) {
    case STATE_FIRING:
        return E_BUSY;
    case STATE_ARMED:
        return E_ARMED;
    case STATE_FAULT:
        return E_FAULT;
    default:
        return E_NONE;
    }
}

/* Say what is left to say of the last burst: all at once, when another one begins. */
static void tell_rest(void)
{
    if (telling) {
        events_add(EVENT_FIRED, current, current->shots);
        telling = false;
    }
}

enum error box_arm(const struct arming *arming)
{
    enum error error = box_not_idle();
    if (error) {
        return error;
    }
    if (!interlock_closed()) {
        return E_INTERLOCK;
    }
    if (results_find(arming->cap)) {
        return E_USED;
    }
    error = edges_make(arming->mask);
    if (error) {
        current = NULL; /* its edges are gone */
        return error;
    }
    uint32_t least = arming->shots > 1 ? edges[edges_count - 1].at + MIN_REST : 0;
    uint32_t most = arming->shots > 1 ? MAX_INTERVAL : 0;
    if (arming->interval < least || arming->interval > most) {
        current = NULL;
        return E_RANGE;
    }
    tell_rest();
    armed = *arming;
    current = results_add(arming->cap, arming->shots, store_boot());
    armed_at = clock_ticks();
    status_led(1);
    state = STATE_ARMED;
    events_add(EVENT_ARMED, current, 0);
    return E_NONE;
}

static void fault(uint8_t why)
{
    struct result *struck = NULL;
    burst_stop();
    if (state == STATE_FIRING) {
        struck = current;
        struck->phase = PHASE_PARTIAL;
    } else if (state == STATE_ARMED) {
        struck = current;
        struck->phase = PHASE_NOT_FIRED;
    }
    telling = false;
    state = STATE_FAULT;
    fault_why = why;
    events_add(EVENT_FAULT, struck, why);
}

enum error box_fire(struct instant *start)
{
    bool tripped;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        tripped = interlock_tripped();
        if (!tripped) {
            *start = burst_start(current, armed.lead, armed.interval);
        }
    }
    if (tripped) {
        return E_INTERLOCK; /* box_poll makes it a fault */
    }
    told_shots = 0;
    telling = true;
    state = STATE_FIRING;
    return E_NONE;
}

static void disarm(enum event_kind kind, uint8_t detail)
{
    current->phase = PHASE_NOT_FIRED;
    state = STATE_IDLE;
    events_add(kind, current, detail);
}

void box_disarm(void)
{
    disarm(EVENT_DISARMED, 0);
}

/* A burst whose last edge is made was not aborted, however soon after it the order comes. */
static void finish(void)
{
    if (state == STATE_FIRING && current->phase == PHASE_FIRED) {
        state = STATE_IDLE;
    }
}

void box_abort(void)
{
    burst_stop();
    finish();
    if (state == STATE_ARMED) {
        disarm(EVENT_ABORTED, 0);
    } else if (state == STATE_FIRING) {
        current->phase = PHASE_PARTIAL;
        telling = false;
        state = STATE_IDLE;
        events_add(EVENT_ABORTED, current, current->shots);
    }
}

void box_reset(void)
{
    box_abort();
    outputs_clear();
    if (state == STATE_FAULT && interlock_closed()) {
        state = STATE_IDLE;
    }
}

void box_heard(void)
{
    heard_at = clock_ticks();
}

/* One event at a time: each takes 6 ms of the line, and requests come first. */
static void tell(void)
{
    if (!telling) {
        return;
    }
    if (told_shots < current->shots) {
        uint8_t late = burst_late[told_shots++];
        events_add_done(current, told_shots, box_shot_start(told_shots), late);
    } else if (state != STATE_FIRING) {
        tell_rest();
    }
}

static void expire(void)
{
    uint32_t now = clock_ticks();
    if (now - armed_at >= armed.hold_ms * TICKS_PER_MS) {
        disarm(EVENT_EXPIRED, WHY_TTL);
    } else if (now - heard_at >= SILENCE_TICKS) {
        disarm(EVENT_EXPIRED, WHY_SILENCE);
    }
}

/* Lit: armed or firing. A blink each 2 s: idle. Blinking twice a second: fault. */
static void show(void)
{
    if (state == STATE_IDLE) {
        status_led((clock_overflows.low & 63) == 0);
    } else if (state == STATE_FAULT) {
        status_led(clock_overflows.low & 8);
    }
}

static void watch_interlock(void)
{
    bool was_closed = interlock_closed();
    bool opened = interlock_poll();
    if (interlock_closed() != was_closed) {
        events_add(EVENT_INTERLOCK, NULL, interlock_closed());
    }
    if (opened && (state == STATE_ARMED || state == STATE_FIRING)) {
        fault(WHY_INTERLOCK);
    }
}

void box_poll(void)
{
    finish();
    watch_interlock();
    if (supervisor_overtime(current ? current->shots : 0)) {
        fault(WHY_OVERTIME);
    }
    if (state == STATE_ARMED) {
        expire();
    }
    tell();
    show();
}

bool box_pending(void)
{
    return telling && (told_shots < current->shots || state != STATE_FIRING ||
                       current->phase == PHASE_FIRED);
}
