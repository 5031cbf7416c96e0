#include "boot.h"

#include <avr/io.h>
#include <avr/wdt.h>
#include <stdbool.h>
#include <util/crc16.h>

#include "board.h"

#define RESET_FLAGS (_BV(PORF) | _BV(EXTRF) | _BV(BORF) | _BV(WDRF))
#define POWERED 0xB007

static uint8_t flags __attribute__((section(".noinit")));
static uint8_t bootloader_flags __attribute__((section(".noinit")));
static uint16_t powered __attribute__((section(".noinit")));
static uint16_t id __attribute__((section(".noinit")));
static uint8_t cause;

extern const uint8_t __heap_start; /* the linker's: where RAM begins that the program does not use */

/* Before the C runtime clears its memory, which takes a millisecond in which a pin might float.
 * The watchdog is set here too: after a watchdog reset it runs on at 15 ms. */
void boot_first(void) __attribute__((naked, used, section(".init3")));
void boot_first(void)
{
    PORTB = PORTB_REST;
    PORTC = PORTC_REST;
    PORTD = PORTD_REST;
    DDRB = PORTB_OUTPUTS | _BV(STATUS_BIT);
    DDRC = PORTC_OUTPUTS;
    DDRD = PORTD_OUTPUTS;
    flags = MCUSR;
    __asm__ volatile("sts %0, r2" : "=m"(bootloader_flags));
    MCUSR = 0;
    wdt_enable(WDTO_250MS);
}

/* Unused RAM comes up in a pattern that differs from chip to chip and, in part, from start to start.
 * After a reset that keeps it, what the last start has left there and its id make the new one. */
static void make_id(void)
{
    for (const uint8_t *byte = &__heap_start; byte < (const uint8_t *)SP; byte++) {
        id = _crc_xmodem_update(id, *byte);
    }
    id++; /* of RAM full of zeros too */
}

/* A bootloader clears the flags before us. Optiboot from version 5 on hands them on in r2; older
 * ones lose them, and then RAM that still holds its mark tells a reset from a power-up. */
void boot_start(void)
{
    bool warm = powered == POWERED;
    uint8_t known = flags & RESET_FLAGS;
    if (!known && !(bootloader_flags & (uint8_t)~RESET_FLAGS)) {
        known = bootloader_flags;
    }
    powered = POWERED;
    make_id();
    if (known & _BV(PORF)) {
        cause = CAUSE_POWER;
    } else if (known & _BV(WDRF)) {
        cause = CAUSE_WATCHDOG;
    } else if (known & _BV(BORF)) {
        cause = CAUSE_BROWNOUT;
    } else if (known & _BV(EXTRF)) {
        cause = CAUSE_EXTERNAL;
    } else {
        cause = warm ? CAUSE_EXTERNAL : CAUSE_POWER;
    }
}

enum cause boot_cause(void)
{
    return cause;
}

uint16_t boot_id(void)
{
    return id;
}

PGM_P cause_name(uint8_t of)
{
    switch (of) {
    case CAUSE_POWER:
        return PSTR("POWER");
    case CAUSE_EXTERNAL:
        return PSTR("EXTERNAL");
    case CAUSE_BROWNOUT:
        return PSTR("BROWNOUT");
    default:
        return PSTR("WATCHDOG");
    }
}
