"""The drives along a path: what their torques allow, as rows for the loop of `timed`, and what they say of a motion.

A motor is the emulator's. So who knows the motors hands them in (`host/planning/drives.py`).
"""

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from steptwin.features.fastest.rows import Rows
from steptwin.features.fastest.shaper import Shaper
from steptwin.host.common.arrays import BoolArray, FloatArray
from steptwin.host.planning.drives import DriveAnswer
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.sampled import Spline


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
class DriveTrial:
    """What the rotors did in a motion: why it is refused, empty if they keep step, and what they say of it."""

    refused: str
    answer: DriveAnswer


class DrivesOnPath(Protocol):
    """The drives along a path."""

    @property
    def average_s(self) -> float:
        """Time over which a motion is averaged."""
        ...

    @property
    def shaper(self) -> Shaper:
        """What shapes it in addition, so that the arm does not swing on its motors."""
        ...

    def smoother(self, factor: float) -> Self:
        """Return the same drives with motions that are averaged and shaped over so much more time."""
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

    def used(self, cubics: Spline, s: FloatArray) -> FloatArray:
        """Return how much of its torque each drive uses on cubics, shape (records, axes); 1: all it may.

        `s`, of shape (records + 1,), are the places where they begin and end.
        """
        ...

    def tried(self, motion: Motion, s: FloatArray) -> DriveTrial:
        """Turn the rotors by the motion, and by a faster one."""
        ...
