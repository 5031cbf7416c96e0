#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "runner.h"

#define MCUSR 0x54
#define RAM_BEGIN 0x100
#define PORF 0x01
#define WDRF 0x08
#define INTERLOCK_PIN 4
#define OUTPUTS 16

avr_t *avr;

static FILE *log_file;
static uint64_t cycles_before; /* of the processor's present run */
static bool interlock_open;
static char output_numbers[4 * 8]; /* by port and bit */
static bool levels[OUTPUTS + 1];
static void (*own_reset)(struct avr_t *);
static bool was_reset;

uint64_t board_cycle(void)
{
    return cycles_before + avr->cycle;
}

void board_log(const char *what, unsigned value)
{
    fprintf(log_file, "%llu %s %u\n", (unsigned long long)board_cycle(), what, value);
}

void board_log_flush(void)
{
    fflush(log_file);
}

static void set_level(int output, bool level)
{
    if (levels[output] != level) {
        levels[output] = level;
        fprintf(log_file, "%llu %d %d\n", (unsigned long long)board_cycle(), output, level);
    }
}

static void pin_changed(struct avr_irq_t *irq, uint32_t value, void *number)
{
    (void)irq;
    set_level(*(char *)number, value);
}

static void note_reset(struct avr_t *of)
{
    own_reset(of);
    was_reset = true;
}

static void no_sleep(avr_t *of, avr_cycle_count_t cycles)
{
    (void)of;
    (void)cycles;
}

static void quiet(avr_t *of, const int level, const char *format, va_list arguments)
{
    (void)of;
    if (level <= LOG_ERROR) {
        vfprintf(stderr, format, arguments);
    }
}

static void watch_output(int number, char port, int bit)
{
    char *slot = &output_numbers[(port - 'A') * 8 + bit];
    *slot = (char)number;
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(port), bit), pin_changed,
                            slot);
}

void board_interlock(bool open)
{
    avr_ioport_external_t external = {
        .name = 'B', .mask = 1 << INTERLOCK_PIN, .value = open ? 1 << INTERLOCK_PIN : 0};
    interlock_open = open;
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('B'), &external);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), INTERLOCK_PIN), open);
}

/* What simavr's own reset leaves out, and what it undoes. */
static void after_reset(uint8_t flags)
{
    avr->data[MCUSR] = flags;
    was_reset = false;
    board_log("reset", flags);
    for (int output = 1; output <= OUTPUTS; output++) {
        set_level(output, false); /* the pins are inputs now, which a resistor pulls low */
    }
    /* Outputs 7 and 8 are also inputs of external interrupts. Nobody uses these, but simavr would
     * look at a low one in every cycle. */
    for (uint8_t i = 0; i < 2; i++) {
        avr_extint_set_strict_lvl_trig(avr, i, 0);
    }
    serial_attach();
    order_attach();
    board_interlock(interlock_open);
}

void board_poke(uint16_t address, uint8_t value)
{
    avr_io_addr_t io = AVR_DATA_TO_IO(address);
    if (address >= AVR_IO_TO_DATA(0) && address < RAM_BEGIN && avr->io[io].w.c) {
        avr->io[io].w.c(avr, address, value, avr->io[io].w.param);
    } else {
        avr_core_watch_write(avr, address, value);
    }
}

void board_reset(uint8_t flags)
{
    cycles_before += avr->cycle;
    avr->cycle = 0;
    if (flags & PORF) {
        for (unsigned i = RAM_BEGIN; i <= avr->ramend; i++) {
            avr->data[i] = 0xA5;
        }
    }
    avr_reset(avr);
    after_reset(flags);
}

void board_load(const char *elf, const char *log)
{
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    avr_global_logger_set(quiet);
    log_file = fopen(log, "w");
    if (!log_file || elf_read_firmware(elf, &firmware)) {
        fprintf(stderr, "cannot read %s or write %s\n", elf, log);
        exit(1);
    }
    avr = avr_make_mcu_by_name("atmega328p");
    avr_init(avr);
    own_reset = avr->reset;
    avr->reset = note_reset;
    avr->frequency = CLOCK_HZ;
    avr->sleep = no_sleep;
    avr_load_firmware(avr, &firmware);
    for (int i = 0; i < 6; i++) {
        watch_output(1 + i, 'C', i);
        watch_output(7 + i, 'D', 2 + i);
    }
    for (int i = 0; i < 4; i++) {
        watch_output(13 + i, 'B', i);
    }
    board_reset(PORF);
}

void board_run(uint64_t cycle, const bool *stop)
{
    while (board_cycle() < cycle && !*stop) {
        avr_cycle_count_t before = avr->cycle;
        int state = avr_run(avr);
        if (was_reset) { /* by the watchdog, which may have set the cycles back */
            cycles_before += avr->cycle < before ? before : 0;
            after_reset(WDRF);
        }
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "the processor stopped at %#x\n", avr->pc);
            exit(1);
        }
    }
}
