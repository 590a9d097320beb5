/* See steptwin_hal.h. */
#define _XOPEN_SOURCE 700
#include "steptwin_hal.h"
#include <string.h>
#include <ucontext.h>

#define EDGES 4096u
#define FRAMES 32u
#define STACK (256u * 1024u)
#define LOOK (1000u * ST_COUNTS_PER_US) /* a main loop that turns faster is asked for frames once a millisecond */

typedef struct { uint64_t at, period; int priority, sends; void (*serve)(void); } timer;

uint32_t hal_axes, hal_node;
uint8_t hal_flash[HAL_FLASH_BYTES];

static uint64_t now, main_at;
static timer timers[HAL_TIMERS];
static st_edge edges[EDGES];
static st_frame frames[FRAMES];
static uint32_t edge_count, frame_count, levels[8];
static uint8_t pins[8][ST_PINS];
static ucontext_t scheduler, main_loop;
static char stack[STACK];
static int in_main;

uint64_t hal_now(void) { return now; }
uint32_t hal_inputs(uint32_t axis) { return levels[axis]; }

void hal_wait(uint64_t counts) {
    if (!in_main) { now += counts; return; }
    main_at = now + (counts ? counts : 1);
    swapcontext(&main_loop, &scheduler);
}

int hal_timer(uint64_t period, int priority, int sends, void (*serve)(void)) {
    for (int i = 0; i < HAL_TIMERS; i++)
        if (!timers[i].serve) { timers[i] = (timer){now + period, period, priority, sends, serve}; return i; }
    return -1;
}
void hal_timer_stop(int i) { timers[i].serve = 0; }

void hal_pin(uint32_t axis, enum st_pin pin, int level) {
    if (pins[axis][pin] == (level != 0) || edge_count == EDGES) return;
    pins[axis][pin] = level != 0;
    edges[edge_count++] = (st_edge){now, (uint16_t)axis, (uint8_t)pin, (uint8_t)(level != 0), 0};
}

int hal_can_send(uint32_t id, const void *data, uint32_t length) {
    if (frame_count == FRAMES) return 0;
    st_frame frame = {.id = id, .length = (uint8_t)length};
    memcpy(frame.data, data, length);
    frames[frame_count++] = frame;
    return 1;
}

static void turn_main(void) {
    main_at = ST_NEVER;
    in_main = 1;
    swapcontext(&scheduler, &main_loop);
    in_main = 0;
}

uint32_t st_abi(void) { return ST_ABI; }
void st_set_flash(const uint8_t *bytes, uint32_t size) {
    memset(hal_flash, 0xFF, sizeof hal_flash);
    memcpy(hal_flash, bytes, size < sizeof hal_flash ? size : sizeof hal_flash);
}
uint32_t st_flash(uint8_t *bytes, uint32_t room) {
    uint32_t size = room < sizeof hal_flash ? room : (uint32_t)sizeof hal_flash;
    memcpy(bytes, hal_flash, size);
    return size;
}
void st_boot(uint32_t axes, uint32_t node, uint64_t at) {
    hal_axes = axes, hal_node = node, now = at, main_at = ST_NEVER;
    getcontext(&main_loop);
    main_loop.uc_stack.ss_sp = stack;
    main_loop.uc_stack.ss_size = sizeof stack;
    main_loop.uc_link = &scheduler;
    makecontext(&main_loop, fw_main, 0);
    turn_main();
}
static void pass_to(uint64_t at) { now = at > now ? at : now; }
void st_receive(const st_frame *frame, uint64_t at) { pass_to(at); fw_can(frame); }
void st_inputs(const uint32_t *all, uint64_t at) {
    pass_to(at);
    memcpy(levels, all, hal_axes * sizeof *levels);
    fw_inputs();
}
uint64_t st_next_due(void) {
    uint64_t due = main_at == ST_NEVER ? ST_NEVER : main_at > now + LOOK ? main_at : now + LOOK;
    for (int i = 0; i < HAL_TIMERS; i++)
        if (timers[i].serve && timers[i].sends && timers[i].at < due) due = timers[i].at;
    return due;
}
uint64_t st_run(uint64_t until) {
    while (!frame_count && edge_count < EDGES / 2) {
        int next = -1;
        for (int i = 0; i < HAL_TIMERS; i++)
            if (timers[i].serve && (next < 0 || timers[i].at < timers[next].at
                || (timers[i].at == timers[next].at && timers[i].priority < timers[next].priority))) next = i;
        uint64_t at = next < 0 || main_at < timers[next].at ? main_at : timers[next].at;
        if (at > until) { pass_to(until); break; }
        pass_to(at);
        if (next >= 0 && timers[next].at == at) {
            timers[next].at += timers[next].period;
            timers[next].serve();
        } else turn_main();
    }
    return now < until ? now : until;
}
uint32_t st_take_edges(st_edge *to, uint32_t room) {
    uint32_t n = edge_count < room ? edge_count : room;
    memcpy(to, edges, n * sizeof *to);
    memmove(edges, edges + n, (edge_count - n) * sizeof *to);
    edge_count -= n;
    return n;
}
uint32_t st_take_frames(st_frame *to, uint32_t room) {
    uint32_t n = frame_count < room ? frame_count : room;
    memcpy(to, frames, n * sizeof *to);
    memmove(frames, frames + n, (frame_count - n) * sizeof *to);
    frame_count -= n;
    return n;
}
