/* Writes lines: replies and events, with the checksum counted as they go out. */
#ifndef SAY_H
#define SAY_H

#include <avr/pgmspace.h>
#include <stdint.h>

#include "clock.h"

void say_begin(void);
void say_char(char c);
void say_text(PGM_P text);
void say_string(const char *text);

/* Characters up to the first NUL, at most size. */
void say_name(const char *text, uint8_t size);
void say_number(uint32_t number);
void say_signed(int16_t number);
void say_hex(uint16_t value);
void say_instant(struct instant instant);

/* The checksum and the line end. */
void say_end(void);

/* Copy what is said from now on, until say_end, to a buffer, NUL-terminated. */
void say_record(char *buffer, uint8_t size);

#endif
