#include <errno.h>
#include <fcntl.h>
#include <pty.h>
#include <simavr/avr_uart.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "runner.h"

/* 10 bits at 115200 baud; and at the 117647 that the processor makes of it. simavr would count 11
 * bits in either direction. */
#define BYTE_CYCLES 1389
#define SENT_BYTE_CYCLES 1360

/* simavr holds a byte back for a byte's time again before it shows it. Shorter, so that the next
 * one finds the receiver empty: with two in it its interrupt comes no more. */
#define SHOW_CYCLES 1000
#define RETRY_CYCLES 16
#define QUEUE (1 << 20)

bool serial_line_ended;

static int master;
static uint8_t queue[QUEUE];
static size_t queue_head, queue_tail;
static uint8_t taken[1 << 16];
static size_t taken_count;

const char *serial_open(void)
{
    static char name[64];
    struct termios raw;
    int slave;
    if (openpty(&master, &slave, name, NULL, NULL)) {
        perror("openpty");
        exit(1);
    }
    /* The other end stays open here too: without it, reading fails while no host is connected. */
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    fcntl(master, F_SETFL, O_NONBLOCK);
    return name;
}

int serial_fd(void)
{
    return master;
}

/* A byte leaves the box. With nobody reading, a full buffer loses it, as a wire would. */
static void sent(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    (void)parameter;
    uint8_t byte = (uint8_t)value;
    ssize_t written = write(master, &byte, 1);
    (void)written;
    if (taken_count < sizeof taken) {
        taken[taken_count++] = byte;
    }
    serial_line_ended |= byte == '\n';
    board_log("tx", byte);
}

static avr_uart_t *uart(void)
{
    avr_io_t *io = avr->io_port;
    while (strcmp(io->kind, "uart")) {
        io = io->next;
    }
    return (avr_uart_t *)io;
}

/* The wire goes on at its rate: what is late because the receiver was full delays nothing. */
static avr_cycle_count_t byte_time(struct avr_t *of, avr_cycle_count_t when, void *parameter)
{
    static avr_cycle_count_t due;
    avr_uart_t *receiver = parameter;
    if (due > when || when - due >= BYTE_CYCLES) {
        due = when;
    }
    receiver->cycles_per_byte = SENT_BYTE_CYCLES;
    if (queue_tail != queue_head) {
        if (receiver->input.read != receiver->input.write) {
            return when + RETRY_CYCLES;
        }
        uint8_t byte = queue[queue_tail++ % QUEUE];
        board_log("rx", byte);
        receiver->cycles_per_byte = SHOW_CYCLES;
        avr_raise_irq(avr_io_getirq(of, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
        receiver->cycles_per_byte = SENT_BYTE_CYCLES;
    }
    due += BYTE_CYCLES;
    return due;
}

void serial_attach(void)
{
    static bool connected;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags); /* no echo on standard output */
    if (!connected) {
        avr_irq_register_notify(
            avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
        connected = true;
    }
    queue_tail = queue_head; /* a reset loses what was on the line */
    avr_cycle_timer_register(avr, BYTE_CYCLES, byte_time, uart());
}

void serial_send(const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count && queue_head - queue_tail < QUEUE; i++) {
        queue[queue_head++ % QUEUE] = bytes[i];
    }
}

void serial_poll(void)
{
    uint8_t bytes[256];
    ssize_t count;
    /* Not more than a wire holds: the rest waits in the host, which then notices. */
    while (queue_head - queue_tail < sizeof bytes &&
           (count = read(master, bytes, sizeof bytes)) > 0) {
        serial_send(bytes, (size_t)count);
    }
}

size_t serial_taken(const uint8_t **bytes)
{
    *bytes = taken;
    return taken_count;
}

void serial_taken_clear(void)
{
    taken_count = 0;
    serial_line_ended = false;
}
