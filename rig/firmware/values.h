/* Reads the values of arguments. */
#ifndef VALUES_H
#define VALUES_H

#include <stdint.h>

#include "errors.h"

/* A decimal number between two limits, both included. */
enum error value_number(const char *text, uint32_t least, uint32_t most, uint32_t *number);

/* Four hexadecimal digits, upper case. */
enum error value_mask(const char *text, uint16_t *mask);

/* 1 to `size` of letters, digits and `others` (in flash), copied and padded with NULs. */
enum error value_name(const char *text, const char *others, uint8_t size, char *name);

/* 1 to 60 of x. */
enum error value_padding(const char *text);

#endif
