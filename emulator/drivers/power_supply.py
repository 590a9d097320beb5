"""The supply that all drivers of a board share: it drops under load, and rises while motors brake.

A source with a resistance charges the capacitors at the drivers. The bridges draw the energy of the phases from the
capacitors and return it to them. The source does not take energy back, so returned energy stays in the capacitors:

    C du/dt = max(0, (V - u) / R) - p / u

Resistance and capacitance are in the datasheets of real ones, or measured: docs/motors.md. The function uses plain
numbers, like those of `rotor_kernel`; its storage has SUPPLY_FIELDS numbers.
"""

from dataclasses import dataclass
from math import exp

from steptwin.controller.motion.kernel import kernel_function

VOLTS = 0
"""Voltage at the drivers."""
OPEN_V = 1
"""Voltage of the source without load."""
OHM = 2
"""Resistance of source and wires; 0 for a constant voltage."""
FARAD = 3
"""Capacitance at the drivers."""
FALL = 4
"""exp(-dt / RC)."""
DRAWN_J = 5
"""Energy that the bridges draw in the present step."""
LOWEST_V = 6
HIGHEST_V = 7
"""Extremes of the voltage so far."""
GIVEN_J = 8
"""Energy that the source has delivered."""
LOST_J = 9
"""Part of GIVEN_J that was lost in the resistance."""
SUPPLY_FIELDS = 10

COLLAPSED_V = 0.1
"""Lowest voltage of an overloaded supply: no driver works there, and divisions by 0 are avoided."""


@dataclass(frozen=True, slots=True)
class PowerSupply:
    """A source and the capacitors at the drivers.

    Attributes:
        volt: voltage without load.
        ohm: resistance of source and wires; 0 for a constant voltage.
        farad: capacitance at the drivers.

    Raises:
        ValueError: a resistance without capacitance, which is needed to store the energy of braking motors.
    """

    volt: float
    ohm: float = 0.0
    farad: float = 0.0

    def __post_init__(self) -> None:
        if self.ohm > 0.0 and not self.farad > 0.0:
            raise ValueError(f"farad: {self.farad:g} is not above 0, with {self.ohm:g} ohm")

    def numbers(self, dt_s: float) -> list[float]:
        """Return the storage of `draw` for steps of `dt_s`."""
        values = [0.0] * SUPPLY_FIELDS
        for field in (VOLTS, OPEN_V, LOWEST_V, HIGHEST_V):
            values[field] = self.volt
        values[OHM], values[FARAD] = self.ohm, self.farad
        values[FALL] = exp(-dt_s / (self.ohm * self.farad)) if self.ohm > 0.0 else 0.0
        return values


@kernel_function
def draw(supply: list[float], dt_s: float) -> None:
    """Draw the energy of one step, DRAWN_J, from the supply; the voltage is exact for a constant current."""
    drawn, supply[DRAWN_J] = supply[DRAWN_J], 0.0
    ohm, farad, volts = supply[OHM], supply[FARAD], supply[VOLTS]
    if ohm == 0.0:
        supply[GIVEN_J] += drawn
        return
    charge = drawn / volts
    final = supply[OPEN_V] - ohm * charge / dt_s
    apart = volts - final
    after = final + apart * supply[FALL]
    given = farad * (after - volts) + charge
    if given >= 0.0:
        steady = charge / dt_s
        fallen = 1.0 - supply[FALL]
        supply[LOST_J] += (
            ohm * steady * charge
            - 2.0 * ohm * farad * steady * apart * fallen
            + 0.5 * farad * apart * apart * fallen * (1.0 + supply[FALL])
        )
        supply[GIVEN_J] += supply[OPEN_V] * given
    else:
        after = volts - charge / farad
    after = max(after, COLLAPSED_V)
    supply[VOLTS] = after
    supply[LOWEST_V] = min(supply[LOWEST_V], after)
    supply[HIGHEST_V] = max(supply[HIGHEST_V], after)
