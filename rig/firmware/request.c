#include "request.h"

#include <avr/pgmspace.h>
#include <ctype.h>
#include <string.h>

#include "say.h"

struct entry {
    char name[10];
    char arguments[27]; /* names, a space between */
};

static const struct entry table[COMMANDS] PROGMEM = {
    [C_IDN] = {"*IDN?", ""},
    [C_CAP] = {"CAP?", ""},
    [C_SAFE] = {"SAFE?", ""},
    [C_BOOT] = {"BOOT?", ""},
    [C_STAT] = {"STAT?", ""},
    [C_TIME] = {"TIME?", "pad"},
    [C_SYST_ERR] = {"SYST:ERR?", ""},
    [C_LOG] = {"LOG?", "n"},
    [C_RES] = {"RES?", "cap"},
    [C_EDGE] = {"EDGE?", "cap i"},
    [C_SHOT] = {"SHOT?", "cap k"},
    [C_OUT] = {"OUT", "ch d w"},
    [C_ARM] = {"ARM", "cap mask n iv lead ttl dm"},
    [C_FIRE] = {"FIRE", "cap"},
    [C_DISARM] = {"DISARM", "cap"},
    [C_ABORT] = {"ABORT", ""},
    [C_RST] = {"*RST", ""},
    [C_CLS] = {"*CLS", ""},
    [C_SERIAL] = {"SERIAL", "sn"},
};

bool request_is_query(uint8_t command)
{
    PGM_P name = table[command].name;
    return pgm_read_byte(name + strlen_P(name) - 1) == '?';
}

/* Cut the first word off; NULL when the text has been used up. */
static char *next_word(char **text)
{
    char *word = *text;
    if (word) {
        char *end = strchr(word, ' ');
        if (end) {
            *end++ = 0;
        }
        *text = end;
    }
    return word;
}

static bool has_empty_word(const char *text)
{
    return !*text || *text == ' ' || strstr_P(text, PSTR("  ")) || text[strlen(text) - 1] == ' ';
}

static bool parse_number(const char *word, uint16_t *number)
{
    uint32_t value = 0;
    uint8_t digits = 0;
    for (; isdigit(*word) && digits < 6; digits++) {
        value = value * 10 + (uint8_t)(*word++ - '0');
    }
    *number = (uint16_t)value;
    return !*word && digits >= 1 && digits <= 5 && value <= UINT16_MAX;
}

static uint8_t find_command(const char *word)
{
    uint8_t command = 0;
    while (command < COMMANDS && strcmp_P(word, table[command].name)) {
        command++;
    }
    return command;
}

/* Which argument of the command is called so: from 0; -1 for none. */
static int8_t find_argument(uint8_t command, const char *name, uint8_t size)
{
    PGM_P names = table[command].arguments;
    for (int8_t i = 0; pgm_read_byte(names); i++) {
        PGM_P end = names;
        while (pgm_read_byte(end) && pgm_read_byte(end) != ' ') {
            end++;
        }
        if (end - names == size && !strncmp_P(name, names, size)) {
            return i;
        }
        names = pgm_read_byte(end) ? end + 1 : end;
    }
    return -1;
}

static bool is_key(const char *word, uint8_t size)
{
    for (uint8_t i = 0; i < size; i++) {
        if (!isalnum(word[i]) && word[i] != '_') {
            return false;
        }
    }
    return size && !isdigit(word[0]);
}

static enum error take_argument(struct request *request, const char *word)
{
    const char *equals = strchr(word, '=');
    if (!equals || !is_key(word, (uint8_t)(equals - word))) {
        return E_SYNTAX;
    }
    int8_t i = find_argument(request->command, word, (uint8_t)(equals - word));
    if (i < 0 || request->values[i]) {
        return E_PARAMETER;
    }
    request->values[i] = equals + 1;
    return E_NONE;
}

/* Those that must be there: the dead man's time may be left out, and hosts of old do. */
static uint8_t count_arguments(uint8_t command)
{
    PGM_P names = table[command].arguments;
    uint8_t count = pgm_read_byte(names) ? 1 : 0;
    for (char c; (c = (char)pgm_read_byte(names)); names++) {
        count += c == ' ';
    }
    return command == C_ARM ? count - 1 : count;
}

static enum error take_arguments(struct request *request, char *rest)
{
    char *word;
    memset(request->values, 0, sizeof request->values);
    while ((word = next_word(&rest))) {
        enum error error = take_argument(request, word);
        if (error) {
            return error;
        }
    }
    for (uint8_t i = count_arguments(request->command); i--;) {
        if (!request->values[i]) {
            return E_MISSING;
        }
    }
    return E_NONE;
}

enum error request_parse(struct request *request, enum check check)
{
    char *rest = line.text;
    bool empty_word = has_empty_word(rest);
    char *word = next_word(&rest);
    request->numbered = parse_number(word, &request->number);
    if (request->numbered) {
        word = next_word(&rest);
    } else if (check == CHECK_GOOD) {
        return E_SYNTAX;
    }
    if (!word || empty_word) {
        return E_SYNTAX;
    }
    request->command = find_command(word);
    if (request->command == COMMANDS) {
        return E_COMMAND;
    }
    if (check == CHECK_ABSENT && request->command != C_ABORT &&
        !request_is_query(request->command)) {
        return E_UNCHECKED;
    }
    return take_arguments(request, rest);
}

void say_argument_name(uint8_t command, uint8_t argument)
{
    PGM_P names = table[command].arguments;
    while (argument) {
        argument -= pgm_read_byte(names++) == ' ';
    }
    for (char c; (c = (char)pgm_read_byte(names)) && c != ' '; names++) {
        say_char(c);
    }
}
