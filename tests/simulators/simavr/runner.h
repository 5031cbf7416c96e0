/* Runs the firmware on simavr. The serial line is a pseudo-terminal; every change of an output is
 * logged with its cycle; orders come on standard input (see ../README.md). */
#ifndef RUNNER_H
#define RUNNER_H

#include <simavr/sim_avr.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CLOCK_HZ 16000000u

/* board.c: the processor, its pins, its resets, the log. */
extern avr_t *avr;

void board_load(const char *elf, const char *log);
void board_log(const char *what, unsigned value);
void board_log_flush(void);

/* Cycles since the power came first; the processor's own count begins anew with each reset. */
uint64_t board_cycle(void);
void board_interlock(bool open);

/* Write to the data space as an instruction would, registers' effects included. */
void board_poke(uint16_t address, uint8_t value);

/* `flags` as in MCUSR; a power-up also spoils the RAM. */
void board_reset(uint8_t flags);

/* Run to the first instruction at or behind a cycle, or until *stop. */
void board_run(uint64_t cycle, const bool *stop);

/* serial.c: the line, paced as a wire is. */
const char *serial_open(void);
int serial_fd(void);
void serial_attach(void); /* after every reset */
void serial_poll(void);
void serial_send(const uint8_t *bytes, size_t count);

/* What the box has sent since the last call, and whether a line end was among it. */
extern bool serial_line_ended;
size_t serial_taken(const uint8_t **bytes);
void serial_taken_clear(void);

/* orders.c */
enum pace { PACE_OFF, PACE_REAL, PACE_FULL };
extern enum pace pace;

/* Do one order and answer it; false for `quit`. */
bool order_do(char *line);

/* Put the orders that are due at a cycle back on the clock; after every reset. */
void order_attach(void);

#endif
