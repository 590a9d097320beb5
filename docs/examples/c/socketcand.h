/* A CAN bus behind a socketcand server: connect, send a frame, receive a frame with a time limit. */

#ifndef SOCKETCAND_H
#define SOCKETCAND_H

#include <stdbool.h>
#include <stdint.h>

struct frame {
    unsigned id;      /* 11 bits */
    unsigned length;  /* 0 to 8 */
    uint8_t data[8];
};

/* Connect to a server at this machine and open its bus in raw mode; return the socket, or -1. */
int can_open(int port);

bool can_send(int bus, const struct frame *frame);

/* Wait at most so long for a frame; return false if none has come, or the connection has ended. */
bool can_receive(int bus, struct frame *frame, int timeout_ms);

#endif
