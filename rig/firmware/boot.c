#include "boot.h"

#include <avr/io.h>
#include <avr/wdt.h>
#include <stdbool.h>

#include "board.h"

#define RESET_FLAGS (_BV(PORF) | _BV(EXTRF) | _BV(BORF) | _BV(WDRF))
#define POWERED 0xB007

static uint8_t flags __attribute__((section(".noinit")));
static uint8_t bootloader_flags __attribute__((section(".noinit")));
static uint16_t powered __attribute__((section(".noinit")));
static uint8_t cause;

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
