#include <avr/pgmspace.h>
#include <string.h>

#include "board.h"
#include "box.h"
#include "commands.h"
#include "edges.h"
#include "events.h"
#include "reply.h"
#include "say.h"
#include "store.h"
#include "values.h"

static void say_capture(const char *cap)
{
    say_text(PSTR(" cap="));
    say_name(cap, CAPTURE_ID_SIZE);
}

static void say_state(void)
{
    say_text(PSTR(" st="));
    say_text(state_name());
}

/* An error of the state, with what its code promises. */
static void reply_state_error(enum error error)
{
    reply_error(error);
    if (error == E_ARMED || error == E_CAPTURE) {
        say_capture(box_capture()->cap);
    } else if (error == E_FAULT) {
        say_text(PSTR(" why="));
        say_text(why_name(box_fault_why()));
    } else if (error == E_REST) {
        say_text(PSTR(" ms="));
        say_number(box_rest_ms());
    }
}

/* Of several wrong values the first of the wrong kind is named, else the first out of range. */
struct verdict {
    enum error error;
    uint8_t argument;
};

static void judge(struct verdict *verdict, uint8_t argument, enum error error)
{
    if (error && (!verdict->error || (error == E_TYPE && verdict->error == E_RANGE))) {
        verdict->error = error;
        verdict->argument = argument;
    }
}

static void out(const struct request *request)
{
    uint32_t ch;
    struct output output;
    struct verdict verdict = {E_NONE, 0};
    const char *const *values = request->values;
    judge(&verdict, 0, value_number(values[0], 1, OUTPUTS, &ch));
    bool strobe = ch >= FIRST_STROBE && ch <= LAST_STROBE;
    uint32_t widest = strobe ? MAX_STROBE_WIDTH : MAX_WIDTH;
    judge(&verdict, 1, value_number(values[1], 0, MAX_DELAY, &output.delay));
    judge(&verdict, 2, value_number(values[2], 0, widest, &output.width));
    if (verdict.error) {
        reply_error_key(verdict.error, C_OUT, verdict.argument);
        return;
    }
    if (box_state() == STATE_FIRING) {
        reply_error(E_BUSY);
        return;
    }
    outputs[ch - 1] = output;
    reply_ok();
    say_text(PSTR(" ch="));
    say_number(ch);
    say_text(PSTR(" d="));
    say_number(output.delay);
    say_text(PSTR(" w="));
    say_number(output.width);
}

/* The dead man's time; what is left out is the default, and 0 none. */
static enum error read_dead_man(const char *text, uint16_t *ms)
{
    uint32_t value = DEAD_MAN_MS;
    enum error error = text ? value_number(text, 0, MAX_DEAD_MAN_MS, &value) : E_NONE;
    *ms = (uint16_t)value;
    return !error && value && value < MIN_DEAD_MAN_MS ? E_RANGE : error;
}

static struct verdict read_arming(const char *const *values, struct arming *arming)
{
    uint32_t shots = 0;
    struct verdict verdict = {E_NONE, 0};
    judge(&verdict, 0, value_name(values[0], PSTR("_-"), CAPTURE_ID_SIZE, arming->cap));
    judge(&verdict, 1, value_mask(values[1], &arming->mask));
    judge(&verdict, 2, value_number(values[2], 1, MAX_SHOTS, &shots));
    judge(&verdict, 3, value_number(values[3], 0, UINT32_MAX, &arming->interval));
    judge(&verdict, 4, value_number(values[4], MIN_LEAD, MAX_DELAY, &arming->lead));
    judge(&verdict, 5, value_number(values[5], 1, MAX_HOLD_MS, &arming->hold_ms));
    judge(&verdict, 6, read_dead_man(values[6], &arming->dead_man_ms));
    arming->shots = (uint8_t)shots;
    return verdict;
}

static void arm(const struct request *request)
{
    struct arming arming;
    struct verdict verdict = read_arming(request->values, &arming);
    if (verdict.error) {
        reply_error_key(verdict.error, C_ARM, verdict.argument);
        return;
    }
    enum error error = box_arm(&arming);
    if (error == E_RANGE) {
        reply_error_key(error, C_ARM, 3);
        return;
    }
    if (error) {
        reply_state_error(error);
        return;
    }
    reply_ok();
    say_state();
    say_capture(arming.cap);
    say_text(PSTR(" edges="));
    say_number(edges_count);
    say_text(PSTR(" dur="));
    say_number(edges[edges_count - 1].at);
}

/* Why an order for a capture cannot be done; E_NONE when that capture is armed. */
static enum error order_error(const char *cap)
{
    switch (box_state()) {
    case STATE_ARMED:
        return memcmp(box_capture()->cap, cap, CAPTURE_ID_SIZE) ? E_CAPTURE : E_NONE;
    case STATE_FIRING:
        return E_BUSY;
    case STATE_FAULT:
        return E_FAULT;
    default:
        return E_NOT_ARMED;
    }
}

static void reply_fired(const struct result *result)
{
    reply_error(E_FIRED);
    say_capture(result->cap);
    say_text(PSTR(" res="));
    say_text(phase_name(result->phase));
    say_text(PSTR(" t0="));
    say_instant(result->start);
}

static void fire(const struct request *request)
{
    char cap[CAPTURE_ID_SIZE];
    struct instant start;
    enum error error = value_name(request->values[0], PSTR("_-"), CAPTURE_ID_SIZE, cap);
    if (error) {
        reply_error(error);
        return;
    }
    error = order_error(cap);
    const struct result *known = results_find(cap);
    if (error && known) {
        reply_fired(known);
        return;
    }
    if (!error) {
        error = box_fire(&start);
    }
    if (error) {
        reply_state_error(error);
        return;
    }
    reply_ok();
    say_capture(cap);
    say_text(PSTR(" t0="));
    say_instant(start);
}

static void disarm(const struct request *request)
{
    char cap[CAPTURE_ID_SIZE];
    enum error error = value_name(request->values[0], PSTR("_-"), CAPTURE_ID_SIZE, cap);
    if (!error) {
        error = order_error(cap);
    }
    if (error) {
        reply_state_error(error);
        return;
    }
    box_disarm();
    reply_ok();
    say_capture(cap);
}

static void serial(const struct request *request)
{
    char name[NAME_SIZE];
    enum error error = value_name(request->values[0], PSTR("._-"), NAME_SIZE, name);
    if (!error) {
        error = box_not_idle();
    }
    if (error) {
        reply_state_error(error);
        return;
    }
    store_rename(name);
    reply_ok();
    say_text(PSTR(" sn="));
    say_name(name, NAME_SIZE);
}

void command_change(const struct request *request)
{
    switch (request->command) {
    case C_OUT:
        out(request);
        break;
    case C_ARM:
        arm(request);
        break;
    case C_FIRE:
        fire(request);
        break;
    case C_DISARM:
        disarm(request);
        break;
    case C_ABORT:
    case C_RST:
        request->command == C_ABORT ? box_abort() : box_reset();
        reply_ok();
        say_state();
        break;
    case C_CLS:
        errors_clear();
        reply_ok();
        break;
    default:
        serial(request);
        break;
    }
}
