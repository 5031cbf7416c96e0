#include "results.h"

#include <stddef.h>
#include <string.h>
#include <util/crc16.h>

static struct result results[RESULTS] __attribute__((section(".noinit")));

static uint16_t check_of(const struct result *result)
{
    const uint8_t *bytes = (const uint8_t *)result;
    uint16_t crc = 0x5A5A; /* not 0: RAM full of zeros must not pass */
    for (uint8_t i = 0; i < offsetof(struct result, check); i++) {
        crc = _crc_xmodem_update(crc, bytes[i]);
    }
    return crc;
}

void result_end(struct result *result, enum phase phase, enum why why)
{
    result->why = why;
    result->phase = phase;
}

static bool used(const struct result *result)
{
    return result->cap[0] != 0;
}

static void close(struct result *result)
{
    if (result->phase == PHASE_ARMED) {
        result_end(result, PHASE_NOT_FIRED, WHY_RESET);
    } else if (result->phase != PHASE_FIRED && result->phase != PHASE_NOT_FIRED) {
        /* FIRING; and for an unreadable phase the careful answer. */
        result_end(result, PHASE_PARTIAL, WHY_RESET);
    }
}

void results_start(void)
{
    for (uint8_t i = 0; i < RESULTS; i++) {
        if (used(&results[i]) && results[i].check == check_of(&results[i])) {
            close(&results[i]);
        } else {
            memset(&results[i], 0, sizeof results[i]);
        }
    }
}

struct result *results_newest(void)
{
    struct result *newest = NULL;
    for (uint8_t i = 0; i < RESULTS; i++) {
        if (used(&results[i]) &&
            (!newest || (int16_t)(results[i].age - newest->age) > 0)) {
            newest = &results[i];
        }
    }
    return newest;
}

static struct result *oldest(void)
{
    struct result *oldest = &results[0];
    for (uint8_t i = 0; i < RESULTS; i++) {
        if (!used(&results[i])) {
            return &results[i];
        }
        if ((int16_t)(results[i].age - oldest->age) < 0) {
            oldest = &results[i];
        }
    }
    return oldest;
}

struct result *results_add(const char *cap, uint8_t of, uint32_t boot)
{
    const struct result *newest = results_newest();
    uint16_t age = newest ? newest->age + 1 : 0;
    struct result *result = oldest();
    memset(result, 0, sizeof *result);
    result->phase = PHASE_ARMED;
    memcpy(result->cap, cap, CAPTURE_ID_SIZE);
    result->boot = boot;
    result->age = age;
    result->of = of;
    result->check = check_of(result);
    return result;
}

struct result *results_find(const char *cap)
{
    for (uint8_t i = 0; i < RESULTS; i++) {
        if (used(&results[i]) && !memcmp(results[i].cap, cap, CAPTURE_ID_SIZE)) {
            return &results[i];
        }
    }
    return NULL;
}

PGM_P why_name(uint8_t why)
{
    switch (why) {
    case WHY_TTL:
        return PSTR("ttl");
    case WHY_SILENCE:
        return PSTR("silence");
    case WHY_INTERLOCK:
        return PSTR("interlock");
    case WHY_OVERTIME:
        return PSTR("overtime");
    case WHY_DISARM:
        return PSTR("disarm");
    case WHY_ABORT:
        return PSTR("abort");
    default:
        return PSTR("reset");
    }
}

PGM_P phase_name(uint8_t phase)
{
    switch (phase) {
    case PHASE_ARMED:
        return PSTR("ARMED");
    case PHASE_FIRING:
        return PSTR("FIRING");
    case PHASE_FIRED:
        return PSTR("FIRED");
    case PHASE_NOT_FIRED:
        return PSTR("NOT_FIRED");
    default:
        return PSTR("PARTIAL");
    }
}
