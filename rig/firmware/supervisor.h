/* A second watch over the outputs, which trusts neither the edge list nor its interrupt. */
#ifndef SUPERVISOR_H
#define SUPERVISOR_H

#include <stdbool.h>
#include <stdint.h>

/* Measure how long each output has been high; whether one is high for longer than it may be.
 * `round` changes with every shot, in each of which an output has one pulse: without it two
 * pulses seen at two looks would be taken for one. */
bool supervisor_overtime(uint8_t round);

#endif
