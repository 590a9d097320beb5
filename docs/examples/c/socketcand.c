#include "socketcand.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { COMMAND_MAX = 128, HANDSHAKE_MS = 5000 };

static long now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000L + now.tv_nsec / 1000000L;
}

/* Read the next "< ... >" into a text; return false at the time limit or the end of the connection. */
static bool read_command(int bus, char *text, long until_ms)
{
    size_t length = 0;
    for (;;) {
        long left_ms = until_ms - now_ms();
        struct pollfd waiting = {.fd = bus, .events = POLLIN};
        /* A command that has begun is read to its end: the server sends it at once. */
        if (poll(&waiting, 1, length ? HANDSHAKE_MS : left_ms > 0 ? (int)left_ms : 0) <= 0)
            return false;
        char next;
        if (read(bus, &next, 1) != 1 || length + 2 > COMMAND_MAX)
            return false;
        text[length++] = next;
        text[length] = '\0';
        if (next == '>')
            return true;
    }
}

static bool ask(int bus, const char *request)
{
    char answer[COMMAND_MAX];
    if (write(bus, request, strlen(request)) != (ssize_t)strlen(request))
        return false;
    return read_command(bus, answer, now_ms() + HANDSHAKE_MS) && strcmp(answer, "< ok >") == 0;
}

int can_open(int port)
{
    struct sockaddr_in server = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int bus = socket(AF_INET, SOCK_STREAM, 0), at_once = 1;
    char greeting[COMMAND_MAX];
    if (bus < 0)
        return -1;
    setsockopt(bus, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
    if (connect(bus, (struct sockaddr *)&server, sizeof server) == 0 &&
        read_command(bus, greeting, now_ms() + HANDSHAKE_MS) && strcmp(greeting, "< hi >") == 0 &&
        ask(bus, "< open vcan0 >") && ask(bus, "< rawmode >"))
        return bus;
    close(bus);
    return -1;
}

bool can_send(int bus, const struct frame *frame)
{
    char text[COMMAND_MAX];
    int length = snprintf(text, sizeof text, "< send %X %u", frame->id, frame->length);
    for (unsigned i = 0; i < frame->length; i++)
        length += snprintf(text + length, sizeof text - (size_t)length, " %X", frame->data[i]);
    length += snprintf(text + length, sizeof text - (size_t)length, " >");
    return write(bus, text, (size_t)length) == length;
}

bool can_receive(int bus, struct frame *frame, int timeout_ms)
{
    long until_ms = now_ms() + timeout_ms;
    char text[COMMAND_MAX], data[17];
    while (read_command(bus, text, until_ms)) {
        data[0] = '\0';
        if (sscanf(text, "< frame %x %*f %16[0-9A-F]", &frame->id, data) < 1)
            continue; /* an error or an echo */
        frame->length = (unsigned)strlen(data) / 2;
        for (unsigned i = 0; i < frame->length; i++)
            sscanf(data + 2 * i, "%2hhx", &frame->data[i]);
        return true;
    }
    return false;
}
