"""Sine and cosine by polynomials of our own: a library's differ in the last bit between plain Python and numba."""

from steptwin.controller.motion.kernel import kernel_function

S3, S5, S7, S9, S11, S13 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880, -1 / 39916800, 1 / 6227020800
"""Coefficients of the sine's series."""
C2, C4, C6, C8, C10, C12, C14 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800, 1 / 479001600, -1 / 87178291200
"""Coefficients of the cosine's series."""

QUARTERS_PER_RAD = 0.6366197723675814
"""Quarter turns in a rad."""
QUARTER_HIGH, QUARTER_LOW = 1.5707963267341256, 6.077100506506192e-11
"""A quarter turn in two parts: a multiple of the first, of 33 bits, is exact."""


@kernel_function
def sine_cosine(angle: float) -> tuple[float, float]:
    """Return sine and cosine of an angle of up to 1e7 rad, within 1e-13: Taylor's polynomials over a quarter turn."""
    quarters = int(angle * QUARTERS_PER_RAD + (0.5 if angle >= 0.0 else -0.5))
    x = (angle - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW
    y = x * x
    s = x + x * y * (S3 + y * (S5 + y * (S7 + y * (S9 + y * (S11 + y * S13)))))
    c = 1.0 + y * (C2 + y * (C4 + y * (C6 + y * (C8 + y * (C10 + y * (C12 + y * C14))))))
    quadrant = quarters & 3
    if quadrant == 0:
        return s, c
    if quadrant == 1:
        return c, -s
    if quadrant == 2:
        return -s, -c
    return -c, s
