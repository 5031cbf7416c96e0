#include "say.h"

#include <stdlib.h>
#include <util/crc16.h>

#include "uart.h"

static uint16_t crc;
static char *record;
static uint8_t record_room;

void say_begin(void)
{
    crc = 0xFFFF;
    record = 0;
}

void say_record(char *buffer, uint8_t size)
{
    record = buffer;
    record_room = size;
    *record = 0;
}

void say_char(char c)
{
    crc = _crc_xmodem_update(crc, (uint8_t)c);
    uart_put((uint8_t)c);
    if (record && record_room > 1) {
        *record++ = c;
        *record = 0;
        record_room--;
    }
}

void say_text(PGM_P text)
{
    char c;
    while ((c = (char)pgm_read_byte(text++))) {
        say_char(c);
    }
}

void say_string(const char *text)
{
    while (*text) {
        say_char(*text++);
    }
}

void say_name(const char *text, uint8_t size)
{
    while (size-- && *text) {
        say_char(*text++);
    }
}

void say_number(uint32_t number)
{
    char digits[11];
    say_string(ultoa(number, digits, 10));
}

void say_signed(int16_t number)
{
    char digits[7];
    say_string(itoa(number, digits, 10));
}

static void say_digit(uint8_t digit)
{
    say_char((char)(digit < 10 ? '0' + digit : 'A' - 10 + digit));
}

void say_hex(uint16_t value)
{
    for (int8_t shift = 12; shift >= 0; shift -= 4) {
        say_digit((value >> shift) & 0x0F);
    }
}

void say_instant(struct instant instant)
{
    say_hex(instant.high);
    say_hex((uint16_t)(instant.low >> 16));
    say_hex((uint16_t)instant.low);
}

void say_end(void)
{
    uint16_t sum = crc;
    record = 0;
    say_text(PSTR(" *"));
    say_hex(sum);
    uart_put('\n');
}
