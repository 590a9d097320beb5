/* A small hardware layer over steptwin_firmware.h: timers as interrupts, CAN, pins, flash and a main loop that may wait.
 *
 * Code takes no time unless it says so by hal_wait. Interrupts come in the order of (instant, priority), the lower
 * number first, as on the chip: one that waits is interrupted by timers of a lower number alone. All others are pending
 * until it returns: a timer once, however many periods have passed, and up to HAL_CAN_FIFO frames; further frames are
 * lost. fw_can and fw_inputs come after all timers, and before the main loop. */
#ifndef STEPTWIN_HAL_H
#define STEPTWIN_HAL_H
#include "steptwin_firmware.h"

#define HAL_TIMERS 16
#define HAL_FLASH_BYTES 1024
#define HAL_CAN_FIFO 3

#ifdef __cplusplus
extern "C" {
#endif

/* You write these. */
void fw_main(void);                        /* the main loop, from power-up; must call hal_wait in each turn */
void fw_can(const st_frame *frame);        /* the interrupt of the CAN controller */
void fw_inputs(void);                      /* inputs have changed */

extern uint32_t hal_axes, hal_node;        /* axes of the board, and its first node id */
extern uint8_t hal_flash[HAL_FLASH_BYTES]; /* outlives the power; all 0xFF at first */

uint64_t hal_now(void);
void hal_wait(uint64_t counts);            /* busy until then, by the clock; see above for what comes meanwhile */
int hal_timer(uint64_t period, int priority, int sends, void (*serve)(void)); /* sends: 1 if it may send frames;
                                              returns its number, -1 if none is free or the period is 0 */
void hal_timer_stop(int timer);
void hal_pin(uint32_t axis, enum st_pin pin, int level);
uint32_t hal_inputs(uint32_t axis);
int hal_can_send(uint32_t id, const void *data, uint32_t length); /* returns 0 if no mailbox is free */

#ifdef __cplusplus
}
#endif
#endif
