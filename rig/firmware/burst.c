#include "burst.h"

#include <avr/interrupt.h>
#include <stddef.h>
#include <util/atomic.h>

#include "board.h"
#include "edges.h"
#include "interlock.h"
#include "ports.h"
#include "uart.h"

/* The interrupt comes this early. It may be kept waiting by one other interrupt that has begun and
 * by the pin change, which goes first (20 ticks each), and takes 15 itself before it looks. */
#define EARLY 96

/* With less than this to the next edge, leaving the interrupt does not pay. */
#define STAY (EARLY + 24)

/* What player_sync needs: SYNC_TICKS, and the way to it. With an edge that is late the way is
 * longer. */
#define SYNC_NEEDS (SYNC_TICKS + 8)
#define LATE_NEEDS (SYNC_NEEDS + 6)

/* Bytes are taken from the serial line while waiting, up to this before the edge: taking a line
 * end costs up to 16 ticks, and a look at the interlock 2. */
#define BUSY (SYNC_NEEDS + 18)

/* The interlock is looked at up to this before the edge: telling an open one from a glitch takes 9
 * ticks. */
#define WATCHFUL (SYNC_NEEDS + 10)

struct edge *player_sync(struct edge *first, uint8_t tick);

uint8_t burst_late[MAX_SHOTS];

static struct result *result;
static struct edge *next;
static uint32_t shot_start;
static uint32_t shot_interval;
static uint8_t side;
static uint8_t shot_late;

/* A match that is pending already brings the interrupt once more than needed; it looks at the time
 * and waits again. Clearing the flag would save that, and lose the match that comes meanwhile. */
static inline void schedule(uint32_t due)
{
    OCR1A = (uint16_t)due - EARLY;
}

static inline uint8_t saturate(uint32_t ticks)
{
    return ticks > UINT8_MAX ? UINT8_MAX : (uint8_t)ticks;
}

/* Play the run that begins with an edge `left` ticks from now; its last edge, or NULL when the
 * interlock is open. An edge whose time
 * has gone, or is too near, comes as soon as it can be synchronised, and its run keeps its
 * distances: a run is late as a whole, by so many ticks exactly. */
static inline __attribute__((always_inline)) struct edge *play(struct edge *first, uint32_t due,
                                                               int32_t left)
{
    if (interlock_reads_open() && interlock_open_now()) {
        return NULL;
    }
    uint16_t target = (uint16_t)due;
    int16_t wait = (int16_t)(target - TCNT1);
    uint8_t late = 0;
    while (left >= 0 && wait > WATCHFUL) {
        if (wait > BUSY && (UCSR0A & _BV(RXC0))) {
            uart_receive_locked();
        } else if (interlock_reads_open() && interlock_open_now()) {
            return NULL;
        }
        wait = (int16_t)(target - TCNT1);
    }
    if (left < 0 || wait < SYNC_NEEDS) {
        uint32_t soonest = clock_ticks_locked() + LATE_NEEDS;
        late = saturate(soonest - due);
        target = (uint16_t)soonest;
    }
    first->late[side] = late;
    if (late > shot_late) {
        shot_late = late;
    }
    return player_sync(first, (uint8_t)target - SYNC_TICKS);
}

/* Count a complete shot; whether it was the last. */
static inline bool shot_complete(void)
{
    uint8_t shots = result->shots;
    burst_late[shots] = shot_late;
    if (shot_late > result->late) {
        result->late = shot_late;
    }
    shot_late = 0;
    side ^= 1;
    result->shots = ++shots;
    if (shots < result->of) {
        shot_start += shot_interval;
        return false;
    }
    result->phase = PHASE_FIRED;
    TIMSK1 &= (uint8_t)~_BV(OCIE1A);
    return true;
}

static inline __attribute__((always_inline)) void stop_locked(void)
{
    TIMSK1 &= (uint8_t)~_BV(OCIE1A);
    ports_low();
}

/* The main loop may be waiting for the serial line: whoever sees the interlock open stops the
 * pulses itself. */
static inline __attribute__((always_inline)) void interlock_stop(void)
{
    stop_locked();
    interlock_opened = true;
}

ISR(PCINT0_vect)
{
    if (interlock_open_now()) {
        interlock_stop();
    }
}

ISR(TIMER1_COMPA_vect)
{
    struct edge *edge = next;
    for (;;) {
        uint32_t due = shot_start + edge->at;
        int32_t left = (int32_t)(due - clock_ticks_locked());
        if (left > STAY) {
            schedule(due);
            break;
        }
        edge = play(edge, due, left);
        if (!edge) {
            interlock_stop();
            break;
        }
        if (++edge == &edges[edges_count]) {
            edge = edges;
            if (shot_complete()) {
                break;
            }
        }
    }
    next = edge;
}

struct instant burst_start(struct result *of, uint32_t lead, uint32_t interval)
{
    struct instant start = clock_now();
    instant_add(&start, lead);
    result = of;
    next = edges;
    shot_start = start.low;
    shot_interval = interval;
    side = 0;
    shot_late = 0;
    of->start = start;
    __asm__ volatile("" ::: "memory"); /* a reset between the two must find the instant first */
    of->phase = PHASE_FIRING;
    schedule(shot_start + edges[0].at);
    TIMSK1 |= _BV(OCIE1A);
    return start;
}

void burst_stop(void)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        stop_locked();
    }
}

uint8_t burst_side(void)
{
    return side ^ 1;
}
