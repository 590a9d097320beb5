"""The chopper's oscillator, whose capacitor sets the chopping rate and the shortest CLK pulse that counts."""

from math import ceil
from typing import Final

from steptwin.protocol.timer import COUNTS_PER_US

OSCILLATIONS_PER_CHOP: Final = 4
"""Periods of the oscillator in one chopping period (pages 16 and 20)."""

OSCILLATOR_MAX_HZ: Final = 600_000
"""Upper end of the operating range (pages 6 to 8), which has no lower end."""

OSC_PF_MIN: Final = 64
"""Smallest capacitor, in whole pF, with which the oscillator keeps to it by the formula of `oscillator_hz`."""

_CLK_WIDTH_MIN_US: Final = {100.0: 10.0, 330.0: 30.0, 1000.0: 90.0}
"""t_W(CLK) at the capacitors for which the datasheet states it (page 8); only 330 pF is tested in production."""


def oscillator_hz(osc_pf: float) -> float:
    """Return the frequency at a capacitor by the datasheet's approximation (page 25): 400 kHz at 100 pF.

    Raises:
        ValueError: the capacitor is not positive, or so small that the oscillator is too fast.
    """
    if not osc_pf > 0:
        raise ValueError(f"the OSC capacitor is {osc_pf} pF; it must be positive, for example 330")
    hz = 1e6 / (osc_pf * 1.5 * (10 / osc_pf + 1) / 66)
    if hz > OSCILLATOR_MAX_HZ:
        raise ValueError(
            f"the OSC capacitor is {osc_pf:g} pF, which makes {hz / 1000:.0f} kHz: at most"
            f" {OSCILLATOR_MAX_HZ // 1000} kHz are allowed, {OSC_PF_MIN} pF or more"
        )
    return hz


def chopping_hz(osc_pf: float) -> float:
    """Return the chopping rate: how many times a second the current is regulated."""
    return oscillator_hz(osc_pf) / OSCILLATIONS_PER_CHOP


def clk_width_min_counts(osc_pf: float) -> int:
    """Return the minimum CLK high time in timer counts: the datasheet's figure, or else 4 oscillator periods.

    Raises:
        ValueError: as `oscillator_hz`.
    """
    width_us = _CLK_WIDTH_MIN_US.get(osc_pf, 4e6 / oscillator_hz(osc_pf))
    return ceil(width_us * COUNTS_PER_US)
