#include "reply.h"

#include <avr/pgmspace.h>
#include <stddef.h>

#include "say.h"

static const struct request *answered;
static char *buffer;
static uint8_t buffer_size;

void reply_to(const struct request *request)
{
    answered = request;
    buffer = NULL;
}

void reply_store(char *into, uint8_t size)
{
    buffer = into;
    buffer_size = size;
}

static void head(void)
{
    say_begin();
    if (!answered) {
        say_char('?');
    } else if (answered->numbered) {
        say_number(answered->number);
    } else {
        say_char('-');
    }
    say_char(' ');
    if (buffer) {
        say_record(buffer, buffer_size);
    }
}

void reply_ok(void)
{
    head();
    say_text(PSTR("OK"));
}

void reply_error(enum error error)
{
    head();
    say_text(PSTR("ERR "));
    say_error_code(error);
    say_char(' ');
    say_error_word(error);
    if (answered && answered->numbered) {
        errors_push(error);
    }
}

void reply_error_key(enum error error, uint8_t command, uint8_t argument)
{
    reply_error(error);
    if (error == E_RANGE) {
        say_text(PSTR(" key="));
        say_argument_name(command, argument);
    }
}

void reply_again(const char *stored)
{
    head();
    say_string(stored);
}
