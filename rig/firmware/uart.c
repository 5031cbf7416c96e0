#include "uart.h"

#include <avr/interrupt.h>
#include <util/atomic.h>

/* 16 MHz / 8 / 17 is 117647 baud, 2.1 % above 115200 and within what both ends stand. */
#define DIVISOR 16

/* A character in ticks (10 bits of 17 us / 2), rounded up: what the shift register may still hold
 * when the data register is empty. */
#define CHARACTER_TICKS 180

/* Interrupts go off this long before a promised tick. Shorter than the edge interrupt is early. */
#define LOCKED_TICKS 24

struct rx_ring uart_rx;

static volatile uint8_t tx_bytes[TX_SIZE];
static volatile uint8_t tx_head;
static volatile uint8_t tx_tail;
static volatile bool tx_held;

void uart_start(void)
{
    UBRR0 = DIVISOR;
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ISR(USART_RX_vect)
{
    uart_receive_locked();
}

ISR(USART_UDRE_vect)
{
    if (tx_held || tx_tail == tx_head) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
        return;
    }
    UDR0 = tx_bytes[tx_tail];
    tx_tail = (tx_tail + 1) & (TX_SIZE - 1);
}

void uart_put(uint8_t byte)
{
    uint8_t next = (tx_head + 1) & (TX_SIZE - 1);
    while (next == tx_tail) {
    }
    tx_bytes[tx_head] = byte;
    tx_head = next;
    if (!tx_held) {
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
        {
            UCSR0B |= _BV(UDRIE0);
        }
    }
}

int16_t uart_get(void)
{
    uint8_t tail = uart_rx.tail;
    if (tail == uart_rx.head) {
        return -1;
    }
    uint8_t byte = uart_rx.bytes[tail];
    uart_rx.tail = (tail + 1) & (RX_SIZE - 1);
    return byte;
}

bool uart_pending(void)
{
    return uart_rx.tail != uart_rx.head;
}

void uart_hold(void)
{
    while (tx_tail != tx_head || !(UCSR0A & _BV(UDRE0))) {
    }
    uint32_t emptied = clock_ticks();
    while (clock_ticks() - emptied < CHARACTER_TICKS) {
    }
    tx_held = true;
}

bool uart_release_at(uint32_t tick)
{
    while ((int32_t)(tick - clock_ticks()) > LOCKED_TICKS) {
    }
    bool met = false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if ((int32_t)(tick - clock_ticks_locked()) > 0) {
            uint8_t first = tx_bytes[tx_tail];
            tx_tail = (tx_tail + 1) & (TX_SIZE - 1);
            while (TCNT1 != (uint16_t)tick) {
            }
            UDR0 = first;
            tx_held = false;
            UCSR0B |= _BV(UDRIE0);
            met = true;
        }
    }
    if (!met) {
        tx_tail = tx_head;
    }
    return met;
}
