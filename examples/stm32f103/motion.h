/* The motion that is built in: each axis goes forth and back, the higher its number the farther and faster. */
#ifndef MOTION_H
#define MOTION_H

#include <stdint.h>

enum { AXES = 7, SEGMENTS = 20, SEGMENT_TICKS = 200, UNITS_PER_FULL_STEP = 16384 };

/* Displacement of a segment from rest to rest, in 1/16 384 full step. */
static inline int32_t displacement_units(int32_t axis, int32_t segment)
{
    const int32_t way = (axis + 1) * 2 * UNITS_PER_FULL_STEP + 77 * segment;
    return (segment & 1) == 0 ? way : -way;
}

#endif
