/* A CAN_RAW socket that is none: one end of a socket pair, and a process at the other end that speaks to socketcand. */
#ifndef CANSHIM_H
#define CANSHIM_H

#include <linux/can.h>
#include <linux/can/raw.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

/* A frame on its way to the program. The frame comes first: a program that reads by a way that the library does not
 * see gets the frame alone, since the rest of a packet that does not fit is dropped. */
struct packet {
    struct can_frame frame;
    int64_t seconds, us; /* the server's time stamp */
    uint32_t dropped;    /* frames lost so far, because the program did not read */
    uint32_t own;        /* 1: this socket has sent it */
};

/* What the program has set, for the pump: in memory that both have. */
struct settings {
    atomic_uint version; /* odd while the filters change */
    atomic_uint ended;   /* 1 once the program has closed its socket */
    uint32_t filters, joined, receive_own;
    struct can_filter filter[CAN_RAW_FILTER_MAX];
};

/* Connect to the server and its bus; return the socket, or -1 after a line on stderr. */
int server_connect(const char *address, const char *bus);

/* Carry frames between both ends in a process of its own, until the program has closed its socket, and send the rest.
 * Return false if there is no process. */
bool pump_start(int program, int server, struct settings *settings);

#endif
