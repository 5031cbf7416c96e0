#include "store.h"

#include <avr/eeprom.h>
#include <avr/wdt.h>
#include <string.h>
#include <util/crc16.h>

/* A byte of EEPROM stands 100 000 writes. Each start writes another one of these places. */
#define PLACES 64

struct start {
    uint8_t count[3];
    uint8_t check;
};

/* The name is written to the older of two places, its checksum last, so a power loss in between
 * leaves the other one. */
struct name {
    uint8_t generation;
    char text[NAME_SIZE];
    uint8_t check;
};

static struct start starts[PLACES] EEMEM;
static struct name names[2] EEMEM;

static uint32_t boot;
static struct name name;
static uint8_t name_place;
static uint8_t left_to_write;

static uint8_t check_of(const void *data, uint8_t size)
{
    const uint8_t *bytes = data;
    uint8_t crc = 0xA5; /* neither blank nor zeroed memory passes */
    while (size--) {
        crc = _crc_ibutton_update(crc, *bytes++);
    }
    return crc;
}

static uint32_t last_start(void)
{
    uint32_t last = 0;
    for (uint8_t i = 0; i < PLACES; i++) {
        struct start start;
        eeprom_read_block(&start, &starts[i], sizeof start);
        uint32_t count =
            start.count[0] | (uint32_t)start.count[1] << 8 | (uint32_t)start.count[2] << 16;
        if (start.check == check_of(start.count, sizeof start.count) && count > last) {
            last = count;
        }
    }
    return last;
}

static void count_start(void)
{
    boot = last_start() + 1;
    struct start start = {{(uint8_t)boot, (uint8_t)(boot >> 8), (uint8_t)(boot >> 16)}, 0};
    start.check = check_of(start.count, sizeof start.count);
    wdt_reset();
    eeprom_update_block(&start, &starts[boot % PLACES], sizeof start);
    /* Nothing is said under a count that a power loss could still take back. */
    eeprom_busy_wait();
}

static void read_name(void)
{
    bool found = false;
    for (uint8_t i = 0; i < 2; i++) {
        struct name read;
        eeprom_read_block(&read, &names[i], sizeof read);
        bool whole = read.check == check_of(&read, sizeof read - 1);
        if (whole && (!found || (int8_t)(read.generation - name.generation) > 0)) {
            name = read;
            name_place = i;
            found = true;
        }
    }
    if (!found) {
        strcpy(name.text, "unnamed");
    }
}

void store_start(void)
{
    count_start();
    read_name();
}

uint32_t store_boot(void)
{
    return boot;
}

const char *store_name(void)
{
    return name.text;
}

void store_rename(const char *text)
{
    if (!left_to_write) { /* a name half written is written over in its own place */
        name_place ^= 1;
        name.generation++;
    }
    strncpy(name.text, text, NAME_SIZE);
    name.check = check_of(&name, sizeof name - 1);
    left_to_write = sizeof name;
}

bool store_poll(void)
{
    if (left_to_write && eeprom_is_ready()) {
        uint8_t i = sizeof name - left_to_write--;
        eeprom_update_byte((uint8_t *)&names[name_place] + i, ((uint8_t *)&name)[i]);
    }
    return left_to_write;
}
