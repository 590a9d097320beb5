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

static uint64_t now, limit, main_at;
static uint64_t wake;   /* when the interrupt that waits goes on; ST_NEVER if none waits */
static int64_t running; /* its priority; INT64_MAX is below all timers */
static timer timers[HAL_TIMERS];
static st_edge edges[EDGES];
static st_frame frames[FRAMES], received[HAL_CAN_FIFO];
static uint32_t edge_count, frame_count, received_count, levels[8];
static uint8_t pins[8][ST_PINS];
static ucontext_t caller, scheduler, main_loop;  /* interrupts run in the scheduler's context */
static char scheduler_stack[STACK], main_stack[STACK];
static int in_main, inputs_changed;

uint64_t hal_now(void) { return now; }
uint32_t hal_inputs(uint32_t axis) { return levels[axis]; }

/* Return the timer that comes next among those that interrupt this priority; -1 if there is none. */
static int next_timer(int64_t priority) {
    int next = -1;
    for (int i = 0; i < HAL_TIMERS; i++)
        if (timers[i].serve && timers[i].priority < priority && (next < 0 || timers[i].at < timers[next].at
            || (timers[i].at == timers[next].at && timers[i].priority < timers[next].priority))) next = i;
    return next;
}

/* Let time pass up to an instant, or return to the caller of st_run at its limit, or when it must take something. */
static int pass_to(uint64_t at) {
    if (frame_count || edge_count >= EDGES / 2 || at > limit) {
        if (!frame_count && edge_count < EDGES / 2 && limit > now) now = limit;
        swapcontext(&scheduler, &caller);
        return 0;
    }
    if (at > now) now = at;
    return 1;
}

static void serve(timer *due) {
    int64_t before = running;
    due->at += (now - due->at) / due->period * due->period + due->period;
    running = due->priority;
    due->serve();
    running = before;
}

static void turn_main(void) {
    main_at = ST_NEVER;
    in_main = 1;
    swapcontext(&scheduler, &main_loop);
    in_main = 0;
}

static void take_frame(void) {
    st_frame frame = received[0];
    memmove(received, received + 1, --received_count * sizeof *received);
    fw_can(&frame);
}

static void schedule(void) {
    for (;;) {
        int next = next_timer(INT64_MAX);
        uint64_t at = next < 0 ? ST_NEVER : timers[next].at, other = received_count || inputs_changed ? now : main_at;
        if (!pass_to(at < other ? at : other)) continue;
        if (at <= now) serve(&timers[next]);
        else if (received_count) take_frame();
        else if (inputs_changed) inputs_changed = 0, fw_inputs();
        else turn_main();
    }
}

void hal_wait(uint64_t counts) {
    if (in_main) {
        main_at = now + (counts ? counts : 1);
        swapcontext(&main_loop, &scheduler);
        return;
    }
    uint64_t end = now + counts, before = wake;
    while (now < end) {
        int next = next_timer(running);
        uint64_t at = next < 0 ? ST_NEVER : timers[next].at;
        wake = end;
        if (pass_to(at < end ? at : end) && at <= now) serve(&timers[next]);
    }
    wake = before;
}

int hal_timer(uint64_t period, int priority, int sends, void (*serve)(void)) {
    for (int i = 0; period && i < HAL_TIMERS; i++)
        if (!timers[i].serve) {
            timer made = {now + period, period, priority, sends, serve};
            timers[i] = made;
            return i;
        }
    return -1;
}
void hal_timer_stop(int i) { timers[i].serve = 0; }

void hal_pin(uint32_t axis, enum st_pin pin, int level) {
    if (pins[axis][pin] == (level != 0) || edge_count == EDGES) return;
    pins[axis][pin] = level != 0;
    st_edge edge = {now, (uint16_t)axis, (uint8_t)pin, (uint8_t)(level != 0), 0};
    edges[edge_count++] = edge;
}

int hal_can_send(uint32_t id, const void *data, uint32_t length) {
    if (frame_count == FRAMES) return 0;
    st_frame *frame = &frames[frame_count++];
    memset(frame, 0, sizeof *frame);
    frame->id = id, frame->length = (uint8_t)length;
    memcpy(frame->data, data, length);
    return 1;
}

static void begin(ucontext_t *context, char *stack, void (*function)(void), ucontext_t *then) {
    getcontext(context);
    context->uc_stack.ss_sp = stack;
    context->uc_stack.ss_size = STACK;
    context->uc_link = then;
    makecontext(context, function, 0);
}
static void run(uint64_t until) {
    limit = until > now ? until : now;
    swapcontext(&caller, &scheduler);
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
    hal_axes = axes, hal_node = node, now = main_at = at, wake = ST_NEVER, running = INT64_MAX;
    begin(&main_loop, main_stack, fw_main, &scheduler);
    begin(&scheduler, scheduler_stack, schedule, &caller);
    run(at);
}
void st_receive(const st_frame *frame, uint64_t at) {
    if (at > now) now = at;
    if (received_count < HAL_CAN_FIFO) received[received_count++] = *frame;
    run(now);
}
void st_inputs(const uint32_t *all, uint64_t at) {
    if (at > now) now = at;
    memcpy(levels, all, hal_axes * sizeof *levels);
    inputs_changed = 1;
    run(now);
}
uint64_t st_next_due(void) {
    uint64_t any = wake < main_at ? wake : main_at;
    uint64_t due = any == ST_NEVER ? ST_NEVER : any > now + LOOK ? any : now + LOOK;
    for (int i = 0; i < HAL_TIMERS; i++) {
        if (!timers[i].serve || !timers[i].sends) continue;
        uint64_t at = wake != ST_NEVER && timers[i].priority >= running && timers[i].at < wake ? wake : timers[i].at;
        if (at < due) due = at;
    }
    return due;
}
uint64_t st_run(uint64_t until) {
    run(until);
    return now;
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
