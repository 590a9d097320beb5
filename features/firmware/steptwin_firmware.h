/* The interface between an emulated board and your firmware, compiled for this computer as a shared library.
 *
 * StepTwin runs each board's firmware in a process of its own, new from power-up to power-down or reset: so global
 * variables are as they are on the chip, and several boards may run the same file. Export the functions below, or let
 * steptwin_hal.c do it. Instants are counts of 72 MHz since the simulation began; they never go back. */
#ifndef STEPTWIN_FIRMWARE_H
#define STEPTWIN_FIRMWARE_H
#include <stdint.h>

#define ST_ABI 1u
#define ST_COUNTS_PER_US 72u
#define ST_NEVER UINT64_MAX

enum st_pin { ST_STEP, ST_DIR, ST_RESET, ST_ENABLE, ST_M1, ST_M2, ST_TQ1, ST_TQ2, ST_DCY1, ST_DCY2, ST_OUT1, ST_OUT2, ST_PINS };

/* Bits of an axis' inputs, set while the input is active. */
#define ST_NEGATIVE_LIMIT (1u << 0)
#define ST_POSITIVE_LIMIT (1u << 1)
#define ST_HOME (1u << 2)
#define ST_ESTOP (1u << 16)
#define ST_DRIVER_PROTECT (1u << 17)
#define ST_IN1 (1u << 18)
#define ST_IN2 (1u << 19)
#define ST_DRIVER_FAULT (1u << 20)

typedef struct { uint64_t counts; uint16_t axis; uint8_t pin; uint8_t level; uint32_t reserved; } st_edge;  /* 16 bytes */
typedef struct { uint32_t id; uint8_t length; uint8_t reserved[3]; uint8_t data[8]; } st_frame; /* 16 bytes; 11-bit ids */

#ifdef __cplusplus
extern "C" {
#endif
uint32_t st_abi(void);                                       /* returns ST_ABI */
void st_set_flash(const uint8_t *bytes, uint32_t size);      /* before st_boot: what st_flash gave last; size 0 at first */
void st_boot(uint32_t axes, uint32_t node, uint64_t now);    /* all pins are low; node: the first node id of this board */
void st_receive(const st_frame *frame, uint64_t now);        /* a frame from the bus; there is no filter */
void st_inputs(const uint32_t *levels, uint64_t now);        /* levels of each axis; read at servo ticks, every 250 us */
uint64_t st_next_due(void);                                  /* next instant when a frame may leave by itself, or ST_NEVER */
uint64_t st_run(uint64_t until);                             /* do all up to `until`, inclusive; return the instant reached,
                                                                earlier only if a frame waits or the edges' room is used up */
uint32_t st_take_edges(st_edge *edges, uint32_t room);       /* pins that have changed up to the instant reached, in order */
uint32_t st_take_frames(st_frame *frames, uint32_t room);    /* frames that are to be sent now, in order */
uint32_t st_flash(uint8_t *bytes, uint32_t room);            /* at power-down: what stands in the flash; returns its size */
#ifdef __cplusplus
}
#endif
#endif
