"""The settings that a page shows and changes: those of the board, and limits that this desk alone keeps."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from steptwin.host.common.bad_input import nearest_within, outside, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.drive_settings import (
    DRIVE_SETTINGS,
    drive_setting,
    read_drive_setting,
    write_drive_setting,
)
from steptwin.host.operate.session import Session
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Setting:
    """A setting with its present value.

    Attributes:
        key: its name for `WriteSettings`, such as `th2.speed_max`.
        joint: the joint to which it belongs; None for one of the whole machine.
        title: what it is, in plain words.
        unit: unit of value and limits.
        value: the present value.
        lower: least value that is allowed.
        upper: highest value that is allowed.
        choices: the values that are allowed; empty if all from `lower` to `upper` are.
        stored: True if the board has it, False if only this desk keeps it.
    """

    key: str
    joint: str | None
    title: str
    unit: str
    value: float
    lower: float
    upper: float
    choices: tuple[float, ...]
    stored: bool


_LIMITS: Final = {
    "speed_max": "Highest speed",
    "lower": "Lower limit",
    "upper": "Upper limit",
}
"""Fields of a joint that may be made stricter, with their titles."""


def read_settings(session: Session, file: Robot) -> tuple[Setting, ...]:
    """Read all settings; `file` is the robot with the limits of its file. Raises BusError if a node does not answer."""
    return (*_limits(session.robot, file), *_of_board(session))


def _limits(robot: Robot, file: Robot) -> Iterator[Setting]:
    for joint, widest in zip(robot.joints, file.joints, strict=True):
        for field, title in _LIMITS.items():
            unit = f"{joint.unit}/s" if field == "speed_max" else str(joint.unit)
            least, most = _range(widest, field)
            yield Setting(
                f"{joint.name}.{field}", joint.name, title, unit, getattr(joint, field), least, most, (), stored=False
            )


def _range(widest: Joint, field: str) -> tuple[float, float]:
    """Return the values that a limit of a joint may have: no homing is faster than a joint."""
    if field == "speed_max":
        return (widest.homing.search_speed if widest.homing else widest.speed_max / 1000), widest.speed_max
    return widest.lower, widest.upper


def _of_board(session: Session) -> Iterator[Setting]:
    for setting in DRIVE_SETTINGS:
        values = read_drive_setting(session, setting)
        joints: tuple[str | None, ...] = (None,) if setting.shared else session.robot.joint_names
        for joint, value in zip(joints, values, strict=False):
            key = setting.key if joint is None else f"{joint}.{setting.key}"
            yield Setting(
                key,
                joint,
                setting.title,
                setting.unit,
                value,
                setting.lower,
                setting.upper,
                setting.choices,
                stored=True,
            )


def check_settings(file: Robot, values: Mapping[str, float]) -> None:
    """Raise InputError, with the nearest valid choice, unless settings of these keys may have these values."""
    if not values:
        raise InputError("settings: none is given")
    limited(file, file, values)
    for key, value in values.items():
        joint, field = _split(file, key)
        if field not in _LIMITS:
            setting = drive_setting(field)
            if setting.shared != (joint is None):
                raise unknown("setting", key, [setting.key])
            setting.check(value)


def limited(robot: Robot, file: Robot, values: Mapping[str, float]) -> Robot:
    """Return the robot with other limits; raise InputError if they are looser than the file's or fit nothing else."""
    joints = {joint.name: joint for joint in robot.joints}
    for key, value in values.items():
        name, field = _split(file, key)
        if name is not None and field in _LIMITS:
            limits = (*_range(file.joint(name), field), str(joints[name].unit))
            if not limits[0] <= value <= limits[1]:
                raise InputError(f"{key}: {outside(value, *limits)}{nearest_within(value, *limits)}")
            joints[name] = _with_limit(joints[name], field, value)
    return replace(robot, joints=tuple(joints.values()))


def write_settings(session: Session, file: Robot, values: Mapping[str, float]) -> Robot:
    """Write settings to the board and return the robot with the new limits; raises as `write_drive_setting`."""
    check_settings(file, values)
    robot = limited(session.robot, file, values)
    for key, value in values.items():
        joint, field = _split(file, key)
        if field not in _LIMITS:
            write_drive_setting(session, drive_setting(field), value, joint)
    return robot


def _split(file: Robot, key: str) -> tuple[str | None, str]:
    """Return the joint, or None, and the setting that a key names; raise InputError for an unknown joint."""
    joint, dot, field = key.rpartition(".")
    if not dot:
        return None, key
    file.index_of(joint)
    return joint, field


def _with_limit(joint: Joint, field: str, value: float) -> Joint:
    if field == "speed_max":
        return replace(joint, speed_max=value)
    return replace(joint, lower=value) if field == "lower" else replace(joint, upper=value)
