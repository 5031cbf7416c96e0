/* The outputs as the host has set them, and the sorted list of edges made of them at ARM. */
#ifndef EDGES_H
#define EDGES_H

#include "edge_layout.h"

#ifndef __ASSEMBLER__

#include <stdint.h>

#include "board.h"
#include "errors.h"

struct output {
    uint32_t delay;
    uint32_t width; /* 0: no pulse */
};

/* One instant at which outputs change, and what the three ports hold from then on. `wait` is the
 * way to the next edge of the same run (see player.S), 0 when none follows so soon. `late` is
 * noted at the first edge of a run: this shot's and the last one's, by turns. */
struct edge {
    uint32_t at;
    uint8_t b;
    uint8_t c;
    uint8_t d;
    uint8_t wait;
    uint8_t late[2];
};

extern struct output outputs[OUTPUTS];
extern struct edge edges[MAX_EDGES];
extern uint8_t edges_count;

void outputs_clear(void);

/* Make the list for the outputs of a mask; E_NOTHING, E_EDGES or E_NONE. */
enum error edges_make(uint16_t mask);

uint16_t edge_pins(const struct edge *edge);

/* Lateness of an edge: that of the run it belongs to. */
uint8_t edge_late(uint8_t index, uint8_t side);

#endif
#endif
