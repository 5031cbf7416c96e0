/* What is kept over power loss: the count of starts and the box's name. */
#ifndef STORE_H
#define STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

/* Read both, and count this start. Takes 17 ms. */
void store_start(void);

/* Which start this is, from 1. */
uint32_t store_boot(void);

/* The box's name, padded with NULs. */
const char *store_name(void);

/* Take a new name. It is written byte by byte while other work goes on; until all is written the
 * old one would come back after a power loss. */
void store_rename(const char *name);

/* Write the next byte of a new name if the memory is ready; whether more are left. */
bool store_poll(void);

#endif
