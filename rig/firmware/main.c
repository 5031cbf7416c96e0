/* The trigger box: see docs/reference/trigger-protocol.md for what it does, README.md for its wiring. */
#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "boot.h"
#include "box.h"
#include "clock.h"
#include "commands.h"
#include "events.h"
#include "interlock.h"
#include "line.h"
#include "results.h"
#include "store.h"
#include "uart.h"

/* Asleep the processor answers an interrupt always after the same time. The check and the sleep
 * are one piece with interrupts off, or what came in between would wait for the next overflow. */
static void idle(bool writing)
{
    cli();
    if (writing || uart_pending() || interlock_tripped() != !interlock_closed() || box_pending()) {
        sei();
        return;
    }
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
}

int main(void)
{
    boot_start();
    clock_start();
    uart_start();
    store_start();
    results_start();
    interlock_start();
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();
    uart_put('\n'); /* ends the line that the reset may have cut */
    events_add_boot(store_boot(), boot_id(), boot_cause());
    for (;;) {
        wdt_reset();
        box_poll();
        bool sent = events_send();
        if (line_poll()) {
            box_poll();
            command_line();
        }
        idle(store_poll() || sent);
    }
}
