"""The switches of the single-axis "3 A" TB6560 module (BL-TB6560-V2.0): current, excitation, decay, idle current.

SW1 to SW3 connect sense resistors in parallel, 0.33, 0.5 and 1.2 ohm as read from a photograph of the board; S1 is TQ1.
With I = 0.5 V / R that gives the 14 printed currents within 0.1 A. The resistor of each switch and the functions of S2
to S6 follow from the chip's tables and from sellers' descriptions, not from a schematic. The descriptions of S2
disagree: ON is taken as 50 %.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.tb6560.pins import EXCITATIONS, FAST_DECAY_PERCENT


class CurrentSetting(NamedTuple):
    """A row of the table on the board: the printed current, and the switches that are ON for it."""

    printed_a: float
    sw1: bool
    sw2: bool
    sw3: bool
    s1: bool


CURRENT_SETTINGS: Final = (
    CurrentSetting(0.3, sw1=False, sw2=False, sw3=True, s1=True),
    CurrentSetting(0.5, sw1=False, sw2=False, sw3=True, s1=False),
    CurrentSetting(0.8, sw1=False, sw2=True, sw3=False, s1=True),
    CurrentSetting(1.0, sw1=False, sw2=True, sw3=False, s1=False),
    CurrentSetting(1.1, sw1=False, sw2=True, sw3=True, s1=True),
    CurrentSetting(1.2, sw1=True, sw2=False, sw3=False, s1=True),
    CurrentSetting(1.4, sw1=False, sw2=True, sw3=True, s1=False),
    CurrentSetting(1.5, sw1=True, sw2=False, sw3=True, s1=True),
    CurrentSetting(1.6, sw1=True, sw2=False, sw3=False, s1=False),
    CurrentSetting(1.9, sw1=True, sw2=True, sw3=False, s1=True),
    CurrentSetting(2.0, sw1=True, sw2=False, sw3=True, s1=False),
    CurrentSetting(2.2, sw1=True, sw2=True, sw3=True, s1=True),
    CurrentSetting(2.6, sw1=True, sw2=True, sw3=False, s1=False),
    CurrentSetting(3.0, sw1=True, sw2=True, sw3=True, s1=False),
)

IDLE_PERCENT: Final = (20, 50)
"""Currents at standstill that S2 selects, in percent of the full current."""

_SENSE_OHM: Final = {"sw1": 0.33, "sw2": 0.5, "sw3": 1.2}


@dataclass(frozen=True, slots=True)
class DipSwitches:
    """Positions of a module's switches; True is ON.

    Attributes:
        current: row of the current table, which sets SW1, SW2, SW3 and S1.
        s2: 50 % of the full current at standstill if ON, else 20 %.
        s3: M1.
        s4: M2.
        s5: DCY1.
        s6: DCY2.
    """

    current: CurrentSetting
    s2: bool
    s3: bool
    s4: bool
    s5: bool
    s6: bool

    @property
    def sense_ohm(self) -> float:
        """Resistance of the sense resistors that are switched on, in parallel."""
        return 1 / sum(1 / ohm for name, ohm in _SENSE_OHM.items() if getattr(self.current, name))

    @property
    def microsteps(self) -> int:
        """Microsteps of the mode that S3 and S4 select."""
        return EXCITATIONS[int(self.s4), int(self.s3)]

    @property
    def running(self) -> dict[Pin, int]:
        """Levels of the chip's inputs that the switches set, while the motor moves; RESET is high with the supply."""
        return {
            Pin.M1: int(self.s3),
            Pin.M2: int(self.s4),
            Pin.DCY1: int(self.s5),
            Pin.DCY2: int(self.s6),
            Pin.TQ1: int(self.current.s1),
            Pin.TQ2: 0,
            Pin.RESET: 1,
        }

    @property
    def standing(self) -> dict[Pin, int]:
        """Levels of the torque inputs at standstill: TQ2 alone for 50 %, both for 20 %."""
        return {Pin.TQ1: int(not self.s2), Pin.TQ2: 1}


def switches_for(current_a: float, microsteps: int, fast_decay_percent: int = 0, idle_percent: int = 50) -> DipSwitches:
    """Return the positions of the switches for a current, microstep mode, fast decay and idle current.

    Raises:
        ValueError: the switches have no such setting; the message names the nearest ones.
    """
    current = {setting.printed_a: setting for setting in CURRENT_SETTINGS}.get(current_a)
    if current is None:
        nearest = sorted(CURRENT_SETTINGS, key=lambda setting: abs(setting.printed_a - current_a))[:2]
        choices = " and ".join(f"{setting.printed_a:g} A" for setting in sorted(nearest))
        raise ValueError(f"{current_a:g} A is not one of the module's settings: the nearest are {choices}")
    m2, m1 = _levels(EXCITATIONS, microsteps, "steps of a full step")
    dcy2, dcy1 = _levels(FAST_DECAY_PERCENT, fast_decay_percent, "% fast decay")
    if idle_percent not in IDLE_PERCENT:
        raise ValueError(f"{idle_percent} % at standstill is neither 20 % nor 50 %")
    return DipSwitches(current, s2=idle_percent == 50, s3=bool(m1), s4=bool(m2), s5=bool(dcy1), s6=bool(dcy2))


def _levels(table: Mapping[tuple[int, int], int], wanted: int, what: str) -> tuple[int, int]:
    for levels, value in table.items():
        if value == wanted:
            return levels
    raise ValueError(f"{wanted} {what} is not one of {', '.join(str(int(value)) for value in table.values())}")
