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
static uint32_t strobe_rest;  /* ticks, after the pulses that are armed or were fired last */
static uint32_t strobe_ready; /* when a strobe may be on again, if it rests */
static bool strobe_rests;

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

static uint32_t largest(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

/* What the strobes of a mask ask for: `rest` after their pulses, `least` from shot to shot; and
 * the `first` of them begins so long after the shot. */
struct strobe_needs {
    uint32_t rest;
    uint32_t least;
    uint32_t first;
};

static struct strobe_needs strobe_needs(uint16_t mask)
{
    struct strobe_needs needs = {0, 0, UINT32_MAX};
    for (uint8_t i = FIRST_STROBE - 1; i < LAST_STROBE; i++) {
        const struct output *output = &outputs[i];
        if (!(mask & ((uint16_t)1 << i)) || !output->width) {
            continue;
        }
        uint32_t rest = largest(STROBE_REST, output->width * (STROBE_DUTY - 1));
        needs.rest = largest(needs.rest, rest);
        needs.least = largest(needs.least, output->width + rest);
        if (output->delay < needs.first) {
            needs.first = output->delay;
        }
    }
    return needs;
}

/* FIRE comes after this, so what is too soon now may not be then; it is asked again. */
static bool too_soon(const struct strobe_needs *needs, uint32_t lead)
{
    return needs->rest && strobe_rests &&
           (int32_t)(strobe_ready - (clock_ticks() + lead + needs->first)) > 0;
}

uint16_t box_rest_ms(void)
{
    int32_t left = (int32_t)(strobe_ready - clock_ticks());
    return left > 0 ? (uint16_t)(left / TICKS_PER_MS) + 1 : 0;
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
    struct strobe_needs strobes = strobe_needs(arming->mask);
    uint32_t least =
        arming->shots > 1 ? largest(edges[edges_count - 1].at + MIN_REST, strobes.least) : 0;
    uint32_t most = arming->shots > 1 ? MAX_INTERVAL : 0;
    if (arming->interval < least || arming->interval > most) {
        current = NULL;
        return E_RANGE;
    }
    if (too_soon(&strobes, arming->lead)) {
        current = NULL;
        return E_REST;
    }
    tell_rest();
    armed = *arming;
    strobe_rest = strobes.rest;
    current = results_add(arming->cap, arming->shots, store_boot());
    armed_at = clock_ticks();
    status_led(1);
    state = STATE_ARMED;
    events_add(EVENT_ARMED, current, 0);
    return E_NONE;
}

/* The burst is over, or has been stopped. */
static void burst_ended(void)
{
    strobe_ready = clock_ticks() + strobe_rest;
    strobe_rests = strobe_rest != 0;
}

/* End what is armed or firing before its time. */
static void end(enum why why)
{
    if (state == STATE_FIRING) {
        burst_ended();
    }
    result_end(current, state == STATE_FIRING ? PHASE_PARTIAL : PHASE_NOT_FIRED, why);
    telling = false;
    state = STATE_IDLE;
}

static void fault(uint8_t why)
{
    struct result *struck = NULL;
    burst_stop();
    if (state == STATE_ARMED || state == STATE_FIRING) {
        struck = current;
        end(why);
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

void box_disarm(void)
{
    end(WHY_DISARM);
    events_add(EVENT_DISARMED, current, 0);
}

/* A burst whose last edge is made was not aborted, however soon after it the order comes. */
static void finish(void)
{
    if (state == STATE_FIRING && current->phase == PHASE_FIRED) {
        burst_ended();
        state = STATE_IDLE;
    }
}

void box_abort(void)
{
    burst_stop();
    finish();
    if (state == STATE_ARMED || state == STATE_FIRING) {
        end(WHY_ABORT);
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

void box_heard(uint32_t tick)
{
    heard_at = tick;
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

/* Whether no sign of life has come for as long as the state allows. */
static bool silent(uint32_t now)
{
    uint32_t allowed_ms = state == STATE_FIRING ? armed.dead_man_ms : SILENCE_MS;
    return allowed_ms && now - heard_at >= allowed_ms * TICKS_PER_MS;
}

static void expire(void)
{
    uint32_t now = clock_ticks();
    enum why why = WHY_NONE;
    if (state == STATE_ARMED && now - armed_at >= armed.hold_ms * TICKS_PER_MS) {
        why = WHY_TTL;
    } else if (silent(now)) {
        why = WHY_SILENCE;
    }
    if (why) {
        burst_stop();
        finish();
    }
    if (why && state != STATE_IDLE) {
        end(why);
        events_add(EVENT_EXPIRED, current, why);
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
    if (state == STATE_ARMED || state == STATE_FIRING) {
        expire();
    }
    if (strobe_rests && (int32_t)(clock_ticks() - strobe_ready) >= 0) {
        strobe_rests = false;
    }
    tell();
    show();
}

bool box_pending(void)
{
    return telling && (told_shots < current->shots || state != STATE_FIRING ||
                       current->phase == PHASE_FIRED);
}
