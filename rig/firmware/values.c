#include "values.h"

#include <avr/pgmspace.h>
#include <ctype.h>
#include <stdbool.h>
#include <string.h>

#define MAX_PADDING 60

enum error value_number(const char *text, uint32_t least, uint32_t most, uint32_t *number)
{
    uint32_t value = 0;
    bool over = false;
    if (!*text) {
        return E_TYPE;
    }
    for (; *text; text++) {
        if (!isdigit(*text)) {
            return E_TYPE;
        }
        uint8_t digit = (uint8_t)(*text - '0');
        over |= value > (UINT32_MAX - digit) / 10;
        value = value * 10 + digit;
    }
    *number = value;
    return over || value < least || value > most ? E_RANGE : E_NONE;
}

enum error value_mask(const char *text, uint16_t *mask)
{
    *mask = 0;
    uint8_t digits = 0;
    for (; isxdigit(*text) && !islower(*text) && digits < 5; text++, digits++) {
        uint8_t digit = isdigit(*text) ? *text - '0' : *text - 'A' + 10;
        *mask = (uint16_t)(*mask << 4) | digit;
    }
    return *text || digits != 4 ? E_TYPE : E_NONE;
}

enum error value_name(const char *text, const char *others, uint8_t size, char *name)
{
    uint8_t length = (uint8_t)strlen(text);
    if (!length || length > size) {
        return E_TYPE;
    }
    for (uint8_t i = 0; i < length; i++) {
        if (!isalnum(text[i]) && !strchr_P(others, text[i])) {
            return E_TYPE;
        }
    }
    strncpy(name, text, size);
    return E_NONE;
}

enum error value_padding(const char *text)
{
    uint8_t length = (uint8_t)strlen(text);
    if (strspn_P(text, PSTR("x")) != length) {
        return E_TYPE;
    }
    return length < 1 || length > MAX_PADDING ? E_RANGE : E_NONE;
}
