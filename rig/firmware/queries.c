#include <avr/pgmspace.h>
#include <string.h>

#include "board.h"
#include "boot.h"
#include "box.h"
#include "burst.h"
#include "commands.h"
#include "edges.h"
#include "events.h"
#include "interlock.h"
#include "reply.h"
#include "say.h"
#include "store.h"
#include "uart.h"
#include "values.h"

#define STRING(value) STRING_OF(value)
#define STRING_OF(value) #value

/* From the begin of writing a reply to TIME? to its sending: writing takes 0.3 ms. */
#define REPLY_TICKS 1000

static void idn(void)
{
    reply_ok();
    say_text(PSTR(" idn=Rigwright,TriggerBox,"));
    say_name(store_name(), NAME_SIZE);
    say_text(PSTR("," FIRMWARE_VERSION));
}

static void say_limit(PGM_P key, uint32_t value)
{
    say_text(key);
    say_number(value);
}

static void cap(void)
{
    reply_ok();
    say_text(PSTR(" proto=1 out=" STRING(OUTPUTS) " tick_ns=" STRING(TICK_NS)));
    say_limit(PSTR(" dmax="), MAX_DELAY);
    say_limit(PSTR(" wmax="), MAX_WIDTH);
    say_limit(PSTR(" smax="), MAX_STROBE_WIDTH);
    say_limit(PSTR(" gap="), MIN_GAP);
    say_limit(PSTR(" edges="), MAX_EDGES);
    say_limit(PSTR(" shots="), MAX_SHOTS);
    say_limit(PSTR(" hold="), MAX_HOLD_MS);
}

static void safe(void)
{
    reply_ok();
    say_limit(PSTR(" dm="), DEAD_MAN_MS);
    say_limit(PSTR(" dmmin="), MIN_DEAD_MAN_MS);
    say_limit(PSTR(" dmmax="), MAX_DEAD_MAN_MS);
    say_limit(PSTR(" silence="), SILENCE_MS);
    say_limit(PSTR(" srest="), STROBE_REST);
    say_limit(PSTR(" sduty="), 100 / STROBE_DUTY);
}

static void boot(void)
{
    reply_ok();
    say_text(PSTR(" n="));
    say_number(store_boot());
    say_text(PSTR(" cause="));
    say_text(cause_name(boot_cause()));
    say_text(PSTR(" id="));
    say_hex(boot_id());
}

static void stat(void)
{
    const struct result *result = box_capture();
    reply_ok();
    say_text(PSTR(" st="));
    say_text(state_name());
    say_text(PSTR(" il="));
    say_text(interlock_name(interlock_closed()));
    say_text(PSTR(" cap="));
    if (result) {
        say_name(result->cap, CAPTURE_ID_SIZE);
    } else {
        say_char('-');
    }
    say_text(PSTR(" ev="));
    say_number(events_last());
    say_text(PSTR(" err="));
    say_number(errors_count());
    say_text(PSTR(" t="));
    say_instant(clock_now());
}

/* The reply is ready before its instant comes; if an edge got in the way, another one is said. */
static void time(const struct request *request)
{
    enum error error = value_padding(request->values[0]);
    if (error) {
        reply_error_key(error, C_TIME, 0);
        return;
    }
    struct instant received = clock_instant(line.tick);
    struct instant sent;
    uart_hold();
    do {
        sent = clock_now();
        instant_add(&sent, REPLY_TICKS);
        reply_ok();
        say_text(PSTR(" rx="));
        say_instant(received);
        say_text(PSTR(" tx="));
        say_instant(sent);
    } while (!uart_release_at(sent.low));
}

static void syst_err(void)
{
    enum error error = errors_pop();
    reply_ok();
    say_text(PSTR(" err="));
    say_error_code(error);
    say_text(PSTR(" word="));
    say_error_word(error);
}

static void log_(const struct request *request)
{
    uint32_t number;
    enum error error = value_number(request->values[0], 0, UINT16_MAX, &number);
    if (error) {
        reply_error_key(error, C_LOG, 0);
        return;
    }
    if (!events_kept((uint16_t)number)) {
        reply_error(E_UNKNOWN);
        return;
    }
    reply_ok();
    events_say((uint16_t)number);
}

static enum error find(const struct request *request, struct result **result)
{
    char name[CAPTURE_ID_SIZE];
    enum error error = value_name(request->values[0], PSTR("_-"), CAPTURE_ID_SIZE, name);
    *result = error ? 0 : results_find(name);
    return error ? error : *result ? E_NONE : E_UNKNOWN;
}

static void res(const struct request *request)
{
    struct result *result;
    enum error error = find(request, &result);
    if (error) {
        reply_error(error);
        return;
    }
    reply_ok();
    say_text(PSTR(" res="));
    say_text(phase_name(result->phase));
    say_text(PSTR(" shots="));
    say_number(result->shots);
    say_text(PSTR(" of="));
    say_number(result->of);
    say_text(PSTR(" t0="));
    say_instant(result->start);
    say_text(PSTR(" late="));
    say_number(result->late);
    say_text(PSTR(" boot="));
    say_number(result->boot);
    if (result->why) {
        say_text(PSTR(" why="));
        say_text(why_name(result->why));
    }
}

/* Find the capture, which must be the last one, and read the index, from 0 to below `end`. */
static enum error find_part(const struct request *request, uint8_t first, uint32_t *part)
{
    struct result *result;
    enum error error = find(request, &result);
    if (!error) {
        error = value_number(request->values[1], 0, UINT16_MAX, part);
    }
    if (error) {
        return error;
    }
    uint32_t end = first ? (uint32_t)result->shots + 1 : edges_count;
    return result == box_told() && *part >= first && *part < end ? E_NONE : E_UNKNOWN;
}

static void edge(const struct request *request)
{
    uint32_t part;
    enum error error = find_part(request, 0, &part);
    if (error) {
        reply_error_key(error, C_EDGE, 1);
        return;
    }
    uint8_t i = (uint8_t)part;
    reply_ok();
    say_text(PSTR(" i="));
    say_number(i);
    say_text(PSTR(" of="));
    say_number(edges_count);
    say_text(PSTR(" at="));
    say_number(edges[i].at);
    say_text(PSTR(" pins="));
    say_hex(edge_pins(&edges[i]));
    say_text(PSTR(" late="));
    say_number(edge_late(i, burst_side()));
}

static void shot(const struct request *request)
{
    uint32_t part;
    enum error error = find_part(request, 1, &part);
    if (error) {
        reply_error_key(error, C_SHOT, 1);
        return;
    }
    uint8_t k = (uint8_t)part;
    reply_ok();
    say_text(PSTR(" k="));
    say_number(k);
    say_text(PSTR(" of="));
    say_number(box_told()->of);
    say_text(PSTR(" t0="));
    say_instant(box_shot_start(k));
    say_text(PSTR(" late="));
    say_number(burst_late[k - 1]);
}

void command_query(const struct request *request)
{
    switch (request->command) {
    case C_IDN:
        idn();
        break;
    case C_CAP:
        cap();
        break;
    case C_SAFE:
        safe();
        break;
    case C_BOOT:
        boot();
        break;
    case C_STAT:
        stat();
        break;
    case C_TIME:
        time(request);
        break;
    case C_SYST_ERR:
        syst_err();
        break;
    case C_LOG:
        log_(request);
        break;
    case C_RES:
        res(request);
        break;
    case C_EDGE:
        edge(request);
        break;
    default:
        shot(request);
        break;
    }
}
