"""Settings that a page shows and changes: those of the board, and limits of this panel alone."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from steptwin.host.common.bad_input import nearest_within, outside, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import Session
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od


@dataclass(frozen=True, slots=True)
class DriveSetting:
    """A setting of each axis.

    Attributes:
        key: its name.
        title: its title in plain words.
        unit: its unit.
        address: its entry in the object dictionary.
        per_unit: value of the entry for a setting of 1.
        lower: lowest value.
        upper: highest value.
        choices: allowed values; empty for any from `lower` to `upper`.
        shared: True if all axes have the same value.
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
        """Raise InputError, with the nearest valid choice, for a value that is not allowed."""
        if self.choices and value not in self.choices:
            passing = ", ".join(f"{choice:g}" for choice in self.choices)
            raise InputError(f"{self.key}: {value:g} {self.unit} is not one of {passing} {self.unit}")
        _check_within(self.key, value, self.lower, self.upper, self.unit)

    def read(self, session: Session) -> tuple[float, ...]:
        """Return the value of each axis; raise BusError if a node does not answer."""
        return tuple(axis.read(self.address) / self.per_unit for axis in session.machine.axes)

    def write(self, session: Session, value: float, joint: str | None = None) -> None:
        """Write the value to one joint's axis, or to all.

        Raises:
            InputError: the value is not allowed, the joint does not exist, or a trajectory runs.
            DeviceFaultError: the board refuses the value.
            BusError: another program has the lease, or a node does not answer.
        """
        self.check(value)
        axes = session.machine.axes if joint is None else (session.machine.axes[session.robot.axis_index(joint)],)
        with session.alone("settings"):
            for axis in axes:
                axis.ensure(self.address, round(value * self.per_unit))


_CURRENTS: Final = (20.0, 50.0, 75.0, 100.0)
"""Percentages of the full current that the driver's pins TQ1 and TQ2 select (TB6560AHQ datasheet, page 10)."""
_DECAYS: Final = (0.0, 25.0, 50.0, 100.0)
"""Fast decay that its pins DCY1 and DCY2 select (page 10)."""
_SUPPLY_V: Final = (10.0, 34.0)
"""Limits of the motor supply after power-up: stricter ones may be set, looser ones not."""

DRIVE_SETTINGS: Final = (
    DriveSetting("torque", "Current in motion", "%", od.TORQUE_PERCENT, 1, 20, 100, _CURRENTS),
    DriveSetting("rest_torque", "Current at rest", "%", od.REST_TORQUE_PERCENT, 1, 20, 100, _CURRENTS),
    DriveSetting("fast_decay", "Fast decay of the current", "%", od.FAST_DECAY_PERCENT, 1, 0, 100, _DECAYS),
    DriveSetting("supply_min", "Least motor supply", "V", od.SUPPLY_VOLTAGE_MIN, 100, *_SUPPLY_V, shared=True),
    DriveSetting("supply_max", "Highest motor supply", "V", od.SUPPLY_VOLTAGE_MAX, 100, *_SUPPLY_V, shared=True),
    DriveSetting(
        "temperature_max", "Highest board temperature", "degC", od.BOARD_TEMPERATURE_MAX, 10, 20, 85, shared=True
    ),
)
"""All settings of axes."""


def drive_settings(robot: Robot) -> tuple[DriveSetting, ...]:
    """Return the settings of a robot's board: currents are set at drivers that have switches for them."""
    return tuple(setting for setting in DRIVE_SETTINGS if setting.shared or not robot.board.profile.switched)


def drive_setting(key: str, robot: Robot) -> DriveSetting:
    """Return a setting by name; raise InputError if the robot's board does not have it."""
    found = {setting.key: setting for setting in drive_settings(robot)}
    if key not in found:
        raise unknown("setting", key, found)
    return found[key]


@dataclass(frozen=True, slots=True)
class Setting:
    """A setting with its present value.

    Attributes:
        key: its name for `WriteSettings`, such as `th2.speed_max`.
        joint: its joint; None for one of the whole machine.
        title: its title in plain words.
        unit: unit of value and limits.
        value: present value.
        lower: lowest allowed value.
        upper: highest allowed value.
        choices: allowed values; empty for any from `lower` to `upper`.
        stored: True if the board stores it, False if only this panel does.
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


_LIMITS: Final = {"speed_max": "Highest speed", "lower": "Lower limit", "upper": "Upper limit"}
"""Fields of a joint that may be made stricter, with their titles."""


@dataclass(slots=True)
class MachineSettings:
    """The robot's limits and all settings; the service's thread writes them, any thread reads them.

    Attributes:
        file: robot of the file.
        robot: robot with the limits of the present settings, none of them looser.
        settings: settings as last read; empty before the first connection.
    """

    file: Robot
    robot: Robot
    settings: tuple[Setting, ...] = ()

    def read(self, session: Session) -> None:
        """Read all settings; raise BusError if a node does not answer."""
        self.settings = (*self._limits(), *_of_board(session))

    def check(self, values: Mapping[str, float]) -> None:
        """Raise InputError, with the nearest valid choice, for values that are not allowed."""
        if not values:
            raise InputError("settings: none is given")
        self._limited(values)
        for setting, joint, value in self._of_drives(values):
            if setting.shared != (joint is None):
                raise unknown("setting", setting.key if joint is None else f"{joint}.{setting.key}", [setting.key])
            setting.check(value)

    def write(self, session: Session, values: Mapping[str, float]) -> None:
        """Write settings to the board and change the limits; raises as `check` and `DriveSetting.write`."""
        self.check(values)
        robot = self._limited(values)
        for setting, joint, value in self._of_drives(values):
            setting.write(session, value, joint)
        self.robot = session.robot = robot
        self.read(session)

    def _limits(self) -> Iterator[Setting]:
        for joint in self.robot.joints:
            for field, title in _LIMITS.items():
                lower, upper, unit = self._range(joint.name, field)
                value = getattr(joint, field)
                key = f"{joint.name}.{field}"
                yield Setting(key, joint.name, title, unit, value, lower, upper, (), stored=False)

    def _range(self, name: str, field: str) -> tuple[float, float, str]:
        """Return the allowed range of a joint's limit, with its unit: no homing is faster than its joint."""
        joint = self.file.joint(name)
        if field == "speed_max":
            lower = joint.homing.search_speed if joint.homing else joint.speed_max / 1000
            return lower, joint.speed_max, f"{joint.unit}/s"
        return joint.lower, joint.upper, str(joint.unit)

    def _limited(self, values: Mapping[str, float]) -> Robot:
        """Return the robot with other limits; raise InputError if they are looser than the file's or contradictory."""
        joints = {joint.name: joint for joint in self.robot.joints}
        for key, value in values.items():
            name, field = self._split(key)
            if name is not None and field in _LIMITS:
                lower, upper, _ = self._range(name, field)
                _check_within(key, value, lower, upper, str(joints[name].unit))
                stricter: dict[str, Any] = {field: value}
                joints[name] = replace(joints[name], **stricter)
        return replace(self.robot, joints=tuple(joints.values()))

    def _of_drives(self, values: Mapping[str, float]) -> Iterator[tuple[DriveSetting, str | None, float]]:
        """Yield the board's settings among `values`, each with its joint, or None, and its value."""
        for key, value in values.items():
            joint, field = self._split(key)
            if field not in _LIMITS:
                yield drive_setting(field, self.file), joint, value

    def _split(self, key: str) -> tuple[str | None, str]:
        joint, dot, field = key.rpartition(".")
        if not dot:
            return None, key
        (self.file.index_of if field in _LIMITS else self.file.axis_index)(joint)
        return joint, field


def _of_board(session: Session) -> Iterator[Setting]:
    for each in drive_settings(session.robot):
        joints: tuple[str | None, ...] = (None,) if each.shared else session.robot.axis_names
        for joint, value in zip(joints, each.read(session), strict=False):
            key = each.key if joint is None else f"{joint}.{each.key}"
            yield Setting(key, joint, each.title, each.unit, value, each.lower, each.upper, each.choices, stored=True)


def _check_within(key: str, value: float, lower: float, upper: float, unit: str) -> None:
    if not lower <= value <= upper:
        raise InputError(f"{key}: {outside(value, lower, upper, unit)}{nearest_within(value, lower, upper, unit)}")
