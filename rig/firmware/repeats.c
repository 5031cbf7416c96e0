#include "repeats.h"

#include <stddef.h>

#define REPEATS 4

struct repeat {
    uint16_t number;
    uint16_t crc;
    char reply[REPLY_SIZE]; /* empty: no request yet */
};

static struct repeat repeats[REPEATS];
static uint8_t oldest;

const char *repeats_find(uint16_t number, uint16_t crc)
{
    for (uint8_t i = 0; i < REPEATS; i++) {
        const struct repeat *repeat = &repeats[i];
        if (repeat->reply[0] && repeat->number == number && repeat->crc == crc) {
            return repeat->reply;
        }
    }
    return NULL;
}

char *repeats_add(uint16_t number, uint16_t crc)
{
    struct repeat *repeat = &repeats[oldest];
    oldest = (oldest + 1) % REPEATS;
    repeat->number = number;
    repeat->crc = crc;
    return repeat->reply;
}
