/* A firmware that does harm outside of its interface, in the way that -DHARM=... names: see test_hostile_firmware.py. */
#define _XOPEN_SOURCE 500
#include "steptwin_firmware.h"
#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static uint64_t now;
static int calls;

static void answer(const void *bytes, size_t size) { /* into every pipe that may be that of the answers */
    for (int file = 3; file < 8; file++) if (write(file, bytes, size) < 0) continue;
}
static void harm(void) {
    static const unsigned char ones[64] = {[0 ... 63] = 0xFF};
    struct { char mark[4]; uint32_t kind; uint64_t at[2]; uint32_t sizes[2]; } huge = {"STfw", 0, {0, 0}, {~0u, ~0u}};
    switch (HARM) {
    case 1: for (int file = 0; file < 256; file++) close(file);
        for (;;) pause();
    case 2: answer("ST", 2); for (;;) pause();
    case 3: answer(ones, sizeof ones); for (;;) pause();
    case 4: raise(SIGRTMIN + 3); break;
    case 5: answer(ones, sizeof ones); break;
    case 6: memcpy(huge.mark, "STfw", 4), answer(&huge, sizeof huge); for (;;) pause();
    case 7: raise(SIGSTOP); break;
    case 8: huge.sizes[0] = 4096, huge.sizes[1] = 0, memcpy(huge.mark, "STfw", 4);
        for (answer(&huge, sizeof huge);;) answer("S", 1), usleep(10000);
    case 9: _exit(0);
    }
}
static void outlive(void) { /* the reader of the FIFO waits until nobody holds it for writing */
#ifdef FIFO
    if (open(FIFO, O_WRONLY) >= 0 && fork()) return;
    for (;;) pause();
#endif
}

uint32_t st_abi(void) { return ST_ABI; }
void st_set_flash(const uint8_t *bytes, uint32_t size) { (void)bytes, (void)size; }
void st_boot(uint32_t axes, uint32_t node, uint64_t at) { (void)axes, (void)node, now = at; outlive(); }
void st_receive(const st_frame *frame, uint64_t at) { (void)frame, now = at; }
void st_inputs(const uint32_t *levels, uint64_t at) { (void)levels, now = at; }
uint64_t st_next_due(void) { return HARM == 20 ? now + 1 : ST_NEVER; }
uint64_t st_run(uint64_t until) {
    if (++calls > 3) harm();
    return now = HARM == 21 || HARM == 22 ? now + (HARM == 22 && now < until) : until;
}
uint32_t st_take_edges(st_edge *to, uint32_t room) {
    if (HARM == 23) return room + 1;
    if (HARM == 24) return memset(to, 0, room * sizeof *to), room;
    return 0;
}
uint32_t st_take_frames(st_frame *to, uint32_t room) {
    (void)room;
    if (HARM != 21 && HARM != 22) return 0;
    memset(to, 0, sizeof *to), to->id = 0x300;
    return calls > 0;
}
uint32_t st_flash(uint8_t *bytes, uint32_t room) { (void)bytes, (void)room; return 0; }
