/* Begins replies; say.h writes the rest of them. */
#ifndef REPLY_H
#define REPLY_H

#include <stdint.h>

#include "errors.h"
#include "request.h"

/* Head and `OK`. */
void reply_ok(void);

/* Head, `ERR`, code and word. What has a number is queued. */
void reply_error(enum error error);

/* The same, with key= naming an argument of the command. */
void reply_error_key(enum error error, uint8_t command, uint8_t argument);

/* Which line the replies from now on answer. `request` NULL: one that could not be read. */
void reply_to(const struct request *request);

/* Copy the reply to come, from behind its head. */
void reply_store(char *buffer, uint8_t size);

/* Say a stored reply. */
void reply_again(const char *stored);

#endif
