"""The oscillator of the chopper: its capacitor sets the chopping rate and the shortest CLK pulse that is seen."""

from math import ceil
from typing import Final

from emulator.edges import COUNTS_PER_US

OSCILLATIONS_PER_CHOP: Final = 4
"""Pages 16 and 20."""

_CLK_WIDTH_MIN_US: Final = {100.0: 10.0, 330.0: 30.0, 1000.0: 90.0}
"""t_W(CLK) at the capacitors for which it is stated (page 8); only that at 330 pF is tested in production."""


def oscillator_hz(osc_pf: float) -> float:
    """Frequency at a capacitor, by the datasheet's approximation (page 25): 400 kHz at 100 pF.

    Raises:
        ValueError: no such capacitor.
    """
    _require_capacitor(osc_pf)
    return 1e6 / (osc_pf * 1.5 * (10 / osc_pf + 1) / 66)


def chopping_hz(osc_pf: float) -> float:
    """How often a second the current is regulated."""
    return oscillator_hz(osc_pf) / OSCILLATIONS_PER_CHOP


def clk_width_min_counts(osc_pf: float) -> int:
    """Minimum CLK high time in timer counts: the datasheet's figure where it has one, else four oscillator periods.

    Raises:
        ValueError: no such capacitor.
    """
    _require_capacitor(osc_pf)
    width_us = _CLK_WIDTH_MIN_US.get(osc_pf, 4e6 / oscillator_hz(osc_pf))
    return ceil(width_us * COUNTS_PER_US)


def _require_capacitor(osc_pf: float) -> None:
    if not osc_pf > 0:
        raise ValueError(f"the OSC capacitor is {osc_pf} pF; it must be positive, for example 330")
