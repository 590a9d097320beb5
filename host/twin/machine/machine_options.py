"""Options of an emulated machine: its differences from the robot's file, and operations on it.

Each option is defined here once. Command options, arguments of functions and fixtures, and docs/robot-files.md
derive from it. This module imports little, since `steptwin --help` reads it.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypedDict, cast

from steptwin.host.common.bad_input import prefixed, shortened, unknown
from steptwin.host.common.choices import check_bitrate, name_value_pairs
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.numbers import digits_in, finite_number, whole

if TYPE_CHECKING:
    from steptwin.emulator.board.board_firmware import BoardProgram
    from steptwin.host.robots.robot import Robot
    from steptwin.protocol.drivers import DriverProfile


class Spelling(NamedTuple):
    """Spelling of an option on the command line and in Python, and its description.

    Attributes:
        key: its key on the command line, as in `--machine KEY=VALUE`.
        value: placeholder of its value there; empty for a switch.
        example: a value in Python.
        says: its effect.
        read: converts its text, or the list of texts if the option is repeatable.
        repeatable: True if the option may be repeated.
        served: True if the command line has it for served boards only.
    """

    key: str
    value: str
    example: str
    says: str
    read: Callable[[Any], Any] = lambda text: text
    repeatable: bool = False
    served: bool = False


SPELLING: Final = "spelling"
"""Key of a field's spelling in its metadata."""
OF_FEATURES: Final = "of_features"
"""Key, in a field's metadata, of the attribute of features with the classes of its objects."""


Standing = Sequence[float] | Mapping[str, float]
"""Positions of all joints, or of some by name, in mm and degrees."""


def _positions(text: str) -> list[float]:
    with prefixed(f"stand_at={text}: "):
        return [finite_number(word) for word in text.split()]


def _microsteps(texts: list[str]) -> dict[str, int]:
    settings: dict[str, int] = {}
    for name, text in name_value_pairs(texts).items():
        microsteps = digits_in(text)
        if microsteps is None:
            shown = shortened(text)
            raise InputError(f"dip_microsteps={name}={shown}: {shown!r} is not a whole number")
        settings[name] = microsteps
    return settings


_COUNT: Final = re.compile(r"\s*[0-9]{1,4}\s*")


def read_axes_per_board(text: str) -> list[int]:
    """Return the number of axes of each board from a text such as `4,2`; raise InputError for another form."""
    words = text.split(",")
    if not all(map(_COUNT.fullmatch, words)):
        raise InputError(f"axes_per_board={text}: does not list the axes of each board, as in 4,2")
    return [int(word) for word in words]


def read_crystals(text: str) -> list[int]:
    """Return the parts per million of each board from a text such as `100,-100`; raise InputError for another form."""
    try:
        return [int(word) for word in text.split(",")]
    except ValueError:
        raise InputError(f"crystal_ppm={text}: is not a whole number of ppm for each board, as in 100,-100") from None


def _bits_per_s(text: str) -> int:
    try:
        return whole(text)
    except ValueError:
        raise InputError(f"bitrate={text}: is not a whole number of bit/s") from None


class MachineKeywords(TypedDict, total=False):
    """The fields of `MachineOptions`, as keyword arguments of the functions that users call."""

    stand_at: Standing | None
    driver_profile: str | None
    dip_microsteps: Mapping[str, int] | None
    axes_per_board: Sequence[int] | None
    crystal_ppm: int | Sequence[int]
    bitrate: int | None
    extras: Sequence[Any]


_STANDING = Spelling(
    key="stand-at",
    value="'Q1 Q2 ...'",
    example='{"th2": 10.0}',
    says="Joints where the machine stands, in mm and degrees; by default its home, or where the motion or the recording"
    " begins.",
    read=_positions,
)
_DRIVERS = Spelling(
    key="driver-profile",
    value="NAME",
    example='"3a-module"',
    says="Put other drivers on the emulated board, unknown to planner and firmware (docs/driver.md): chip-100pf,"
    " chip-330pf, chip-1000pf, 3a-module, slow-blue-board, a4988, drv8825, a3967, tmc2209, tmc5160, dm542, dm542t,"
    " tb6600; generic is that of the file's [board.driver]. They have their usual settings instead of the robot file's"
    " current_a and the like.",
)
_DIP = Spelling(
    key="dip-microsteps",
    value="JOINT=N",
    example='{"th2": 8}',
    says="Set the switches M1 and M2 of a joint's driver module to other microsteps than the robot file's; repeatable.",
    read=_microsteps,
    repeatable=True,
)
_BOARDS = Spelling(
    key="boards",
    value="N,N,...",
    example="[4, 2]",
    says="Axes on each board, in the joints' order; by default one board has all.",
    read=read_axes_per_board,
)
_CRYSTAL = Spelling(
    key="crystal",
    value="PPM,...",
    example="[100, -100]",
    says="How fast each board's crystal is, from -1000 to 1000 parts per million.",
    read=read_crystals,
)


_BITRATE = Spelling(
    key="bitrate",
    value="BIT/S",
    example="500_000",
    says="Bit rate of the bus; by default the robot file's.",
    read=_bits_per_s,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineOptions:
    """An emulated machine; neither the plan nor the host knows these options.

    The spelling of each describes it. In Python, joints may be given by name, with the others at home. One number for
    the crystals is that of each board, and none means that all are exact. `extras` has at most one options object of
    each feature.
    """

    stand_at: Standing | None = field(default=None, metadata={SPELLING: _STANDING})
    driver_profile: str | None = field(default=None, metadata={SPELLING: _DRIVERS})
    dip_microsteps: Mapping[str, int] | None = field(default=None, metadata={SPELLING: _DIP})
    axes_per_board: Sequence[int] | None = field(default=None, metadata={SPELLING: _BOARDS})
    crystal_ppm: int | Sequence[int] = field(default=0, metadata={SPELLING: _CRYSTAL})
    bitrate: int | None = field(default=None, metadata={SPELLING: _BITRATE})
    extras: Sequence[Any] = field(default=(), metadata={OF_FEATURES: "machine_options"})

    @property
    def keywords(self) -> MachineKeywords:
        """The options as keyword arguments."""
        return cast(MachineKeywords, {each.name: getattr(self, each.name) for each in fields(self)})

    def over(self, other: "MachineOptions") -> "MachineOptions":
        """Return `other`, with the values of this object that are not defaults in place of its own."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        del given["extras"]
        changed = {name: value for name, value in given.items() if value != getattr(AS_FILED, name)}
        return replace(other, **changed, extras=merged(self.extras, other.extras))

    @property
    def crystals_ppm(self) -> tuple[int, ...]:
        """Deviation of each board's crystal, in parts per million; empty: all are exact."""
        if isinstance(self.crystal_ppm, int):
            return (self.crystal_ppm,) * len(self.axes_per_board or (1,))
        return tuple(self.crystal_ppm)

    def joints(self, robot: "Robot") -> list[float]:
        """Return the positions of all joints in mm and degrees; joints without one are at the robot's home.

        Raises:
            InputError: the number of positions is wrong, or a joint does not exist.
        """
        at = dict(zip(robot.joint_names, robot.home, strict=True))
        if self.stand_at is None:
            return list(at.values())
        if not isinstance(self.stand_at, Mapping):
            if len(self.stand_at) != len(at):
                raise InputError(f"stand_at: {len(self.stand_at)} values for the {len(at)} joints {' '.join(at)}")
            return list(self.stand_at)
        for name, position in self.stand_at.items():
            if name not in at:
                raise unknown("stand_at: joint", name, at)
            at[name] = position
        return list(at.values())

    def bits_per_s(self, robot: "Robot") -> int:
        """Return the bit rate of the bus; raise InputError for an impossible one."""
        bitrate = robot.board.bitrate if self.bitrate is None else self.bitrate
        check_bitrate(bitrate, f"bitrate={bitrate}:")
        return bitrate

    def boards_of(self, robot: "Robot") -> tuple[int, ...]:
        """Return the number of axes on each board.

        Raises:
            InputError: the boards' axes do not match the robot's, or a crystal is too far off.
        """
        from steptwin.host.twin.machine.boards import check_axes_per_board, check_crystals

        per_board = (len(robot.axes),) if self.axes_per_board is None else tuple(self.axes_per_board)
        check_axes_per_board(per_board, len(robot.axes))
        check_crystals(self.crystals_ppm, len(per_board))
        return per_board

    def check_features(self, *, real_time: bool = False) -> None:
        """Raise InputError if a feature's options exclude others, in real time or not."""
        for feature, check in giving("check_machine"):
            check(self, feature.options_in(self.extras), real_time)

    def warnings(self, robot: "Robot", drivers: "DriverProfile") -> dict[str, list[str]]:
        """Return the warnings of features about a machine with these drivers, by name."""
        return {
            feature.name: list(warnings(robot, drivers, feature.options_in(self.extras)))
            for feature, warnings in giving("machine_warnings")
        }

    def program(self) -> "Callable[[], BoardProgram] | None":
        """Return a function that creates each board's program in place of our firmware; None without one.

        Raises:
            InputError: the program is not available, or two are given.
        """
        made = {feature.name: make(feature.options_in(self.extras)) for feature, make in giving("program")}
        programs = {name: program for name, program in made.items() if program is not None}
        if len(programs) > 1:
            raise InputError(f"{' and '.join(programs)}: each gives the board's program: leave one of them out")
        return next(iter(programs.values()), None)


def read_extras(extras: Sequence[Any], robot: "Robot", folder: Path = Path()) -> tuple[Any, ...]:
    """Return the options of features with their files read; relative paths begin at a folder.

    Raises:
        InputError: a file is unreadable or does not fit the robot.
    """
    read = list(extras)
    for feature, reading in giving("read_options"):
        options = feature.options_in(extras)
        read = [reading(each, robot, folder) if each is options else each for each in read]
    return tuple(read)


def merged(extras: Sequence[Any], others: Sequence[Any]) -> tuple[Any, ...]:
    """Return the options of features in both sequences; values of the first one take precedence."""
    found = {type(each): each for each in others}
    for each in extras:
        found[type(each)] = each.over(found[type(each)]) if type(each) in found else each
    return tuple(found.values())


AS_FILED: Final = MachineOptions()
"""A machine as in its robot's file."""
