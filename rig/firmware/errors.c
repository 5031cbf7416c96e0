#include "errors.h"

#include <avr/pgmspace.h>

#include "say.h"

#define QUEUE_SIZE 8

struct entry {
    int16_t code;
    char word[11];
};

static const struct entry table[] PROGMEM = {
    [E_NONE] = {0, "none"},
    [E_CHARACTER] = {-101, "character"},
    [E_SYNTAX] = {-102, "syntax"},
    [E_TYPE] = {-104, "type"},
    [E_PARAMETER] = {-108, "parameter"},
    [E_MISSING] = {-109, "missing"},
    [E_COMMAND] = {-113, "command"},
    [E_RANGE] = {-222, "range"},
    [E_EDGES] = {-223, "edges"},
    [E_OVERFLOW] = {-350, "overflow"},
    [E_CHECKSUM] = {-360, "checksum"},
    [E_UNCHECKED] = {-361, "unchecked"},
    [E_INTERLOCK] = {201, "interlock"},
    [E_NOT_ARMED] = {210, "not-armed"},
    [E_CAPTURE] = {220, "capture"},
    [E_FIRED] = {221, "fired"},
    [E_ARMED] = {222, "armed"},
    [E_USED] = {223, "used"},
    [E_BUSY] = {230, "busy"},
    [E_REST] = {231, "rest"},
    [E_FAULT] = {240, "fault"},
    [E_UNKNOWN] = {250, "unknown"},
    [E_NOTHING] = {260, "nothing"},
};

static uint8_t queue[QUEUE_SIZE];
static uint8_t count;

void say_error_code(enum error error)
{
    say_signed((int16_t)pgm_read_word(&table[error].code));
}

void say_error_word(enum error error)
{
    say_text(table[error].word);
}

void errors_push(enum error error)
{
    if (count == QUEUE_SIZE) {
        queue[QUEUE_SIZE - 1] = E_OVERFLOW;
    } else {
        queue[count++] = error;
    }
}

enum error errors_pop(void)
{
    if (!count) {
        return E_NONE;
    }
    enum error oldest = queue[0];
    count--;
    for (uint8_t i = 0; i < count; i++) {
        queue[i] = queue[i + 1];
    }
    return oldest;
}

uint8_t errors_count(void)
{
    return count;
}

void errors_clear(void)
{
    count = 0;
}
