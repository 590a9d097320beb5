/* Move an axis to a position in profile position mode (CiA 402), and check its statusword on the way.
 *
 * Usage: profile_move PORT NODE TARGET     the port of a socketcand server, the node id, the target in wire units
 * Exit code: 0 the axis is at its target, 1 it is not (stderr says why), 2 bad arguments, 4 no connection.
 */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "socketcand.h"

enum {
    SDO_REQUEST = 0x600, SDO_RESPONSE = 0x580,
    CONTROLWORD = 0x6040, STATUSWORD = 0x6041, MODE = 0x6060, POSITION = 0x6064, TARGET_POSITION = 0x607A,
    PROFILE_POSITION = 1,
    ANSWER_MS = 2000, POLLS_MAX = 500,
};

static int bus;
static unsigned node;

static _Noreturn void fail(const char *what)
{
    fprintf(stderr, "profile_move: %s\n", what);
    exit(1);
}

/* Send an SDO request and return the answer to it (CiA 301, 7.2.4.3); fail if it is an abort or does not come. */
static struct frame sdo(uint8_t command, unsigned index, uint32_t value)
{
    struct frame frame = {SDO_REQUEST + node, 8, {command, index & 0xFF, index >> 8, 0}};
    for (int i = 0; i < 4; i++)
        frame.data[4 + i] = value >> 8 * i & 0xFF;
    if (!can_send(bus, &frame))
        fail("the connection has ended");
    while (can_receive(bus, &frame, ANSWER_MS))
        if (frame.id == SDO_RESPONSE + node && frame.length == 8) {
            if (frame.data[0] == 0x80)
                fail("an SDO request was aborted");
            return frame;
        }
    fail("no answer to an SDO request");
}

static void write_object(unsigned index, unsigned bytes, uint32_t value)
{
    sdo((uint8_t)(0x23 | (4 - bytes) << 2), index, value);
}

static uint32_t read_object(unsigned index)
{
    struct frame answer = sdo(0x40, index, 0);
    uint32_t value = 0;
    unsigned bytes = 4 - (answer.data[0] >> 2 & 3);
    for (unsigned i = 0; i < bytes; i++)
        value |= (uint32_t)answer.data[4 + i] << 8 * i;
    return value;
}

/* Read the statusword until these bits of it are so. */
static void await_status(unsigned mask, unsigned bits, const char *what)
{
    for (int i = 0; i < POLLS_MAX; i++)
        if ((read_object(STATUSWORD) & mask) == bits)
            return;
        else {
            struct frame other;
            can_receive(bus, &other, 20); /* let time pass; what comes is not for us */
        }
    fail(what);
}

static void control(unsigned controlword)
{
    write_object(CONTROLWORD, 2, controlword);
}

int main(int count, char **arguments)
{
    if (count != 4) {
        fprintf(stderr, "usage: %s PORT NODE TARGET\n", arguments[0]);
        return 2;
    }
    node = (unsigned)strtoul(arguments[2], NULL, 0);
    int32_t target = (int32_t)strtol(arguments[3], NULL, 0);
    bus = can_open(atoi(arguments[1]));
    if (bus < 0) {
        fprintf(stderr, "profile_move: no socketcand server at port %s\n", arguments[1]);
        return 4;
    }
    struct frame start = {0x000, 2, {1, (uint8_t)node}}; /* NMT: start this node */
    can_send(bus, &start);

    control(0x06);
    await_status(0x6F, 0x21, "the drive is not READY TO SWITCH ON");
    control(0x07);
    await_status(0x6F, 0x23, "the drive is not SWITCHED ON");
    write_object(MODE, 1, PROFILE_POSITION);
    control(0x0F);
    await_status(0x6F, 0x27, "the drive is not in OPERATION ENABLED");

    write_object(TARGET_POSITION, 4, (uint32_t)target);
    control(0x1F);
    await_status(0x1000, 0x1000, "the set-point is not acknowledged");
    control(0x0F);
    await_status(0x0400, 0x0400, "the target is not reached");

    int32_t position = (int32_t)read_object(POSITION);
    printf("node 0x%02X: statusword 0x%04" PRIX32 ", position %" PRId32 "\n", node, read_object(STATUSWORD), position);
    if (position != target)
        fail("the axis is not where it should be");
    control(0x00); /* switch the drive off */
    return 0;
}
