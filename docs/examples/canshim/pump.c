/* The pump: a process that carries frames between the program's socket and the server.
 *
 * It is no thread, so that it goes on when the program forks and its parent ends, as daemons do. It is made by the bare
 * system call, so that the program is told of no child: no SIGCHLD, no wait(). After that it calls only what a child of
 * a program with threads may call. */
#define _GNU_SOURCE
#include "canshim.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { COMMAND_MAX = 128, HANDSHAKE_MS = 2000, LINGER_MS = 2000, TEXT_MAX = 1 << 16, SEND_MAX = 64, WAITING_MAX = 4096 };

/* --- the connection, made in the program's own process */

static bool answered(int server, const char *expected)
{
    char text[COMMAND_MAX];
    size_t length = 0;
    struct pollfd waiting = {.fd = server, .events = POLLIN};
    while (length + 1 < sizeof text && poll(&waiting, 1, HANDSHAKE_MS) > 0 && recv(server, text + length, 1, 0) == 1) {
        text[++length] = '\0';
        if (text[length - 1] == '>')
            return strcmp(text, expected) == 0;
    }
    return false;
}

static bool asked(int server, const char *request)
{
    return send(server, request, strlen(request), MSG_NOSIGNAL) == (ssize_t)strlen(request) &&
           answered(server, "< ok >");
}

int server_connect(const char *address, const char *bus)
{
    char host[256], open[COMMAND_MAX];
    const char *colon = strrchr(address, ':');
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM}, *found = NULL;
    const char *why = "is not HOST:PORT";
    if (colon > address && (size_t)(colon - address) < sizeof host) {
        bool brackets = address[0] == '[' && colon[-1] == ']'; /* of an address of IPv6 */
        snprintf(host, sizeof host, "%.*s", (int)(colon - address) - 2 * brackets, address + brackets);
        int error = getaddrinfo(host, colon + 1, &hints, &found);
        why = error ? gai_strerror(error) : "no socketcand server answers";
    }
    for (struct addrinfo *each = found; each; each = each->ai_next) {
        int server = socket(each->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0), at_once = 1;
        snprintf(open, sizeof open, "< open %s >", bus);
        if (server >= 0 && connect(server, each->ai_addr, each->ai_addrlen) == 0 && answered(server, "< hi >") &&
            asked(server, open) && asked(server, "< rawmode >")) {
            setsockopt(server, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
            freeaddrinfo(found);
            return server;
        }
        if (server >= 0)
            close(server);
    }
    if (found)
        freeaddrinfo(found);
    fprintf(stderr, "canshim: STEPTWIN_CAN=%s: %s\n", address, why);
    return -1;
}

/* --- frames and texts */

static size_t text_of(const struct can_frame *frame, char *text)
{
    bool extended = frame->can_id & CAN_EFF_FLAG, remote = frame->can_id & CAN_RTR_FLAG;
    canid_t id = frame->can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    int length = sprintf(text, extended ? "< %s %08X %u" : "< %s %X %u", remote ? "sendrtr" : "send", id, frame->can_dlc);
    for (unsigned i = 0; i < frame->can_dlc && !remote; i++)
        length += sprintf(text + length, " %02X", frame->data[i]);
    return (size_t)(length + sprintf(text + length, " >"));
}

static int digit(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'F' ? c - 'A' + 10 : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static const char *number(const char *text, int base, int64_t *value)
{
    for (*value = 0; digit(*text) >= 0 && digit(*text) < base; text++)
        *value = *value * base + digit(*text);
    return text;
}

/* Read "< frame ID SECONDS.US DATA >"; return false for anything else. */
static bool frame_of(const char *text, struct packet *packet)
{
    int64_t id;
    if (strncmp(text, "< frame ", 8) != 0)
        return false;
    const char *end = number(text + 8, 16, &id);
    packet->frame = (struct can_frame){.can_id = (canid_t)id | (end - text > 8 + 3 ? CAN_EFF_FLAG : 0)};
    end = number(end + 1, 10, &packet->seconds);
    end = number(end + 1, 10, &packet->us);
    for (end++; packet->frame.can_dlc < CAN_MAX_DLEN && digit(end[0]) >= 0 && digit(end[1]) >= 0; end += 2)
        packet->frame.data[packet->frame.can_dlc++] = (uint8_t)(digit(end[0]) << 4 | digit(end[1]));
    return true;
}

/* --- the process */

struct pump {
    int program, server;
    struct settings *settings;
    bool program_gone, server_gone;
    uint32_t dropped;
    struct packet queue[WAITING_MAX]; /* for the program: its socket holds some 200 */
    size_t first, waiting;
    char in[TEXT_MAX], out[TEXT_MAX];
    size_t in_length, out_length;
};

static bool passes(const struct settings *settings, canid_t id)
{
    bool any = false, all = settings->filters > 0;
    for (uint32_t i = 0; i < settings->filters && i < CAN_RAW_FILTER_MAX; i++) {
        const struct can_filter *filter = &settings->filter[i];
        bool same = ((id ^ filter->can_id) & filter->can_mask & ~CAN_INV_FILTER) == 0;
        bool fits = same != !!(filter->can_id & CAN_INV_FILTER);
        any |= fits;
        all &= fits;
    }
    return settings->joined ? all : any;
}

static bool wanted(const struct settings *settings, canid_t id)
{
    for (;;) {
        unsigned before = atomic_load(&settings->version);
        bool result = passes(settings, id);
        if (!(before & 1) && atomic_load(&settings->version) == before)
            return result;
    }
}

static void hand_on(struct pump *pump, struct packet *packet)
{
    if (pump->program_gone || !wanted(pump->settings, packet->frame.can_id))
        return;
    if (pump->waiting == WAITING_MAX) {
        pump->dropped++; /* as a real socket does whose program does not read */
        return;
    }
    packet->dropped = pump->dropped;
    pump->queue[(pump->first + pump->waiting++) % WAITING_MAX] = *packet;
}

static void write_program(struct pump *pump)
{
    while (pump->waiting && !pump->program_gone) {
        if (send(pump->program, &pump->queue[pump->first], sizeof(struct packet), MSG_DONTWAIT | MSG_NOSIGNAL) < 0) {
            pump->program_gone = errno != EAGAIN && errno != EINTR && errno != ENOBUFS;
            return;
        }
        pump->first = (pump->first + 1) % WAITING_MAX;
        pump->waiting--;
    }
}

static void read_server(struct pump *pump)
{
    ssize_t length = recv(pump->server, pump->in + pump->in_length, sizeof pump->in - 1 - pump->in_length, MSG_DONTWAIT);
    if (length <= 0) {
        pump->server_gone = length == 0 || (errno != EAGAIN && errno != EINTR);
        return;
    }
    pump->in_length += (size_t)length;
    pump->in[pump->in_length] = '\0';
    char *begin = pump->in, *end;
    while ((end = strchr(begin, '>'))) {
        struct packet packet = {0};
        begin += strspn(begin, " \r\n");
        if (frame_of(begin, &packet))
            hand_on(pump, &packet);
        begin = end + 1;
    }
    pump->in_length -= (size_t)(begin - pump->in);
    memmove(pump->in, begin, pump->in_length);
    pump->server_gone = pump->in_length > COMMAND_MAX; /* no socketcand has such long commands */
}

static void read_program(struct pump *pump)
{
    struct packet packet = {0};
    ssize_t length = recv(pump->program, &packet.frame, sizeof packet.frame, MSG_DONTWAIT);
    if (length == sizeof packet.frame && packet.frame.can_dlc <= CAN_MAX_DLEN) {
        pump->out_length += text_of(&packet.frame, pump->out + pump->out_length);
        if (pump->settings->receive_own) {
            struct timespec now;
            clock_gettime(CLOCK_REALTIME, &now);
            packet.seconds = now.tv_sec, packet.us = now.tv_nsec / 1000, packet.own = 1;
            hand_on(pump, &packet);
        }
    } else if (length == 0 || (length < 0 && errno != EAGAIN && errno != EINTR)) {
        pump->program_gone = true;
    }
}

static void write_server(struct pump *pump)
{
    ssize_t length = send(pump->server, pump->out, pump->out_length, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (length > 0) {
        pump->out_length -= (size_t)length;
        memmove(pump->out, pump->out + length, pump->out_length);
    } else if (errno != EAGAIN && errno != EINTR) {
        pump->server_gone = true;
    }
}

/* Close the connection so that the server has read all: a close with unread frames would take back what was sent. */
static void leave(struct pump *pump)
{
    struct pollfd waiting = {.fd = pump->server, .events = POLLIN};
    shutdown(pump->server, SHUT_WR);
    for (int rounds = 0; rounds < 100 && poll(&waiting, 1, LINGER_MS) > 0; rounds++)
        if (recv(pump->server, pump->in, sizeof pump->in, MSG_DONTWAIT) <= 0)
            return;
}

static void run(struct pump *pump)
{
    while (!pump->server_gone && !(pump->program_gone && !pump->out_length)) {
        bool room = pump->out_length + SEND_MAX < sizeof pump->out && !pump->program_gone;
        struct pollfd waiting[] = {
            {.fd = pump->server, .events = (short)(POLLIN | (pump->out_length ? POLLOUT : 0))},
            {.fd = room || pump->waiting ? pump->program : -1,
             .events = (short)((room ? POLLIN : 0) | (pump->waiting ? POLLOUT : 0))},
        };
        if (poll(waiting, 2, -1) < 0 && errno != EINTR)
            return;
        if (room && waiting[1].revents & ~POLLOUT)
            read_program(pump);
        if (pump->out_length)
            write_server(pump);
        if (waiting[0].revents & ~POLLOUT)
            read_server(pump);
        write_program(pump);
    }
    atomic_store(&pump->settings->ended, pump->program_gone);
    if (!pump->server_gone)
        leave(pump);
}

/* Keep both sockets and nothing else of the program: no pipe, no terminal, no handler of signals. */
static void become_pump(int program, int server, struct settings *settings)
{
    static struct pump pump;
    struct sigaction usual = {.sa_handler = SIG_DFL};
    for (int number = 1; number < NSIG; number++)
        sigaction(number, &usual, NULL);
    setsid();
    int first = fcntl(program, F_DUPFD, 3), second = fcntl(server, F_DUPFD, 3);
    dup2(first, 0);
    dup2(second, 1);
    if (syscall(SYS_close_range, 2, ~0U, 0) != 0)
        for (int fd = 2; fd < 65536; fd++)
            close(fd);
    pump = (struct pump){.program = 0, .server = 1, .settings = settings};
    run(&pump);
    _exit(0);
}

bool pump_start(int program, int server, struct settings *settings)
{
    pid_t child = (pid_t)syscall(SYS_clone, 0, 0, 0, 0, 0); /* fork() without a signal at its end */
    if (child == 0) {
        if (syscall(SYS_clone, 0, 0, 0, 0, 0) == 0)
            become_pump(program, server, settings);
        _exit(0);
    }
    while (child > 0 && waitpid(child, NULL, __WALL) < 0 && errno == EINTR)
        continue;
    return child > 0;
}
