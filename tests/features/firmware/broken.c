/* A firmware that breaks the interface in one way, by -DBREAK=...: see test_native_firmware.py. */
#include "steptwin_firmware.h"
#include <stdlib.h>

static uint64_t now;
static int edges, frames;

uint32_t st_abi(void) { return BREAK == 1 ? 99 : ST_ABI; }
void st_set_flash(const uint8_t *bytes, uint32_t size) { (void)bytes, (void)size; }
void st_boot(uint32_t axes, uint32_t node, uint64_t at) { (void)axes, (void)node, now = at; }
void st_receive(const st_frame *frame, uint64_t at) { (void)frame, now = at; }
void st_inputs(const uint32_t *levels, uint64_t at) { (void)levels, now = at; }
uint64_t st_next_due(void) { return BREAK == 8 ? 1 : ST_NEVER; }
uint64_t st_run(uint64_t until) {
    if (BREAK == 2) for (volatile int i = 0;; i++) (void)i;
    if (BREAK == 3) abort();
    if (BREAK == 4 && now > 20000 * ST_COUNTS_PER_US) return 0;
    if (BREAK == 5) return until + 1;
    if (BREAK == 9) exit(7);
    if (BREAK == 10) return now;
    edges = BREAK == 6, frames = BREAK == 7;
    return now = until;
}
uint32_t st_take_edges(st_edge *to, uint32_t room) {
    (void)room;
    if (!edges) return 0;
    edges = 0;
    *to = (st_edge){now, 77, 3, 1, 0};
    return 1;
}
uint32_t st_take_frames(st_frame *to, uint32_t room) {
    (void)room;
    if (!frames) return 0;
    frames = 0;
    *to = (st_frame){.id = 0x9999, .length = 8};
    return 1;
}
#if BREAK != 11
uint32_t st_flash(uint8_t *bytes, uint32_t room) { (void)bytes, (void)room; return 0; }
#endif
