"""A driver that no profile describes: its user gives what its manual says, in a robot file's table [board.driver]."""

from dataclasses import dataclass
from typing import Final

from steptwin.protocol.drivers.chip_sheet import ChipSheet, StepTimes
from steptwin.protocol.drivers.driver_profile import DriverProfile, InputLevels
from steptwin.protocol.drivers.facts import Fact, assumed
from steptwin.protocol.drivers.pin_table import PinTable, always

GENERIC: Final = "generic"
"""Name of the profile that is made of these figures."""

_FILE: Final = "robot file, board.driver"
_UNTOLD: Final = f"not told: {_FILE} has no key for it"
_MODE_BITS: Final = 5
"""Bits of a register that selects among up to 17 microstep modes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverFigures:
    """What a user says of a driver; the times are those of `StepTimes`, and its active edge is the board's setting.

    Attributes:
        microsteps: microsteps per full step that it has.
        steplen_ns: from the active edge of STEP until it goes back.
        stepspace_ns: before the active edge, likewise.
        dirsetup_ns: DIR stable before the active edge.
        dirhold_ns: DIR stable after it.
        enable_ns: from ENABLE until the first step.
        wake_ns: from the supply until the first step.
        step_rate_max_hz: highest step rate; None: that of the shortest pulses.
        counts_while_off: STEP is counted while ENABLE is off, too; else it is ignored.
        current_max_a: highest current of a phase, at its peak.
        input_high_v: least voltage of a high level at STEP, DIR and ENABLE.
        input_ma: current that an optocoupler takes there; 0: it has none.
    """

    microsteps: tuple[int, ...]
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    enable_ns: int = 0
    wake_ns: int = 0
    step_rate_max_hz: int | None = None
    counts_while_off: bool = False
    current_max_a: float = 10.0
    input_high_v: float = 3.3
    input_ma: float = 0.0

    def profile(self) -> DriverProfile:
        """Return the driver's profile; what the table has no key for is assumed and says so."""

        def told(key: str) -> Fact[int] | None:
            value = getattr(self, key)
            return Fact(value, f"{_FILE}.{key}") if value else None

        modes = tuple(
            (mode, f"{number:0{_MODE_BITS}b}".replace("0", "L").replace("1", "H"))
            for number, mode in enumerate(sorted(self.microsteps))
        )
        chip = ChipSheet(
            name="generic driver",
            document=_FILE,
            rails=("VM",),
            logic_rail="VM",
            times=StepTimes(
                steplen_ns=told("steplen_ns"),
                stepspace_ns=told("stepspace_ns"),
                dirsetup_ns=told("dirsetup_ns"),
                dirhold_ns=told("dirhold_ns"),
                enable_ns=told("enable_ns"),
                wake_ns=told("wake_ns"),
                rate_max_hz=told("step_rate_max_hz"),
            ),
            modes=Fact(PinTable(tuple(f"MODE{bit}" for bit in reversed(range(_MODE_BITS))), modes), _FILE),
            torque_percent=assumed(always(100), _UNTOLD),
            fast_decay_percent=assumed(always(0), _UNTOLD),
            home_deg=assumed(0.0, _UNTOLD),
            home_full_deg=assumed(45.0, _UNTOLD),
            blocked=Fact(not self.counts_while_off, f"{_FILE}.counts_while_off"),
            current_law=assumed("by hand", _UNTOLD),
            current_max_a=Fact(self.current_max_a, f"{_FILE}.current_max_a"),
            sense_ohm=assumed(0.1, _UNTOLD),
            on_resistance_ohm=assumed(0.5, _UNTOLD),
            supply_v=assumed((0.0, 1000.0), _UNTOLD),
        )
        return DriverProfile(
            name=GENERIC,
            title="driver of the robot file's [board.driver]",
            chip=chip,
            current_a=min(1.5, self.current_max_a),
            inputs=Fact(InputLevels(self.input_high_v, self.input_ma), f"{_FILE}.input_high_v"),
            source=_FILE,
        )
