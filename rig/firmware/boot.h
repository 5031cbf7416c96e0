/* The first instructions after a reset, and why there was one. */
#ifndef BOOT_H
#define BOOT_H

#include <avr/pgmspace.h>
#include <stdint.h>

enum cause { CAUSE_POWER, CAUSE_EXTERNAL, CAUSE_BROWNOUT, CAUSE_WATCHDOG };

/* Find the cause. Once, at the start. */
void boot_start(void);

enum cause boot_cause(void);

/* A number of this start, of which no two starts or boxes are likely to have the same. */
uint16_t boot_id(void);

PGM_P cause_name(uint8_t cause);

#endif
