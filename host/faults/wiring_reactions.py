"""Documented reactions to harms to the wiring: Protect, switches and their wires, drivers' settings, their wires."""

from math import inf
from typing import Final, TypeGuard

from steptwin.emulator.faults.drivers import DriverMode, DriverProtect, OscCapacitor
from steptwin.emulator.faults.harm import Harm
from steptwin.emulator.faults.limit_switches import BouncingSwitch, Contact, StuckSwitch, SwitchWire
from steptwin.emulator.faults.wiring import SetWire, WireState
from steptwin.host.faults.reaction import GOES_ON, UNKNOWABLE, Documented, Motion, Reaction, stops
from steptwin.host.faults.target import Moment
from steptwin.protocol.cia402 import DigitalInput, ErrorCode


def _closed(harm: Harm) -> TypeGuard[StuckSwitch]:
    """Return whether a limit switch sticks closed."""
    return isinstance(harm, StuckSwitch) and bool(harm.closed) and harm.switch is not DigitalInput.HOME


def _seems_closed(harm: Harm) -> TypeGuard[SwitchWire]:
    """Return whether the broken wire of a limit switch looks as if that were closed."""
    if not isinstance(harm, SwitchWire) or harm.switch is DigitalInput.HOME:
        return False
    return harm.broken is Contact.NORMALLY_CLOSED


def _towards(harm: StuckSwitch | SwitchWire, moment: Moment) -> bool:
    """Return whether its axis moves towards a limit switch."""
    velocity = moment.axes[harm.axis].velocity
    return velocity > 0 if harm.switch is DigitalInput.POSITIVE_LIMIT else velocity < 0


ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "Protect of a driver low",
        lambda harm, _: isinstance(harm, DriverProtect) and harm.active,
        stops(ErrorCode.TEMPERATURE, motion=Motion.CUT),
        "this driver has switched itself off; the other axes stop by a ramp",
    ),
    Documented("Protect of a driver free", lambda harm, _: isinstance(harm, DriverProtect), GOES_ON),
    Documented(
        "limit switch stuck closed, the axis moves towards it",
        lambda harm, moment: _closed(harm) and _towards(harm, moment),
        stops(ErrorCode.LIMIT_SWITCH),
    ),
    Documented(
        "limit switch stuck closed, the axis rests or moves away",
        lambda harm, _: _closed(harm),
        stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
        "once it moves towards the switch",
    ),
    Documented(
        "switch stuck open, or a home switch stuck closed",
        lambda harm, _: isinstance(harm, StuckSwitch),
        GOES_ON,
        "a planned motion stays between its limit switches; homing fails (EMCY 0xFF05)",
    ),
    Documented(
        "wire of a limit switch broken, its contact closed at rest, the axis moves towards it",
        lambda harm, moment: _seems_closed(harm) and _towards(harm, moment),
        stops(ErrorCode.LIMIT_SWITCH),
        "as a switch that is stuck closed",
    ),
    Documented(
        "wire of a limit switch broken, its contact closed at rest, the axis rests or moves away",
        lambda harm, _: _seems_closed(harm),
        stops(ErrorCode.LIMIT_SWITCH, begins_ms=inf, certain=False),
        "once it moves towards the switch",
    ),
    Documented(
        "wire of a switch broken, its contact open at rest",
        lambda harm, _: isinstance(harm, SwitchWire),
        GOES_ON,
        "the board notices it only when it needs the switch: fit contacts that are closed at rest",
    ),
    Documented(
        "a switch bounces",
        lambda harm, _: isinstance(harm, BouncingSwitch),
        GOES_ON,
        "a planned motion stays between its limit switches; homing takes the first edge that a tick shows",
    ),
    Documented(
        "a driver in another microstep mode",
        lambda harm, _: isinstance(harm, DriverMode),
        UNKNOWABLE,
        "its steps are longer or shorter: a limit switch may come; the verdict tells it, `doctor` finds it",
    ),
    Documented(
        "another capacitor at OSC",
        lambda harm, _: isinstance(harm, OscCapacitor),
        Reaction(Motion.GOES_ON, verified=False),
        "with a larger one the chip misses pulses; the verdict tells it",
    ),
    Documented(
        "wire to a driver broken, shorted or noisy",
        lambda harm, _: isinstance(harm, SetWire) and harm.condition is not WireState.WHOLE,
        UNKNOWABLE,
        "a board without feedback from its drivers cannot know; the verdict tells it; a limit switch may come",
    ),
    Documented("wire to a driver whole", lambda harm, _: isinstance(harm, SetWire), GOES_ON),
)
