"""The TB6560's oscillator: the capacitor at OSC sets the chopping rate and the shortest CLK pulse that counts.

Pages are those of Toshiba's datasheet "TB6560AHQ/AFG" of 2014-10-01.
"""

from dataclasses import dataclass
from math import ceil
from typing import Final

from steptwin.protocol.timer import COUNTS_PER_US

OSCILLATIONS_PER_CHOP: Final = 4
"""Periods of the oscillator in one chopping period (pages 16 and 20)."""

OSCILLATOR_MAX_HZ: Final = 600_000
"""Upper end of the operating range (pages 6 to 8), which has no lower end."""

OSC_PF_MIN: Final = 64
"""Smallest capacitor, in whole pF, with which the oscillator keeps to it by the formula of `Oscillator.hz`."""

_CLK_WIDTH_MIN_US: Final = {100.0: 10.0, 330.0: 30.0, 1000.0: 90.0}
"""t_W(CLK) at the capacitors for which the datasheet states it (page 8); only 330 pF is tested in production."""


@dataclass(frozen=True, slots=True)
class Oscillator:
    """A capacitor at OSC, in pF; raises ValueError unless it is positive and large enough for the operating range."""

    osc_pf: float

    def __post_init__(self) -> None:
        if not self.osc_pf > 0:
            raise ValueError(f"the OSC capacitor is {self.osc_pf} pF; it must be positive, for example 330")
        if self.hz > OSCILLATOR_MAX_HZ:
            raise ValueError(
                f"the OSC capacitor is {self.osc_pf:g} pF, which makes {self.hz / 1000:.0f} kHz: at most"
                f" {OSCILLATOR_MAX_HZ // 1000} kHz are allowed, {OSC_PF_MIN} pF or more"
            )

    @property
    def hz(self) -> float:
        """Frequency by the datasheet's approximation (page 25): 400 kHz at 100 pF."""
        return 1e6 / (self.osc_pf * 1.5 * (10 / self.osc_pf + 1) / 66)

    @property
    def chopping_hz(self) -> float:
        """How many times a second the current is regulated."""
        return self.hz / OSCILLATIONS_PER_CHOP

    @property
    def clk_width_min_us(self) -> float:
        """Shortest time for which CLK is high: the datasheet's figure, or else 4 periods of the oscillator."""
        return _CLK_WIDTH_MIN_US.get(self.osc_pf, 4e6 / self.hz)

    @property
    def clk_width_min_counts(self) -> int:
        """The same in counts of the board's timer, rounded up."""
        return ceil(self.clk_width_min_us * COUNTS_PER_US)
