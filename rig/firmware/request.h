/* Takes a line apart: number, command, arguments. */
#ifndef REQUEST_H
#define REQUEST_H

#include <stdbool.h>
#include <stdint.h>

#include "errors.h"
#include "line.h"

#define MAX_ARGUMENTS 7

enum command {
    C_IDN,
    C_CAP,
    C_SAFE,
    C_BOOT,
    C_STAT,
    C_TIME,
    C_SYST_ERR,
    C_LOG,
    C_RES,
    C_EDGE,
    C_SHOT,
    C_OUT,
    C_ARM,
    C_FIRE,
    C_DISARM,
    C_ABORT,
    C_RST,
    C_CLS,
    C_SERIAL,
    COMMANDS,
};

struct request {
    bool numbered;
    uint16_t number;
    uint8_t command;                     /* an enum command */
    const char *values[MAX_ARGUMENTS];   /* in the order of the command's table; NULL if left out */
};

/* The line is cut into words in place. Whatever the error, `numbered` and `number` hold. */
enum error request_parse(struct request *request, enum check check);

bool request_is_query(uint8_t command);

/* Say the name of a command's argument. */
void say_argument_name(uint8_t command, uint8_t argument);

#endif
