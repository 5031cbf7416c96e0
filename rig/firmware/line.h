/* Cuts what comes over the serial line into lines, and checks them. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

enum check { CHECK_ABSENT, CHECK_GOOD, CHECK_WRONG };

struct line {
    char text[96]; /* NUL-terminated; line_check cuts the checksum off */
    uint8_t length;
    bool sound;     /* printable, not over-long, nothing lost */
    uint32_t tick;  /* when its end came */
    uint16_t crc;   /* of the text, after line_check */
};

extern struct line line;

/* Whether a whole line that is not empty has come and stands in `line` now. */
bool line_poll(void);

enum check line_check(void);

#endif
