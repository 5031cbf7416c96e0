/* The last changing requests with their replies, so that a repeated line is not done twice. */
#ifndef REPEATS_H
#define REPEATS_H

#include <stdbool.h>
#include <stdint.h>

/* The longest reply of a changing request without head and checksum:
 * ERR 221 fired cap=abcdefghijkl res=NOT_FIRED t0=0123456789AB */
#define REPLY_SIZE 61

/* The stored reply, NUL-terminated; NULL when this request is new. */
const char *repeats_find(uint16_t number, uint16_t crc);

/* Room for a new request's reply, in place of the oldest. */
char *repeats_add(uint16_t number, uint16_t crc);

#endif
