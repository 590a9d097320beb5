/* canshim: SocketCAN programs on a board that `steptwin serve` serves, without a CAN device of the kernel.
 *
 *     gcc -shared -fPIC -O2 -o canshim.so canshim.c pump.c
 *     STEPTWIN_CAN=127.0.0.1:29536 LD_PRELOAD=./canshim.so candump can0
 *
 * A PF_CAN socket becomes one end of a socket pair, so that poll, select, epoll and close are the kernel's; the names
 * in CANSHIM_NAMES, "can0,vcan0" by default, are the served bus. A socket is known by its inode, so that dup, fork and
 * a number that is used again are seen too. Without STEPTWIN_CAN the library does nothing. What it cannot do is on
 * docs/masters.md. */
#define _GNU_SOURCE
#include "canshim.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/can/error.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

enum { SOCKETS_MAX = 256, NAMES_MAX = 16, FIRST_INDEX = 7701 };

struct shim {
    atomic_ulong inode; /* of the program's end; 0: this place is free */
    int other_end;      /* -1 once the pump has it */
    int index;          /* of the interface; 0: any */
    bool bound, stamps, stamps_ns, stamping, overflow, loopback;
    uint32_t error_mask, stamping_flags;
    struct timeval last;
    struct settings *settings;
};

static struct shim shims[SOCKETS_MAX];
static atomic_int used; /* places that were ever used */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static char names[NAMES_MAX][IFNAMSIZ];
static int name_count;
static const char *address;

#define REAL(name)                                                                                                     \
    static __typeof__(&name) real;                                                                                     \
    if (!real)                                                                                                         \
    real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

static int failed(int error)
{
    errno = error;
    return -1;
}

__attribute__((constructor)) static void begin(void)
{
    const char *given = getenv("CANSHIM_NAMES");
    address = getenv("STEPTWIN_CAN");
    for (const char *each = given ? given : "can0,vcan0"; *each && name_count < NAMES_MAX;) {
        size_t length = strcspn(each, ",");
        if (length && length < IFNAMSIZ)
            memcpy(names[name_count++], each, length);
        each += length + (each[length] == ',');
    }
}

static int index_of(const char *name)
{
    for (int i = 0; address && i < name_count; i++)
        if (strncmp(names[i], name, IFNAMSIZ) == 0)
            return FIRST_INDEX + i;
    return 0;
}

static const char *name_of(int index)
{
    return address && index >= FIRST_INDEX && index < FIRST_INDEX + name_count ? names[index - FIRST_INDEX] : NULL;
}

static unsigned long inode_of(int fd)
{
    struct stat status;
    return fstat(fd, &status) == 0 && S_ISSOCK(status.st_mode) ? status.st_ino : 0;
}

static struct shim *find(int fd)
{
    int count = atomic_load(&used);
    unsigned long inode = count && fd >= 0 ? inode_of(fd) : 0;
    for (int i = 0; inode && i < count; i++)
        if (atomic_load(&shims[i].inode) == inode)
            return &shims[i];
    return NULL;
}

/* --- a socket begins */

static bool is_over(const struct shim *shim)
{
    struct pollfd peer = {.fd = shim->other_end};
    if (shim->bound)
        return atomic_load(&shim->settings->ended);
    return poll(&peer, 1, 0) > 0 && peer.revents & POLLHUP;
}

/* Return a free place; one whose socket was closed is free again. */
static struct shim *place(void)
{
    for (int i = 0; i < SOCKETS_MAX; i++) {
        struct shim *shim = &shims[i];
        if (i == atomic_load(&used)) {
            atomic_store(&used, i + 1);
            return shim;
        }
        if (!atomic_load(&shim->inode))
            return shim;
        if (is_over(shim)) {
            if (shim->other_end >= 0)
                close(shim->other_end);
            munmap(shim->settings, sizeof *shim->settings);
            atomic_store(&shim->inode, 0);
            return shim;
        }
    }
    return NULL;
}

static int can_socket(int type, int protocol)
{
    int ends[2], flags = type & (SOCK_CLOEXEC | SOCK_NONBLOCK);
    if ((type & ~flags) != SOCK_RAW || protocol != CAN_RAW)
        return failed(EPROTONOSUPPORT); /* neither BCM nor ISO-TP nor J1939 */
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) < 0)
        return -1;
    struct settings *settings = mmap(NULL, sizeof *settings, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    pthread_mutex_lock(&lock);
    struct shim *shim = settings == MAP_FAILED ? NULL : place();
    if (shim) {
        settings->filters = 1; /* one that lets all pass: its mask is 0 */
        shim->other_end = ends[1], shim->index = 0, shim->loopback = true, shim->error_mask = 0;
        shim->bound = shim->stamps = shim->stamps_ns = shim->stamping = shim->overflow = false;
        shim->settings = settings;
        atomic_store(&shim->inode, inode_of(ends[0]));
    }
    pthread_mutex_unlock(&lock);
    if (!shim) {
        close(ends[0]), close(ends[1]);
        return failed(ENFILE);
    }
    if (!(flags & SOCK_CLOEXEC))
        fcntl(ends[0], F_SETFD, 0);
    if (flags & SOCK_NONBLOCK)
        fcntl(ends[0], F_SETFL, fcntl(ends[0], F_GETFL) | O_NONBLOCK);
    return ends[0];
}

static int start(struct shim *shim, int index)
{
    if (index && !name_of(index))
        return failed(ENODEV);
    pthread_mutex_lock(&lock);
    int error = 0;
    if (!shim->bound) {
        int server = server_connect(address, index ? name_of(index) : names[0]);
        if (server < 0 || !pump_start(shim->other_end, server, shim->settings))
            error = ENETDOWN;
        if (server >= 0)
            close(server);
        if (!error) {
            close(shim->other_end);
            shim->other_end = -1, shim->bound = true;
        }
    }
    if (!error)
        shim->index = index;
    pthread_mutex_unlock(&lock);
    return error ? failed(error) : 0;
}

int socket(int domain, int type, int protocol)
{
    REAL(socket);
    return domain == PF_CAN && address ? can_socket(type, protocol) : real(domain, type, protocol);
}

int bind(int fd, const struct sockaddr *to, socklen_t length)
{
    REAL(bind);
    struct shim *shim = find(fd);
    if (!shim)
        return real(fd, to, length);
    const struct sockaddr_can *can = (const struct sockaddr_can *)to;
    if (length < 8 || can->can_family != AF_CAN)
        return failed(EINVAL);
    return start(shim, can->can_ifindex);
}

int getsockname(int fd, struct sockaddr *name, socklen_t *length)
{
    REAL(getsockname);
    struct shim *shim = find(fd);
    if (!shim)
        return real(fd, name, length);
    struct sockaddr_can can = {.can_family = AF_CAN, .can_ifindex = shim->index};
    memcpy(name, &can, *length < sizeof can ? *length : sizeof can);
    *length = sizeof can;
    return 0;
}

/* --- options */

static int set_filters(struct settings *settings, const void *value, socklen_t length)
{
    if (length % sizeof(struct can_filter) || length > sizeof settings->filter)
        return failed(EINVAL);
    atomic_fetch_add(&settings->version, 1);
    settings->filters = length / sizeof(struct can_filter);
    if (length)
        memcpy(settings->filter, value, length);
    atomic_fetch_add(&settings->version, 1);
    return 0;
}

static int set_raw(struct shim *shim, int name, const void *value, socklen_t length)
{
    uint32_t number = 0;
    if (name == CAN_RAW_FILTER)
        return set_filters(shim->settings, value, length);
    if (length != sizeof number)
        return failed(EINVAL);
    memcpy(&number, value, sizeof number);
    switch (name) {
    case CAN_RAW_ERR_FILTER: /* the server has no error frames, so none comes */
        shim->error_mask = number & CAN_ERR_MASK;
        return 0;
    case CAN_RAW_LOOPBACK: /* to the server each socket is a station: others always see its frames */
        shim->loopback = number;
        return 0;
    case CAN_RAW_RECV_OWN_MSGS:
        shim->settings->receive_own = number;
        return 0;
    case CAN_RAW_JOIN_FILTERS:
        shim->settings->joined = number;
        return 0;
    default: /* no CAN FD, no CAN XL */
        return number ? failed(ENOPROTOOPT) : 0;
    }
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t length)
{
    REAL(setsockopt);
    struct shim *shim = find(fd);
    if (shim && level == SOL_CAN_RAW)
        return set_raw(shim, name, value, length);
    if (!shim || level != SOL_SOCKET || length < sizeof(int))
        return real(fd, level, name, value, length);
    int number;
    memcpy(&number, value, sizeof number);
    switch (name) {
    case SO_TIMESTAMP:
        shim->stamps = number;
        return 0;
    case SO_TIMESTAMPNS:
        shim->stamps_ns = number;
        return 0;
    case SO_TIMESTAMPING:
        shim->stamping_flags = (uint32_t)number;
        shim->stamping = number & SOF_TIMESTAMPING_SOFTWARE;
        return 0;
    case SO_RXQ_OVFL:
        shim->overflow = number;
        return 0;
    default:
        return real(fd, level, name, value, length);
    }
}

static int give(void *value, socklen_t *length, const void *from, socklen_t size)
{
    *length = *length < size ? *length : size;
    memcpy(value, from, *length);
    return 0;
}

int getsockopt(int fd, int level, int name, void *value, socklen_t *length)
{
    REAL(getsockopt);
    struct shim *shim = find(fd);
    if (!shim)
        return real(fd, level, name, value, length);
    if (level == SOL_CAN_RAW && name == CAN_RAW_FILTER)
        return give(value, length, shim->settings->filter, shim->settings->filters * sizeof(struct can_filter));
    int number = -1;
    if (level == SOL_CAN_RAW)
        number = name == CAN_RAW_ERR_FILTER      ? (int)shim->error_mask
                 : name == CAN_RAW_LOOPBACK      ? shim->loopback
                 : name == CAN_RAW_RECV_OWN_MSGS ? (int)shim->settings->receive_own
                 : name == CAN_RAW_JOIN_FILTERS  ? (int)shim->settings->joined
                 : name == CAN_RAW_FD_FRAMES     ? 0
                                                 : -1;
    else if (level == SOL_SOCKET)
        number = name == SO_TYPE          ? SOCK_RAW
                 : name == SO_DOMAIN      ? PF_CAN
                 : name == SO_PROTOCOL    ? CAN_RAW
                 : name == SO_TIMESTAMP   ? shim->stamps
                 : name == SO_TIMESTAMPNS ? shim->stamps_ns
                 : name == SO_RXQ_OVFL    ? shim->overflow
                                          : -1;
    if (number >= 0)
        return give(value, length, &number, sizeof number);
    return level == SOL_CAN_RAW ? failed(ENOPROTOOPT) : real(fd, level, name, value, length);
}

/* --- frames in */

static void add_control(struct msghdr *message, size_t *left, int type, const void *data, size_t size)
{
    size_t needed = CMSG_SPACE(size);
    if (needed > *left) {
        message->msg_flags |= MSG_CTRUNC;
        return;
    }
    struct cmsghdr *control = (struct cmsghdr *)((char *)message->msg_control + message->msg_controllen);
    *control = (struct cmsghdr){.cmsg_level = SOL_SOCKET, .cmsg_type = type, .cmsg_len = CMSG_LEN(size)};
    memcpy(CMSG_DATA(control), data, size);
    message->msg_controllen += needed;
    *left -= needed;
}

static void add_controls(const struct shim *shim, struct msghdr *message, size_t left, const struct packet *packet)
{
    struct timeval us = {.tv_sec = packet->seconds, .tv_usec = packet->us};
    struct timespec ns = {.tv_sec = packet->seconds, .tv_nsec = packet->us * 1000};
    struct scm_timestamping both = {.ts = {{.tv_sec = ns.tv_sec, .tv_nsec = ns.tv_nsec}}};
    if (shim->stamps_ns)
        add_control(message, &left, SCM_TIMESTAMPNS, &ns, sizeof ns);
    else if (shim->stamps)
        add_control(message, &left, SCM_TIMESTAMP, &us, sizeof us);
    if (shim->stamping)
        add_control(message, &left, SCM_TIMESTAMPING, &both, sizeof both);
    if (shim->overflow)
        add_control(message, &left, SO_RXQ_OVFL, &packet->dropped, sizeof packet->dropped);
}

static ssize_t receive(struct shim *shim, int fd, struct msghdr *message, int flags)
{
    REAL(recvmsg);
    struct packet packet;
    struct iovec whole = {.iov_base = &packet, .iov_len = sizeof packet};
    struct msghdr inner = {.msg_iov = &whole, .msg_iovlen = 1};
    size_t control_bytes = message->msg_control ? message->msg_controllen : 0;
    if (flags & MSG_ERRQUEUE)
        return failed(EAGAIN);
    ssize_t length = real(fd, &inner, flags & ~MSG_TRUNC);
    if (length < 0)
        return errno == ECONNRESET ? failed(ENETDOWN) : -1;
    if (length < (ssize_t)sizeof packet.frame)
        return failed(ENETDOWN); /* the server has ended */
    size_t done = 0;
    for (size_t i = 0; i < message->msg_iovlen && done < CAN_MTU; i++) {
        size_t part = message->msg_iov[i].iov_len < CAN_MTU - done ? message->msg_iov[i].iov_len : CAN_MTU - done;
        memcpy(message->msg_iov[i].iov_base, (char *)&packet.frame + done, part);
        done += part;
    }
    shim->last = (struct timeval){.tv_sec = packet.seconds, .tv_usec = packet.us};
    message->msg_flags = (done < CAN_MTU ? MSG_TRUNC : 0) | (packet.own ? MSG_CONFIRM | MSG_DONTROUTE : 0);
    message->msg_controllen = 0;
    add_controls(shim, message, control_bytes, &packet);
    if (message->msg_name) {
        struct sockaddr_can from = {.can_family = AF_CAN, .can_ifindex = shim->index ? shim->index : FIRST_INDEX};
        memcpy(message->msg_name, &from, message->msg_namelen < sizeof from ? message->msg_namelen : sizeof from);
        message->msg_namelen = sizeof from;
    }
    return flags & MSG_TRUNC ? (ssize_t)CAN_MTU : (ssize_t)done;
}

static ssize_t receive_into(struct shim *shim, int fd, void *data, size_t length, int flags)
{
    struct iovec part = {.iov_base = data, .iov_len = length};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    return receive(shim, fd, &message, flags);
}

ssize_t recvmsg(int fd, struct msghdr *message, int flags)
{
    REAL(recvmsg);
    struct shim *shim = find(fd);
    return shim ? receive(shim, fd, message, flags) : real(fd, message, flags);
}

int recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags, struct timespec *timeout)
{
    REAL(recvmmsg);
    struct shim *shim = find(fd);
    if (!shim)
        return real(fd, messages, count, flags, timeout);
    unsigned done = 0;
    for (; done < count; done++) {
        ssize_t length = receive(shim, fd, &messages[done].msg_hdr, done ? flags | MSG_DONTWAIT : flags);
        if (length < 0)
            break;
        messages[done].msg_len = (unsigned)length;
    }
    return done || !count ? (int)done : -1;
}

ssize_t recvfrom(int fd, void *data, size_t length, int flags, struct sockaddr *from, socklen_t *from_length)
{
    REAL(recvfrom);
    struct shim *shim = find(fd);
    if (!shim)
        return real(fd, data, length, flags, from, from_length);
    struct iovec part = {.iov_base = data, .iov_len = length};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_name = from};
    message.msg_namelen = from && from_length ? *from_length : 0;
    ssize_t done = receive(shim, fd, &message, flags);
    if (done >= 0 && from && from_length)
        *from_length = message.msg_namelen;
    return done;
}

ssize_t recv(int fd, void *data, size_t length, int flags)
{
    REAL(recv);
    struct shim *shim = find(fd);
    return shim ? receive_into(shim, fd, data, length, flags) : real(fd, data, length, flags);
}

ssize_t read(int fd, void *data, size_t length)
{
    REAL(read);
    struct shim *shim = find(fd);
    return shim ? receive_into(shim, fd, data, length, 0) : real(fd, data, length);
}

ssize_t readv(int fd, const struct iovec *parts, int count)
{
    REAL(readv);
    struct shim *shim = find(fd);
    struct msghdr message = {.msg_iov = (struct iovec *)parts, .msg_iovlen = (size_t)count};
    return shim ? receive(shim, fd, &message, 0) : real(fd, parts, count);
}

/* What programs call that are compiled with _FORTIFY_SOURCE. */
static void checked(size_t length, size_t room)
{
    if (length > room)
        abort();
}

ssize_t __read_chk(int fd, void *data, size_t length, size_t room)
{
    checked(length, room);
    return read(fd, data, length);
}

ssize_t __recv_chk(int fd, void *data, size_t length, size_t room, int flags)
{
    checked(length, room);
    return recv(fd, data, length, flags);
}

ssize_t __recvfrom_chk(
    int fd, void *data, size_t length, size_t room, int flags, struct sockaddr *from, socklen_t *from_length)
{
    checked(length, room);
    return recvfrom(fd, data, length, flags, from, from_length);
}

/* --- frames out */

static ssize_t transmit(struct shim *shim, int fd, const struct msghdr *message, int flags)
{
    REAL(sendmsg);
    const struct sockaddr_can *to = message->msg_name;
    struct can_frame frame;
    size_t done = 0, length = 0;
    for (size_t i = 0; i < message->msg_iovlen; i++) {
        size_t part = message->msg_iov[i].iov_len;
        length += part;
        part = part < sizeof frame - done ? part : sizeof frame - done;
        memcpy((char *)&frame + done, message->msg_iov[i].iov_base, part);
        done += part;
    }
    if (length != CAN_MTU || frame.can_dlc > CAN_MAX_DLEN)
        return failed(EINVAL);
    if (to && message->msg_namelen >= 8 && to->can_ifindex && !name_of(to->can_ifindex))
        return failed(ENXIO);
    if (!shim->bound && (!to || !to->can_ifindex))
        return failed(ENXIO);
    if (!shim->bound && start(shim, 0) < 0)
        return -1;
    struct iovec whole = {.iov_base = &frame, .iov_len = sizeof frame};
    struct msghdr inner = {.msg_iov = &whole, .msg_iovlen = 1};
    ssize_t sent = real(fd, &inner, (flags & MSG_DONTWAIT) | MSG_NOSIGNAL);
    return sent < 0 && (errno == EPIPE || errno == ECONNRESET) ? failed(ENETDOWN) : sent;
}

static ssize_t transmit_from(struct shim *shim, int fd, const void *data, size_t length, int flags)
{
    struct iovec part = {.iov_base = (void *)data, .iov_len = length};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    return transmit(shim, fd, &message, flags);
}

ssize_t sendmsg(int fd, const struct msghdr *message, int flags)
{
    REAL(sendmsg);
    struct shim *shim = find(fd);
    return shim ? transmit(shim, fd, message, flags) : real(fd, message, flags);
}

int sendmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags)
{
    REAL(sendmmsg);
    struct shim *shim = find(fd);
    if (!shim)
        return real(fd, messages, count, flags);
    unsigned done = 0;
    for (; done < count; done++) {
        ssize_t length = transmit(shim, fd, &messages[done].msg_hdr, flags);
        if (length < 0)
            break;
        messages[done].msg_len = (unsigned)length;
    }
    return done || !count ? (int)done : -1;
}

ssize_t sendto(int fd, const void *data, size_t length, int flags, const struct sockaddr *to, socklen_t to_length)
{
    REAL(sendto);
    struct shim *shim = find(fd);
    if (!shim)
        return real(fd, data, length, flags, to, to_length);
    struct iovec part = {.iov_base = (void *)data, .iov_len = length};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_name = (void *)to, .msg_namelen = to_length};
    return transmit(shim, fd, &message, flags);
}

ssize_t send(int fd, const void *data, size_t length, int flags)
{
    REAL(send);
    struct shim *shim = find(fd);
    return shim ? transmit_from(shim, fd, data, length, flags) : real(fd, data, length, flags);
}

ssize_t write(int fd, const void *data, size_t length)
{
    REAL(write);
    struct shim *shim = find(fd);
    return shim ? transmit_from(shim, fd, data, length, 0) : real(fd, data, length);
}

ssize_t writev(int fd, const struct iovec *parts, int count)
{
    REAL(writev);
    struct shim *shim = find(fd);
    struct msghdr message = {.msg_iov = (struct iovec *)parts, .msg_iovlen = (size_t)count};
    return shim ? transmit(shim, fd, &message, 0) : real(fd, parts, count);
}

/* --- names of interfaces */

static int interface_request(unsigned long request, struct ifreq *asked)
{
    switch (request) {
    case SIOCGIFINDEX:
        asked->ifr_ifindex = index_of(asked->ifr_name);
        return 0;
    case SIOCGIFFLAGS:
        asked->ifr_flags = IFF_UP | IFF_RUNNING | IFF_NOARP;
        return 0;
    case SIOCGIFMTU:
        asked->ifr_mtu = CAN_MTU;
        return 0;
    default:
        return failed(EOPNOTSUPP);
    }
}

int ioctl(int fd, unsigned long request, ...)
{
    REAL(ioctl);
    va_list rest;
    va_start(rest, request);
    void *value = va_arg(rest, void *);
    va_end(rest);
    bool named = request == SIOCGIFINDEX || request == SIOCGIFFLAGS || request == SIOCGIFMTU;
    if (named && index_of(((struct ifreq *)value)->ifr_name))
        return interface_request(request, value);
    if (request == SIOCGIFNAME && name_of(((struct ifreq *)value)->ifr_ifindex)) {
        struct ifreq *asked = value;
        memcpy(asked->ifr_name, name_of(asked->ifr_ifindex), IFNAMSIZ);
        return 0;
    }
    struct shim *shim = find(fd);
    if (shim && request == SIOCGSTAMP) {
        if (!shim->last.tv_sec)
            return failed(ENOENT);
        memcpy(value, &shim->last, sizeof shim->last);
        return 0;
    }
    return real(fd, request, value);
}

unsigned if_nametoindex(const char *name)
{
    REAL(if_nametoindex);
    unsigned index = (unsigned)index_of(name);
    return index ? index : real(name);
}

char *if_indextoname(unsigned index, char name[IF_NAMESIZE])
{
    REAL(if_indextoname);
    const char *own = name_of((int)index);
    return own ? memcpy(name, own, IFNAMSIZ) : real(index, name);
}

struct if_nameindex *if_nameindex(void)
{
    REAL(if_nameindex);
    struct if_nameindex *others = real();
    if (!address || !others)
        return others;
    size_t count = 0;
    while (others[count].if_index)
        count++;
    struct if_nameindex *all = calloc(count + (size_t)name_count + 1, sizeof *all);
    for (size_t i = 0; all && i < count + (size_t)name_count; i++) {
        all[i].if_index = i < count ? others[i].if_index : (unsigned)(FIRST_INDEX + i - count);
        all[i].if_name = strdup(i < count ? others[i].if_name : names[i - count]);
    }
    void (*freed)(struct if_nameindex *) = (void (*)(struct if_nameindex *))dlsym(RTLD_NEXT, "if_freenameindex");
    freed(others);
    return all;
}

void if_freenameindex(struct if_nameindex *all)
{
    REAL(if_freenameindex);
    if (!address) {
        real(all);
        return;
    }
    for (struct if_nameindex *each = all; each->if_index; each++)
        free(each->if_name);
    free(all);
}
