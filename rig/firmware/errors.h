/* The errors of docs/reference/trigger-protocol.md, and the queue that SYST:ERR? empties. */
#ifndef ERRORS_H
#define ERRORS_H

#include <stdint.h>

enum error {
    E_NONE,
    E_CHARACTER,
    E_SYNTAX,
    E_TYPE,
    E_PARAMETER,
    E_MISSING,
    E_COMMAND,
    E_RANGE,
    E_EDGES,
    E_OVERFLOW,
    E_CHECKSUM,
    E_UNCHECKED,
    E_INTERLOCK,
    E_NOT_ARMED,
    E_CAPTURE,
    E_FIRED,
    E_ARMED,
    E_USED,
    E_BUSY,
    E_REST,
    E_FAULT,
    E_UNKNOWN,
    E_NOTHING,
};

void say_error_code(enum error error);
void say_error_word(enum error error);

void errors_push(enum error error);
enum error errors_pop(void);
uint8_t errors_count(void);
void errors_clear(void);

#endif
