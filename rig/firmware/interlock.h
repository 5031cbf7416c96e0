/* The interlock: a contact to ground. Open, nothing fires. */
#ifndef INTERLOCK_H
#define INTERLOCK_H

#include <avr/pgmspace.h>
#include <stdbool.h>
#include <stdint.h>

void interlock_start(void);

/* What the box says of it: opens at once, closes when it has been closed for 10 ms. */
bool interlock_closed(void);

/* Follow the contact; call often. Answers whether it has opened since the last call. */
bool interlock_poll(void);

/* Whether it opened and interlock_poll has not said so yet. For code with interrupts off. */
bool interlock_tripped(void);

PGM_P interlock_name(bool closed);

#endif
