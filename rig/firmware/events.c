#include "events.h"

#include <stddef.h>
#include <string.h>

#include "boot.h"
#include "interlock.h"
#include "say.h"

#define LOG_SIZE 16 /* a power of two */

struct event {
    uint8_t kind;
    uint8_t detail; /* shot or shots, why, cause, interlock state */
    uint8_t of;
    uint8_t late;
    struct instant start;
    char cap[CAPTURE_ID_SIZE];
};

static struct event events[LOG_SIZE];
static uint16_t last_number;
static uint8_t kept;
static uint8_t unsent;
static uint8_t position; /* where the next one goes */

static PGM_P kind_name(uint8_t kind)
{
    switch (kind) {
    case EVENT_BOOT:
        return PSTR("BOOT");
    case EVENT_ARMED:
        return PSTR("ARMED");
    case EVENT_DONE:
        return PSTR("DONE");
    case EVENT_FIRED:
        return PSTR("FIRED");
    case EVENT_DISARMED:
        return PSTR("DISARMED");
    case EVENT_EXPIRED:
        return PSTR("EXPIRED");
    case EVENT_ABORTED:
        return PSTR("ABORTED");
    case EVENT_FAULT:
        return PSTR("FAULT");
    default:
        return PSTR("INTERLOCK");
    }
}

static struct event *add(enum event_kind kind)
{
    struct event *event = &events[position];
    position = (position + 1) & (LOG_SIZE - 1);
    memset(event, 0, sizeof *event);
    event->kind = kind;
    last_number = last_number == UINT16_MAX ? 1 : last_number + 1;
    if (kept < LOG_SIZE) {
        kept++;
    }
    if (unsent < LOG_SIZE) {
        unsent++;
    }
    return event;
}

void events_add(enum event_kind kind, const struct result *result, uint8_t detail)
{
    struct event *event = add(kind);
    event->detail = detail;
    if (result) {
        event->start = result->start;
        memcpy(event->cap, result->cap, CAPTURE_ID_SIZE);
    }
}

void events_add_done(const struct result *result, uint8_t shot, struct instant start, uint8_t late)
{
    struct event *event = add(EVENT_DONE);
    event->detail = shot;
    event->of = result->of;
    event->late = late;
    event->start = start;
    memcpy(event->cap, result->cap, CAPTURE_ID_SIZE);
}

void events_add_boot(uint32_t boot, uint16_t id, uint8_t cause)
{
    struct event *event = add(EVENT_BOOT);
    event->detail = cause;
    event->start.low = boot;
    event->start.high = id;
}

static void say_start(const struct event *event)
{
    say_text(PSTR(" t0="));
    say_instant(event->start);
}

static void say_done(const struct event *event)
{
    say_text(PSTR(" shot="));
    say_number(event->detail);
    say_text(PSTR(" of="));
    say_number(event->of);
    say_start(event);
    say_text(PSTR(" late="));
    say_number(event->late);
}

static void say_fields(const struct event *event)
{
    if (event->cap[0]) {
        say_text(PSTR(" cap="));
        say_name(event->cap, CAPTURE_ID_SIZE);
    }
    switch (event->kind) {
    case EVENT_BOOT:
        say_text(PSTR(" n="));
        say_number(event->start.low);
        say_text(PSTR(" cause="));
        say_text(cause_name(event->detail));
        say_text(PSTR(" id="));
        say_hex(event->start.high);
        break;
    case EVENT_DONE:
        say_done(event);
        break;
    case EVENT_FIRED:
    case EVENT_ABORTED:
        say_text(PSTR(" shots="));
        say_number(event->detail);
        if (event->kind == EVENT_FIRED) {
            say_start(event);
        }
        break;
    case EVENT_EXPIRED:
    case EVENT_FAULT:
        say_text(PSTR(" why="));
        say_text(why_name(event->detail));
        break;
    case EVENT_INTERLOCK:
        say_text(PSTR(" il="));
        say_text(interlock_name(event->detail));
        break;
    default:
        break;
    }
}

/* The event `back` before the last; numbers skip 0 when they wrap. */
static uint16_t number_of(uint8_t back)
{
    return last_number > back ? last_number - back : last_number - back - 1;
}

bool events_send(void)
{
    if (!unsent) {
        return false;
    }
    unsent--;
    const struct event *event = &events[(position - 1 - unsent) & (LOG_SIZE - 1)];
    say_begin();
    say_text(PSTR("! "));
    say_number(number_of(unsent));
    say_char(' ');
    say_text(kind_name(event->kind));
    say_fields(event);
    say_end();
    return true;
}

static const struct event *find(uint16_t number)
{
    for (uint8_t back = 0; back < kept; back++) {
        if (number_of(back) == number) {
            return &events[(position - 1 - back) & (LOG_SIZE - 1)];
        }
    }
    return NULL;
}

bool events_kept(uint16_t number)
{
    return find(number) != NULL;
}

void events_say(uint16_t number)
{
    const struct event *event = find(number);
    say_text(PSTR(" ev="));
    say_number(number);
    say_text(PSTR(" name="));
    say_text(kind_name(event->kind));
    say_fields(event);
}

uint16_t events_last(void)
{
    return last_number;
}
