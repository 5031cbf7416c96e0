/* The serial line: 115200 baud, 8N1, a ring for each direction. */
#ifndef UART_H
#define UART_H

#include <avr/io.h>
#include <stdbool.h>
#include <stdint.h>

#include "clock.h"

#define RX_SIZE 128 /* powers of two */
#define TX_SIZE 64

/* Stands in the ring where bytes were lost. It is not printable, so the line around it is refused. */
#define RX_DAMAGE 0x00

struct rx_ring {
    uint8_t bytes[RX_SIZE];
    volatile uint8_t head;
    volatile uint8_t tail;
    bool lost;
};

extern struct rx_ring uart_rx;

void uart_start(void);

/* Queue one byte; waits while the ring is full. */
void uart_put(uint8_t byte);

/* The next byte received, or -1. Behind every line end follow the four bytes, lowest first, of the
 * tick at which it came. */
int16_t uart_get(void);

bool uart_pending(void);

/* Hold back what is put from now on, having let out everything before, its last stop bit included.
 * No more than TX_SIZE - 1 bytes may be put until uart_release_at. */
void uart_hold(void);

/* Begin to send what was held back exactly at a tick. When the tick can no longer be met: false,
 * what was held back is dropped, and what is put from now on is still held. */
bool uart_release_at(uint32_t tick);

static inline __attribute__((always_inline)) uint8_t uart_rx_push(uint8_t head, uint8_t byte)
{
    uart_rx.bytes[head] = byte;
    return (head + 1) & (RX_SIZE - 1);
}

/* Take the byte that has come into the ring. Inline, because the edge interrupt too calls it while
 * it waits, and a call would cost it 30 cycles of saved registers. */
static inline __attribute__((always_inline)) void uart_receive_locked(void)
{
    bool damaged = (UCSR0A & (_BV(FE0) | _BV(DOR0))) || uart_rx.lost;
    uint8_t byte = UDR0;
    uint8_t head = uart_rx.head;
    uint8_t room = (uart_rx.tail - head - 1) & (RX_SIZE - 1);
    uart_rx.lost = room < 6; /* a mark, a line end and its tick */
    if (uart_rx.lost) {
        return;
    }
    if (damaged) {
        head = uart_rx_push(head, RX_DAMAGE);
    }
    head = uart_rx_push(head, byte);
    if (byte == '\n') {
        union halves tick = {.all = clock_ticks_locked()};
        head = uart_rx_push(head, (uint8_t)tick.low);
        head = uart_rx_push(head, (uint8_t)(tick.low >> 8));
        head = uart_rx_push(head, (uint8_t)tick.high);
        head = uart_rx_push(head, (uint8_t)(tick.high >> 8));
    }
    uart_rx.head = head;
}

#endif
