"""The settings that a page shows and changes: those of the board, and limits that this desk alone keeps."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from steptwin.host.common.bad_input import nearest_within, outside, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import Session
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od


@dataclass(frozen=True, slots=True)
class DriveSetting:
    """A setting that each axis has.

    Attributes:
        key: its name.
        title: what it is, in plain words.
        unit: its unit.
        address: the entry of the object dictionary that holds it.
        per_unit: the entry's value for a value of 1.
        lower: least value.
        upper: highest value.
        choices: the values that it may have; empty if it may have any from `lower` to `upper`.
        shared: True if it is of the whole machine, the same for all axes.
    """

    key: str
    title: str
    unit: str
    address: int
    per_unit: int
    lower: float
    upper: float
    choices: tuple[float, ...] = ()
    shared: bool = False

    def check(self, value: float) -> None:
        """Raise InputError, with the nearest valid choice, unless the setting may have this value."""
        if self.choices and value not in self.choices:
            passing = ", ".join(f"{choice:g}" for choice in self.choices)
            raise InputError(f"{self.key}: {value:g} {self.unit} is not one of {passing} {self.unit}")
        if not self.lower <= value <= self.upper:
            limits = (self.lower, self.upper, self.unit)
            raise InputError(f"{self.key}: {outside(value, *limits)}{nearest_within(value, *limits)}")


def _percent(key: str, title: str, address: int, choices: tuple[float, ...]) -> DriveSetting:
    return DriveSetting(key, title, "%", address, 1, min(choices), max(choices), choices)


_CURRENTS: Final = (20.0, 50.0, 75.0, 100.0)
"""Parts of the full current that the driver's pins TQ1 and TQ2 select (TB6560AHQ datasheet, page 10)."""
_DECAYS: Final = (0.0, 25.0, 50.0, 100.0)
"""Fast decay that its pins DCY1 and DCY2 select (page 10)."""
_SUPPLY_V: Final = (10.0, 34.0)
"""Motor supply as the board limits it after power-up: a stricter limit may be set, a looser one not."""

DRIVE_SETTINGS: Final = (
    _percent("torque", "Current in motion", od.TORQUE_PERCENT, _CURRENTS),
    _percent("rest_torque", "Current at rest", od.REST_TORQUE_PERCENT, _CURRENTS),
    _percent("fast_decay", "Fast decay of the current", od.FAST_DECAY_PERCENT, _DECAYS),
    DriveSetting("supply_min", "Least motor supply", "V", od.SUPPLY_VOLTAGE_MIN, 100, *_SUPPLY_V, shared=True),
    DriveSetting("supply_max", "Highest motor supply", "V", od.SUPPLY_VOLTAGE_MAX, 100, *_SUPPLY_V, shared=True),
    DriveSetting(
        "temperature_max", "Highest board temperature", "degC", od.BOARD_TEMPERATURE_MAX, 10, 20, 85, shared=True
    ),
)
"""All of them."""


def drive_settings(robot: Robot) -> tuple[DriveSetting, ...]:
    """Return the settings that a robot's board has: currents are set at drivers that have switches for them."""
    return tuple(setting for setting in DRIVE_SETTINGS if setting.shared or not robot.board.profile.switched)


def drive_setting(key: str, robot: Robot) -> DriveSetting:
    """Return a setting by its name; raise InputError if a robot's board has none of this name."""
    found = {setting.key: setting for setting in drive_settings(robot)}
    if key not in found:
        raise unknown("setting", key, found)
    return found[key]


def read_drive_setting(session: Session, setting: DriveSetting) -> tuple[float, ...]:
    """Read a setting of each axis; raise BusError if a node does not answer."""
    return tuple(axis.read(setting.address) / setting.per_unit for axis in session.machine.axes)


def write_drive_setting(session: Session, setting: DriveSetting, value: float, joint: str | None = None) -> None:
    """Write a setting of one joint's axis, or of all.

    Raises:
        InputError: the setting cannot have this value, there is no such joint, or a trajectory runs.
        DeviceFaultError: the board refuses the value.
        BusError: another program is in charge, or a node does not answer.
    """
    setting.check(value)
    axes = session.machine.axes if joint is None else (session.machine.axes[session.robot.axis_index(joint)],)
    with session.alone("settings"):
        for axis in axes:
            axis.ensure(setting.address, round(value * setting.per_unit))


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


@dataclass(slots=True)
class MachineSettings:
    """The robot's limits and all settings; the worker writes them, any thread may read them.

    Attributes:
        file: the robot as its file is.
        robot: the robot with the limits that the settings have now, none of them looser.
        settings: all settings as last read; empty before the first connection.
    """

    file: Robot
    robot: Robot
    settings: tuple[Setting, ...] = ()


_LIMITS: Final = {
    "speed_max": "Highest speed",
    "lower": "Lower limit",
    "upper": "Upper limit",
}
"""Fields of a joint that may be made stricter, with their titles."""


def read_settings(session: Session, limits: MachineSettings) -> tuple[Setting, ...]:
    """Read all settings; raise BusError if a node does not answer."""
    return (*_limits(limits.robot, limits.file), *_of_board(session))


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
    for setting in drive_settings(session.robot):
        values = read_drive_setting(session, setting)
        joints: tuple[str | None, ...] = (None,) if setting.shared else session.robot.axis_names
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


def check_settings(limits: MachineSettings, values: Mapping[str, float]) -> None:
    """Raise InputError, with the nearest valid choice, unless settings of these keys may have these values."""
    if not values:
        raise InputError("settings: none is given")
    limited(limits, values)
    for key, value in values.items():
        joint, field = _split(limits.file, key)
        if field not in _LIMITS:
            setting = drive_setting(field, limits.file)
            if setting.shared != (joint is None):
                raise unknown("setting", key, [setting.key])
            setting.check(value)


def limited(limits: MachineSettings, values: Mapping[str, float]) -> Robot:
    """Return the robot with other limits; raise InputError if they are looser than the file's or fit nothing else."""
    file = limits.file
    joints = {joint.name: joint for joint in limits.robot.joints}
    for key, value in values.items():
        name, field = _split(file, key)
        if name is not None and field in _LIMITS:
            allowed = (*_range(file.joint(name), field), str(joints[name].unit))
            if not allowed[0] <= value <= allowed[1]:
                raise InputError(f"{key}: {outside(value, *allowed)}{nearest_within(value, *allowed)}")
            joints[name] = _with_limit(joints[name], field, value)
    return replace(limits.robot, joints=tuple(joints.values()))


def write_settings(session: Session, limits: MachineSettings, values: Mapping[str, float]) -> None:
    """Write settings to the board and change the limits; raises as `check_settings` and `write_drive_setting`."""
    check_settings(limits, values)
    robot = limited(limits, values)
    for key, value in values.items():
        joint, field = _split(limits.file, key)
        if field not in _LIMITS:
            write_drive_setting(session, drive_setting(field, limits.file), value, joint)
    limits.robot = session.robot = robot


def _split(file: Robot, key: str) -> tuple[str | None, str]:
    """Return the joint, or None, and the setting that a key names; raise InputError for an unknown joint."""
    joint, dot, field = key.rpartition(".")
    if not dot:
        return None, key
    (file.index_of if field in _LIMITS else file.axis_index)(joint)
    return joint, field


def _with_limit(joint: Joint, field: str, value: float) -> Joint:
    if field == "speed_max":
        return replace(joint, speed_max=value)
    return replace(joint, lower=value) if field == "lower" else replace(joint, upper=value)
