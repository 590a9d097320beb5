"""Documented reactions to harms to the machine itself: emergency stop, supply, temperature, motors, boards' logic."""

from dataclasses import replace
from typing import Final

from steptwin.emulator.faults.harm import Harm
from steptwin.emulator.faults.machine import (
    BoardTemperature,
    BrownOut,
    EmergencyStop,
    Payload,
    PowerUp,
    SetInput,
    Slip,
    Supply,
    WatchdogReset,
)
from steptwin.host.faults.reaction import (
    GOES_ON,
    HOST_LOST,
    LOST_BOARD_MS,
    TICK_MS,
    UNKNOWABLE,
    Documented,
    Motion,
    Reaction,
    stops,
)
from steptwin.host.faults.target import Moment
from steptwin.protocol.cia402 import ErrorCode, State

SUPPLY_RANGE_10MV: Final = range(1000, 3401)
"""Motor supply with drives on: 0x2002:03 and :04 after power-up."""
TEMPERATURE_MAX_DECIDEGC: Final = 850
"""Highest temperature of the board with drives on: 0x2002:05 after power-up."""


def _one_of_several(harm: Harm, moment: Moment) -> bool:
    """Return whether one of several boards is reset."""
    return isinstance(harm, BrownOut | WatchdogReset) and harm.axis is not None and moment.several_boards


ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "emergency stop pressed",
        lambda harm, _: isinstance(harm, EmergencyStop) and harm.pressed,
        stops(ErrorCode.ESTOP),
        "stop category 1 of IEC 60204-1",
    ),
    Documented("emergency stop pulled out", lambda harm, _: isinstance(harm, EmergencyStop), GOES_ON),
    Documented(
        "motor supply below 10.00 V",
        lambda harm, _: isinstance(harm, Supply) and harm.supply_10mv < SUPPLY_RANGE_10MV.start,
        stops(ErrorCode.UNDERVOLTAGE, motion=Motion.CUT),
        "without its supply no driver can follow a ramp",
    ),
    Documented(
        "motor supply above 34.00 V",
        lambda harm, _: isinstance(harm, Supply) and harm.supply_10mv >= SUPPLY_RANGE_10MV.stop,
        stops(ErrorCode.OVERVOLTAGE),
    ),
    Documented("motor supply from 10.00 to 34.00 V", lambda harm, _: isinstance(harm, Supply), GOES_ON),
    Documented(
        "board above 85.0 degC",
        lambda harm, _: isinstance(harm, BoardTemperature) and harm.temperature_decidegc > TEMPERATURE_MAX_DECIDEGC,
        stops(ErrorCode.TEMPERATURE),
    ),
    Documented("board up to 85.0 degC", lambda harm, _: isinstance(harm, BoardTemperature), GOES_ON),
    Documented(
        "sensor on or off",
        lambda harm, _: isinstance(harm, SetInput),
        GOES_ON,
        "programs wait for it",
    ),
    Documented(
        "a motor falls out of step",
        lambda harm, _: isinstance(harm, Slip),
        UNKNOWABLE,
        "a board without encoders cannot know; the verdict tells it, and homing ends it; a limit switch may come",
    ),
    Documented(
        "another payload",
        lambda harm, _: isinstance(harm, Payload),
        replace(UNKNOWABLE, codes=(ErrorCode.LIMIT_SWITCH, ErrorCode.GROUP_STOPPED)),
        "a board without encoders cannot know whether its motors keep step; the verdict tells a slip; after it a limit"
        " switch may come",
    ),
    Documented(
        "one of several boards is without supply from now on",
        lambda harm, moment: _one_of_several(harm, moment) and isinstance(harm, BrownOut) and harm.for_ms is None,
        Reaction(Motion.CUT, begins_ms=LOST_BOARD_MS, others=HOST_LOST),
        "its nodes are silent; the host stops the axes of the other boards after 1 s",
    ),
    Documented(
        "one of several boards browns out for a time, or its watchdog resets it",
        _one_of_several,
        Reaction(Motion.CUT, (), State.SWITCH_ON_DISABLED, LOST_BOARD_MS, others=HOST_LOST),
        "its own axes stop at once, and are to be homed; the host stops those of the other boards when this board"
        " announces itself again, or after 1 s of silence",
    ),
    Documented(
        "a board's logic is without supply from now on",
        lambda harm, _: isinstance(harm, BrownOut) and harm.for_ms is None,
        Reaction(Motion.CUT, begins_ms=TICK_MS),
        "its nodes are silent, which the host notices after 1 s, until `power-up`: then as below",
    ),
    Documented(
        "a board's logic browns out for a time, or its watchdog resets it",
        lambda harm, _: isinstance(harm, BrownOut | WatchdogReset),
        Reaction(Motion.CUT, (), State.SWITCH_ON_DISABLED, TICK_MS),
        "its nodes announce themselves again and know no position; home them",
    ),
    Documented("a board without power gets it", lambda harm, _: isinstance(harm, PowerUp), GOES_ON),
)
