#include "edges.h"

#include <stddef.h>
#include <string.h>

#include "board.h"

_Static_assert(offsetof(struct edge, b) == EDGE_B, "player.S");
_Static_assert(offsetof(struct edge, c) == EDGE_C, "player.S");
_Static_assert(offsetof(struct edge, d) == EDGE_D, "player.S");
_Static_assert(offsetof(struct edge, wait) == EDGE_WAIT, "player.S");
_Static_assert(sizeof(struct edge) == EDGE_SIZE, "player.S");
_Static_assert(MIN_GAP > RUN_OVERHEAD, "a run needs a turn of its loop between two edges");
_Static_assert(MAX_EDGES >= 2 * OUTPUTS, "every output has room for both its edges");

struct output outputs[OUTPUTS];
struct edge edges[MAX_EDGES];
uint8_t edges_count;

void outputs_clear(void)
{
    memset(outputs, 0, sizeof outputs);
}

uint16_t edge_pins(const struct edge *edge)
{
    return (uint16_t)((edge->c & PORTC_OUTPUTS) | ((uint16_t)(edge->d & PORTD_OUTPUTS) << 4) |
                      ((uint16_t)(edge->b & PORTB_OUTPUTS) << 12));
}

/* Note an instant once, keeping the list sorted. */
static void insert(uint32_t at)
{
    uint8_t i = edges_count;
    while (i && edges[i - 1].at > at) {
        i--;
    }
    if (i && edges[i - 1].at == at) {
        return;
    }
    memmove(&edges[i + 1], &edges[i], (edges_count - i) * sizeof(struct edge));
    edges[i].at = at;
    edges_count++;
}

/* The levels from an instant on. Both the LED and the pull-ups are in the bytes, because the
 * player writes whole ports; the LED is lit while armed and firing. */
static void set_levels(struct edge *edge, uint16_t mask)
{
    uint16_t pins = 0;
    for (uint8_t i = 0; i < OUTPUTS; i++) {
        const struct output *output = &outputs[i];
        uint16_t bit = (uint16_t)1 << i;
        if ((mask & bit) && edge->at >= output->delay && edge->at - output->delay < output->width) {
            pins |= bit;
        }
    }
    edge->b = (uint8_t)(pins >> 12) | PORTB_REST | (1 << STATUS_BIT);
    edge->c = (pins & PORTC_OUTPUTS) | PORTC_REST;
    edge->d = ((uint8_t)(pins >> 4) & PORTD_OUTPUTS) | PORTD_REST;
}

enum error edges_make(uint16_t mask)
{
    edges_count = 0;
    for (uint8_t i = 0; i < OUTPUTS; i++) {
        if ((mask & ((uint16_t)1 << i)) && outputs[i].width) {
            insert(outputs[i].delay);
            insert(outputs[i].delay + outputs[i].width);
        }
    }
    for (uint8_t i = 0; i < edges_count; i++) {
        struct edge *edge = &edges[i];
        uint32_t gap = i + 1 < edges_count ? edge[1].at - edge->at : UINT32_MAX;
        if (gap < MIN_GAP) {
            edges_count = 0;
            return E_EDGES;
        }
        edge->wait = gap <= RUN_GAP ? (uint8_t)gap - RUN_OVERHEAD : 0;
        edge->late[0] = edge->late[1] = 0;
        set_levels(edge, mask);
    }
    return edges_count ? E_NONE : E_NOTHING;
}

uint8_t edge_late(uint8_t index, uint8_t side)
{
    while (index && edges[index - 1].wait) {
        index--;
    }
    return edges[index].late[side];
}
