#include "line.h"

#include <util/crc16.h>

#include "board.h"
#include "uart.h"

#define CHECK_SIZE 6 /* " *" and four digits */

struct line line;

static uint8_t length; /* of the line that is coming */
static bool spoilt;
static bool carriage_return;

static void take(uint8_t byte)
{
    if (carriage_return) {
        spoilt = true; /* it was not the one before the line end */
        carriage_return = false;
    }
    if (byte == '\r') {
        carriage_return = true;
    } else if (byte < 0x20 || byte > 0x7E || length == LINE_SIZE) {
        spoilt = true;
    } else {
        line.text[length++] = (char)byte;
    }
}

/* Whether there was anything on it. */
static bool finish(void)
{
    uint32_t tick = 0;
    for (uint8_t i = 0; i < 4; i++) {
        tick |= (uint32_t)(uint8_t)uart_get() << (8 * i);
    }
    bool filled = length || spoilt;
    line.tick = tick;
    line.text[length] = 0;
    line.length = length;
    line.sound = !spoilt;
    length = 0;
    spoilt = false;
    carriage_return = false;
    return filled;
}

bool line_poll(void)
{
    int16_t byte;
    while ((byte = uart_get()) >= 0) {
        if (byte != '\n') {
            take((uint8_t)byte);
        } else if (finish()) {
            return true;
        }
    }
    return false;
}

static int8_t digit(char c)
{
    if (c >= '0' && c <= '9') {
        return (int8_t)(c - '0');
    }
    return c >= 'A' && c <= 'F' ? (int8_t)(c - 'A' + 10) : -1;
}

enum check line_check(void)
{
    uint8_t body = line.length;
    uint16_t stated = 0;
    bool checked = body >= CHECK_SIZE;
    if (checked) {
        body -= CHECK_SIZE;
        checked = line.text[body] == ' ' && line.text[body + 1] == '*';
    }
    for (uint8_t i = 2; checked && i < CHECK_SIZE; i++) {
        int8_t value = digit(line.text[body + i]);
        checked = value >= 0;
        stated = (uint16_t)(stated << 4) | (uint8_t)value;
    }
    if (!checked) {
        return CHECK_ABSENT;
    }
    line.text[body] = 0;
    line.length = body;
    line.crc = 0xFFFF;
    for (uint8_t i = 0; i < body; i++) {
        line.crc = _crc_xmodem_update(line.crc, (uint8_t)line.text[i]);
    }
    return line.crc == stated ? CHECK_GOOD : CHECK_WRONG;
}
