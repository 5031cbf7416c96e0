/* Where player.S finds what in a struct edge; edges.c asserts that it is so. */
#ifndef EDGE_LAYOUT_H
#define EDGE_LAYOUT_H

#define EDGE_B 4
#define EDGE_C 5
#define EDGE_D 6
#define EDGE_WAIT 7
#define EDGE_SIZE 10

/* From one edge to the next within a run player.S needs 2 ticks and one for each turn of its
 * loop, of which there is at least one: 3 ticks, and MIN_GAP asks for 4. */
#define RUN_OVERHEAD 2

/* Edges nearer than this are one run, played without looking at the clock in between. Further
 * ones are synchronised anew, for which the edge interrupt needs less than this. */
#define RUN_GAP 32

/* Ticks that synchronising takes, from the begin of the tick that is waited for to the edge. */
#define SYNC_TICKS 6

#endif
