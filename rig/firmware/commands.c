#include "commands.h"

#include <stddef.h>

#include "box.h"
#include "repeats.h"
#include "reply.h"
#include "say.h"

static void refuse(const struct request *request, enum error error)
{
    reply_to(request);
    reply_error(error);
    say_end();
}

/* Do a changing request once; a repeat of it gets the first one's reply. */
static void change(const struct request *request, enum check check)
{
    const char *stored = NULL;
    if (check == CHECK_GOOD) {
        stored = repeats_find(request->number, line.crc);
    }
    if (stored) {
        reply_again(stored);
    } else {
        if (check == CHECK_GOOD) {
            reply_store(repeats_add(request->number, line.crc), REPLY_SIZE);
        }
        command_change(request);
    }
}

void command_line(void)
{
    struct request request;
    if (!line.sound) {
        refuse(NULL, E_CHARACTER);
        return;
    }
    enum check check = line_check();
    if (check == CHECK_WRONG) {
        refuse(NULL, E_CHECKSUM);
        return;
    }
    enum error error = request_parse(&request, check);
    if (error) {
        refuse(&request, error);
        return;
    }
    /* Only a checked request proves that a host is there. Noise does not, and neither does the
     * box's own voice on a line that echoes. */
    if (check == CHECK_GOOD) {
        box_heard(line.tick);
    }
    reply_to(&request);
    if (request_is_query(request.command)) {
        command_query(&request);
    } else {
        change(&request, check);
    }
    say_end();
}
