"""The few functions that C lacks: each is written out only if the kernel uses it."""

from typing import Final

_PAIR: Final = "static inline {type} {name}({type} x, {type} y)\n{{\n    return x {sign} y ? x : y;\n}}\n"
_ABS: Final = "static inline {type} {name}({type} x)\n{{\n    return x < 0 ? -x : x;\n}}\n"

_DIVIDE: Final = """\
/* Divide 64 bits by 32, rounded down. A Cortex-M3 divides only 32 bits at once, and its library takes hundreds of
   cycles for 64. A divisor below 2^20 leaves 12 bits of room above each remainder, so that three steps
   divide the low word. */
static uint64_t st_divide(uint64_t numerator, uint32_t divisor)
{
    const uint32_t low = (uint32_t)numerator;
    const uint32_t high = (uint32_t)(numerator >> 32);
    const uint32_t quotient = high / divisor;
    uint32_t rest = high - quotient * divisor;
    uint32_t part = 0;
    if (divisor < (UINT32_C(1) << 20)) {
        uint32_t next = (rest << 12) | (low >> 20);
        uint32_t digit = next / divisor;
        part = digit << 20;
        next = ((next - digit * divisor) << 12) | ((low >> 8) & UINT32_C(0xFFF));
        digit = next / divisor;
        part |= digit << 8;
        next = ((next - digit * divisor) << 8) | (low & UINT32_C(0xFF));
        part |= next / divisor;
    } else {
        for (uint32_t bit = UINT32_C(1) << 31; bit != 0; bit >>= 1) {
            const uint32_t carry = rest >> 31;
            rest = (rest << 1) | ((low & bit) != 0 ? 1U : 0U);
            if (carry != 0 || rest >= divisor) {
                rest -= divisor;
                part |= bit;
            }
        }
    }
    return ((uint64_t)quotient << 32) | part;
}
"""

_FLOOR_DIVIDE: Final = """\
/* Divide by a positive number, rounded down also where the quotient is negative, as Python's // does. */
static int64_t st_floor_divide(int64_t numerator, uint32_t divisor)
{
    if (numerator >= 0) {
        return (int64_t)st_divide((uint64_t)numerator, divisor);
    }
    return -(int64_t)st_divide((uint64_t)-numerator + (divisor - 1U), divisor);
}
"""

HELPERS: Final = {
    "st_divide": _DIVIDE,
    "st_floor_divide": _FLOOR_DIVIDE,
    **{
        f"st_{name}_{bits}": _PAIR.format(type=f"int{bits}_t", name=f"st_{name}_{bits}", sign=sign)
        for name, sign in (("min", "<"), ("max", ">"))
        for bits in (32, 64)
    },
    **{f"st_abs_{bits}": _ABS.format(type=f"int{bits}_t", name=f"st_abs_{bits}") for bits in (32, 64)},
}
"""C text by name, each after those that it calls."""
CALLS: Final = {"st_floor_divide": "st_divide"}
