"""Machine parameters that a campaign varies: their effect on a run's setup, and their values."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, Final

from steptwin.features.motors.turning import check_described
from steptwin.features.motors.turning.ramps import with_managed_ramps
from steptwin.host.common.bad_input import known, outside, prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import number_at
from steptwin.host.planning.motion import DEFAULT_POINT_MS
from steptwin.host.planning.motions.stretched import STRETCH_MAX
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import check_axes_per_board, check_crystals
from steptwin.host.twin.machine.drivers import driver_profile
from steptwin.protocol.drivers import driver_names
from steptwin.protocol.pvt import DURATION_MAX_MS


class RampSource(Enum):
    """Source of the joints' accelerations in moves, stops and homings."""

    FILE = "file"
    """Those of the robot's file."""
    MOTORS = "motors"
    """Those that the motors can follow, with the drawn payload, friction and drivers, if they are lower."""


@dataclass(frozen=True, slots=True)
class Setup:
    """Setup of a run.

    Attributes:
        robot: the varied robot.
        ramps: source of its accelerations, applied after all other parameters.
        record_ms: length of the PVT records.
        stretch: factor on the motion's duration.
        driver_profile: drivers instead of the robot file's; None: the file's.
        crystals_ppm: deviation of each board's crystal, in parts per million.
    """

    robot: Robot
    ramps: RampSource = RampSource.FILE
    record_ms: int = DEFAULT_POINT_MS
    stretch: float = 1.0
    driver_profile: str | None = None
    crystals_ppm: tuple[int, ...] = (0,)

    @property
    def axes_per_board(self) -> tuple[int, ...] | None:
        """Number of axes on each of several boards, divided evenly; None: one board has all."""
        boards, axes = len(self.crystals_ppm), len(self.robot.axes)
        if boards == 1:
            return None
        return tuple(axes * (number + 1) // boards - axes * number // boards for number in range(boards))


def set_up(robot: Robot, varied: Mapping[str, object]) -> Setup:
    """Return the setup of a run with a value for each parameter, in any order.

    Raises:
        InputError: a parameter does not have this value, or the robot lacks it; the message names it.
    """
    setup = Setup(robot)
    for parameter, value in varied.items():
        with prefixed(f"vary.{parameter}: "):
            setup = VARIATIONS[parameter](setup, value)
    if setup.ramps is RampSource.FILE:
        return setup
    with prefixed("vary.ramps: "):
        drivers = driver_profile(setup.robot.board, setup.driver_profile)
        return replace(setup, robot=with_managed_ramps(setup.robot, drivers))


def _payload(setup: Setup, value: object) -> Setup:
    dynamics = setup.robot.dynamics
    if dynamics is None:
        raise InputError(f"{setup.robot.name} says nothing of its dynamics (docs/motors.md)")
    payload_kg = number_at("payload", value)
    return replace(setup, robot=replace(setup.robot, dynamics=replace(dynamics, payload_kg=payload_kg)))


def _friction(setup: Setup, value: object) -> Setup:
    factor = number_at("factor", value)
    if factor < 0:
        raise InputError(f"{factor:g} is a negative factor")

    def rubbing(joint: Joint) -> Joint:
        motor = joint.motor
        return replace(joint, motor=motor and replace(motor, friction_nm=factor * motor.friction_nm))

    return _with_joints(setup, rubbing)


def _ramps(setup: Setup, value: object) -> Setup:
    sources = {source.value: source for source in RampSource}
    source = sources[known("source", value, sources)]
    if source is RampSource.MOTORS:
        check_described(setup.robot)
    return replace(setup, ramps=source)


def _microsteps(setup: Setup, value: object) -> Setup:
    microsteps = _whole(value)
    return _with_joints(
        setup, lambda joint: replace(joint, transmission=replace(joint.transmission, microsteps=microsteps))
    )


def _with_joints(setup: Setup, change: Callable[[Joint], Joint]) -> Setup:
    return replace(setup, robot=replace(setup.robot, joints=tuple(map(change, setup.robot.joints))))


def _driver_profile(setup: Setup, value: object) -> Setup:
    return replace(setup, driver_profile=known("driver profile", value, driver_names()))


def _record_ms(setup: Setup, value: object) -> Setup:
    record_ms = _whole(value)
    if not 1 <= record_ms <= DURATION_MAX_MS:
        raise InputError(outside(record_ms, 1, DURATION_MAX_MS, "ms"))
    return replace(setup, record_ms=record_ms)


def _bitrate(setup: Setup, value: object) -> Setup:
    return replace(setup, robot=replace(setup.robot, board=replace(setup.robot.board, bitrate=_whole(value))))


def _stretch(setup: Setup, value: object) -> Setup:
    factor = number_at("factor", value)
    if not 0 < factor <= STRETCH_MAX:
        raise InputError(f"{factor:g} is not above 0 and up to {STRETCH_MAX:g}")
    return replace(setup, stretch=factor)


def _crystal_ppm(setup: Setup, value: object) -> Setup:
    crystals_ppm = [_whole(each) for each in (value if isinstance(value, list) else [value])]
    check_crystals(crystals_ppm, len(crystals_ppm))
    made = replace(setup, crystals_ppm=tuple(crystals_ppm))
    if made.axes_per_board is not None:
        check_axes_per_board(made.axes_per_board, len(setup.robot.axes))
    return made


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{value!r} is not a whole number")
    return value


VARIATIONS: Final[Mapping[str, Callable[[Setup, Any], Setup]]] = {
    "payload_kg": _payload,
    "friction": _friction,
    "ramps": _ramps,
    "microsteps": _microsteps,
    "driver_profile": _driver_profile,
    "record_ms": _record_ms,
    "bitrate": _bitrate,
    "stretch": _stretch,
    "crystal_ppm": _crystal_ppm,
}
"""Effect of each parameter of [vary]: payload at the tool in kg, a factor of all motors' friction, source of the
accelerations, microsteps of all axes, drivers that neither plan nor firmware know of, length of PVT records in ms,
bit rate, a factor of slowness, and the deviation of the boards' crystals in parts per million, one number or a list
with one for each board.
"""
