"""Configure a robot's machine for motion, in virtual runs and on live boards.

StepTwin uses wire units, the default of an axis. A board with other units (CiA 402-2, factor group) is refused, and its
units are not changed, because the master that has set them may still be active.
"""

from collections.abc import Iterable
from math import ceil
from typing import Final, NamedTuple

from steptwin.host.client import AxisClient, AxisSettings, Machine
from steptwin.host.client.axis import Objects
from steptwin.host.common.errors import DeviceFaultError
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import INCREMENTS, LINEAR_RAMP, SI_UNITS
from steptwin.protocol.dictionary import FACTORS
from steptwin.protocol.entry import DataType
from steptwin.protocol.od import UNITS_PER_FULL_STEP

_HOLD_AFTER_QUICK_STOP: Final = 6
"""Quick stop option code (605Ah): quick stop ramp, then hold the position, so a vertical axis does not fall."""
_FRAME_NS: Final = 44_000
"""Shortest frame at 1 Mbit/s. A motion starts at least one frame after ENABLE: a shorter settling needs no wait."""
_NO_TARGETS: Final = [
    (od.TARGET_VELOCITY, 0),
    (od.POSITION_LIMIT_MIN, DataType.INTEGER32.low),
    (od.POSITION_LIMIT_MAX, DataType.INTEGER32.high),
]
"""Entries that reset target velocity, then position limits. (The host checks planned motions.)"""


def set_up(machine: Machine, robot: Robot, start_units: list[int]) -> None:
    """Write a robot's settings to its axes, make them monitor this host, enable the drives, declare the positions.

    The board has just been switched on for this host only, so all settings are written without reading them first.

    Raises:
        DeviceFaultError: a drive is in fault or refuses a value.
        BusError: a node does not answer or is not a stepper axis.
    """
    machine.connect()
    machine.configure([axis_settings(joint, robot.board) for joint in robot.axes])
    machine.enable()
    machine.preset(start_units)


def objects_of(joint: Joint, board: BoardSettings, *, moves: bool) -> Objects:
    """Return the entries of an axis that an operator moves: the drive holds its position after a quick stop.

    For an axis that `moves`, they also reset target velocity and position limits of an earlier program.
    """
    targets = [*_NO_TARGETS, (od.MOTION_PROFILE_TYPE, LINEAR_RAMP)] if moves else []
    return [*axis_settings(joint, board).objects(), *targets, (od.QUICK_STOP_OPTION, _HOLD_AFTER_QUICK_STOP)]


def clear_targets(axes: Iterable[AxisClient]) -> None:
    """Reset target velocity and position limits, at standstill only; raises as `set_up`."""
    for axis in axes:
        for address, value in _NO_TARGETS:
            axis.write(address, value)


def restore_decelerations(machine: Machine, robot: Robot, axes: Iterable[int]) -> None:
    """Restore the deceleration of stops and halts, which the ramps of a move have replaced."""
    for axis in axes:
        settings = axis_settings(robot.axes[axis], robot.board)
        machine.axes[axis].write(od.PROFILE_DECELERATION, settings.deceleration_units_per_s2)


def axis_settings(joint: Joint, board: BoardSettings) -> AxisSettings:
    """Return the settings of a joint's axis, with the driver's speed limit and the joint's deceleration of stops."""
    transmission, settling_ns = joint.transmission, board.profile.settling_ns
    return AxisSettings(
        microsteps=transmission.microsteps,
        steplen_ns=board.steplen_ns,
        stepspace_ns=board.stepspace_ns,
        dirsetup_ns=board.dirsetup_ns,
        dirhold_ns=board.dirhold_ns,
        velocity_max_units_per_s=ceil(board.step_rate_max_hz * UNITS_PER_FULL_STEP / transmission.microsteps),
        deceleration_units_per_s2=ceil(
            (joint.axis_acceleration_max or joint.acceleration_max) * transmission.wire_units_per_unit
        ),
        settling_us=-(-settling_ns // 1000) if settling_ns > _FRAME_NS else 0,
    )


class AxisUnits(NamedTuple):
    """Factor objects of an axis: gear ratio (6091h), feed constant (6092h) and SI unit (60A8h) of positions.

    The factors are in the order of `FACTORS`.
    """

    motor_revolutions: int
    shaft_revolutions: int
    feed: int
    feed_revolutions: int
    si_unit: int

    @property
    def are_wire_units(self) -> bool:
        """True if the unit is the wire unit, with any SI unit."""
        wire = od.UNITS_PER_REVOLUTION * self.motor_revolutions * self.feed_revolutions
        return wire == self.shaft_revolutions * self.feed != 0

    def __str__(self) -> str:
        gear = f"gear {self.motor_revolutions}:{self.shaft_revolutions}"
        return f"{gear}, feed {self.feed}:{self.feed_revolutions}, in {_unit_text(self.si_unit)}"


WIRE_UNITS: Final = AxisUnits(1, 1, od.UNITS_PER_REVOLUTION, 1, INCREMENTS << 16)
"""Default units of an axis."""


def read_units(axis: AxisClient) -> AxisUnits:
    """Read an axis' units; an axis without these objects always uses wire units."""
    try:
        return AxisUnits(*map(axis.read, (*FACTORS, od.SI_UNIT_POSITION)))
    except DeviceFaultError:
        return WIRE_UNITS


def _unit_text(word: int) -> str:
    """Return the name of the unit in 60A8h, such as "10^-3 deg"."""
    prefix, unit = (word >> 24 ^ 0x80) - 0x80, SI_UNITS.get(word >> 16 & 0xFF, f"unit 0x{word:08X}")
    return f"10^{prefix} {unit}" if prefix else unit
