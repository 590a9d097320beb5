"""What limits a fastest motion besides its joints: the drives, as the machine's motors and masses allow.

Planning knows the limits of joints, but no motor: pull-out torques and rotors are the emulator's. So a caller that
knows the motors hands them in (`features/motors/limits`), and the loop of `timed` takes their torques as further rows.
Without them motions are within the joints' limits, and a program that asks for motors is refused.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np

from steptwin.features.fastest.rows import PathRates, Rows
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class LoadChange:
    """The payload is taken or left somewhere between two places of a path."""

    from_s: float
    until_s: float
    held: bool


@dataclass(frozen=True, slots=True)
class PathLoad:
    """When the payload hangs at the tool, by place on a path.

    Attributes:
        at_start: whether it hangs where the path begins.
        changes: in order of the places.
    """

    at_start: bool = False
    changes: tuple[LoadChange, ...] = ()

    def at(self, s: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return where the arm counts without it and where with it, of shape (n,); around a change, both."""
        with_it = np.full(len(s), self.at_start)
        without = ~with_it
        for change in self.changes:
            later = s > change.until_s
            around = ~later & (s >= change.from_s)
            with_it = np.where(later, change.held, with_it | around)
            without = np.where(later, not change.held, without | around)
        return without, with_it


@dataclass(frozen=True, slots=True)
class DriveAnswer:
    """What the drives say of a motion that they keep step with.

    Attributes:
        left_percent: least torque that is left at a steady speed, of all joints: the static margin.
        joint: the joint that has no more left.
        at_s: when, from the begin of the motion.
        load_deg: greatest load angle of a rotor, in electrical degrees.
        average_s: time over which the motion was averaged.
        slips_at: stretch of the motion, below 1, at which a rotor would slip; None if none does down to 0.5.
        tries: number of motions that were tried.
    """

    left_percent: float
    joint: str
    at_s: float
    load_deg: float
    average_s: float
    slips_at: float | None = None
    tries: int = 1

    def __str__(self) -> str:
        slips = "keep step at twice the pace" if self.slips_at is None else f"would slip at stretch {self.slips_at:.2f}"
        tries = "" if self.tries == 1 else f", the {self.tries}. that was tried"
        return (
            f"motors: {self.left_percent:.0f} % of {self.joint}'s torque is left at {self.at_s:.3f} s; rotors are at"
            f" most {self.load_deg:.0f} degrees behind and {slips}; averaged over {self.average_s:.3f} s{tries}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class DriveTrial:
    """What the rotors did in a motion: why it is refused, empty if they keep step, and what they say of it."""

    refused: str
    answer: DriveAnswer


class DrivesOnPath(Protocol):
    """The drives along a path."""

    @property
    def average_s(self) -> float:
        """Time over which a motion is averaged, so that the arm does not swing on its motors."""
        ...

    @property
    def axes(self) -> int:
        """Number of the drives."""
        ...

    def rows(self, squares: FloatArray, parts: FloatArray) -> Rows:
        """Return the drives' torques as rows at the path's places, about squares of the speed there, of shape (n,).

        `parts`, of shape (n, axes), lowers what each drive may add to the weight that it carries.
        """
        ...

    def used(self, motion: Sampled, s: FloatArray) -> FloatArray:
        """Return how much of its torque each drive uses on the motion's cubics, shape (records, axes); 1: all it may.

        `s`, of shape (records + 1,), are the places where they begin and end.
        """
        ...

    def tried(self, motion: Sampled, s: FloatArray, average_s: float) -> DriveTrial:
        """Turn the rotors by the motion, and by a faster one."""
        ...


class DriveLimits(Protocol):
    """The drives of a machine, and how much of their torque is to be left."""

    def left_more(self, percent: float) -> "DriveLimits":
        """Return the same with more percent left."""
        ...

    def along(self, rates: PathRates, load: PathLoad) -> DrivesOnPath:
        """Return the drives on a path; raise InputError, with the number, if weights alone need too much."""
        ...


MakeDrives = Callable[[Robot, float], DriveLimits]
"""Makes the drives' limits of a robot, of a percentage of the torque that is to be left; InputError without motors."""

LEFT_PERCENT: Final = 30.0
"""Torque that is usually left: what builders keep in hand for what a model does not know."""


def check_drives(drives: "DriveLimits | None", *, is_fastest: bool) -> None:
    """Raise InputError for drives that limit a motion by another law."""
    if drives is not None and not is_fastest:
        raise InputError("law=fastest is needed: the motors limit no other law")


@dataclass(frozen=True, slots=True)
class AskedLimits:
    """What a file asks for: motions as fast as the motors manage, with some of their torque left."""

    left_percent: float = LEFT_PERCENT

    def __post_init__(self) -> None:
        if not 0.0 <= self.left_percent <= 90.0:
            raise InputError(f"{self.left_percent:g} % is not from 0 to 90 %")

    def drives(self, robot: Robot, make: MakeDrives | None) -> DriveLimits:
        """Return the drives of a robot; raise InputError if nothing here knows them."""
        if make is None:
            raise InputError(
                "limits.from: 'motors': planning alone knows no motors; `steptwin run` and `check` do, and in Python"
                " `compile_program(program, robot, drives=motor_limits)`"
            ).plainly("limits: nothing here knows the motors")
        return make(robot, self.left_percent)
