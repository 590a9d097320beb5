"""Read and write what a board keeps for its drives: the parts of the current, and the limits of its measurements."""

from dataclasses import dataclass
from typing import Final

from steptwin.host.common.bad_input import nearest_within, outside, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import Session
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
