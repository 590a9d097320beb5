"""Compare numbers of a paper's page with literals, and misprints with what is right."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isnan
from typing import NamedTuple

import numpy as np
import pytest

from docs.generate.paper_pages import read_paper
from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots import load_robot
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.kinematics import Kinematics, make_kinematics
from steptwin.host.robots.kinematics.base import tool_frames
from steptwin.host.robots.robot import Robot


class Number(NamedTuple):
    """A number: its row on the page, if it has one, the literal that ours has to be, and how far off it may be."""

    item: str
    literal: float
    ours: Callable[[], float]
    tolerance: float = 1e-6


class Misprint(NamedTuple):
    """A formula of the paper as printed and as corrected, and what the robot's own model gives."""

    place: str
    printed: float
    corrected: float
    truth: Callable[[], float]
    tolerance: float = 1e-6


_COMPUTED = re.compile(r"(-?[\d.]+|no value)(?: \S+)? as printed, (-?[\d.]+)(?: \S+)? corrected")


@dataclass(frozen=True)
class Arm:
    """The robot of a paper."""

    name: str

    @cached_property
    def robot(self) -> Robot:
        return load_robot(self.name)

    @cached_property
    def kinematics(self) -> Kinematics:
        return make_kinematics(self.robot)

    @cached_property
    def joint(self) -> dict[str, Joint]:
        return {joint.name: joint for joint in self.robot.joints}

    def mm(self, key: str) -> float:
        """Return a dimension of the mechanism."""
        return float(self.robot.geometry[key])

    def frame(self, joints: Sequence[float]) -> FloatArray:
        """Return the tool's transform, as the product of the DH table's links."""
        return np.asarray(tool_frames(self.kinematics, np.array([joints]))[0])

    def pose(self, joints: Sequence[float]) -> FloatArray:
        return np.asarray(self.kinematics.forward(np.array([joints]))[0])

    def stepped(self, joints: FloatArray) -> FloatArray:
        """Return the joints at their nearest whole steps."""
        return self.robot.from_steps(np.floor(self.robot.to_steps(joints) + 0.5))

    def pulses(self, joints: FloatArray, name: str) -> int:
        """Return an axis' pulses if every sample is rounded to whole steps."""
        steps = np.floor(self.robot.to_steps(joints) + 0.5)[:, self.robot.joint_names.index(name)]
        return int(np.abs(np.diff(steps)).sum())

    def stepped_off_mm(self, joints: FloatArray) -> float:
        """Return the tool's largest distance from the samples with the joints in whole steps."""
        apart = self.kinematics.forward(self.stepped(joints)) - self.kinematics.forward(joints)
        return float(np.linalg.norm(apart[:, :3], axis=1).max())


def check_number(robot: str, number: Number) -> None:
    """Compare ours with the literal, and with what the page shows of it."""
    ours = number.ours()
    assert ours == pytest.approx(number.literal, rel=0, abs=number.tolerance)
    for row in read_paper(robot).rows:
        assert row.item != number.item or _shown_as(ours, row.ours.split()[0])


def check_misprint(robot: str, misprint: Misprint) -> None:
    """Only the corrected formula gives the truth, and the page shows both."""
    truth = misprint.truth()
    assert misprint.corrected == pytest.approx(truth, rel=0, abs=misprint.tolerance)
    assert not abs(misprint.printed - truth) <= misprint.tolerance
    (note,) = (row.note for row in read_paper(robot).rows if row.item == misprint.place)
    computed = misprint.printed, misprint.corrected
    assert any(all(map(_shown_as, computed, texts)) for texts in _COMPUTED.findall(note))


def _shown_as(value: float, text: str) -> bool:
    return text == ("no value" if isnan(value) else f"{value:z.{len(text.partition('.')[2])}f}")


def numbers_of_page(robot: str) -> set[str]:
    """Return the items of the rows that show a number of ours."""
    number = re.compile(r"-?\d[\d.]*( [^ ]+)?")
    rows = (row for row in read_paper(robot).rows if not row.note.startswith(("misprint", "left open")))
    return {row.item for row in rows if number.fullmatch(row.ours)}
