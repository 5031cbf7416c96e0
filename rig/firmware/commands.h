/* Does what requests ask for and answers them. */
#ifndef COMMANDS_H
#define COMMANDS_H

#include "request.h"

/* Answer the line that has come. */
void command_line(void);

void command_query(const struct request *request);
void command_change(const struct request *request);

#endif
