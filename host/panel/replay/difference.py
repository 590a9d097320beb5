"""Two runs of one robot side by side, from the start of each motion: how far their machines are apart."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.panel.replay.model import Replay
from steptwin.host.robots.kinematics.planar2r import wrapped_deg

INSTANTS: Final = 4001


@dataclass(frozen=True, slots=True)
class Apart:
    """The second run minus the first at an instant: counted joints by name, and the tool.

    Attributes:
        joints: difference of each joint, in its unit.
        tool_mm: distance of the tools.
        attitude_deg: difference of the attitudes, in (-180, 180].
    """

    joints: dict[str, float]
    tool_mm: float
    attitude_deg: float


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The distance of the two tools over time: shapes (n,)."""

    t_s: FloatArray
    tool_mm: FloatArray

    @property
    def largest_at_s(self) -> float:
        """When the tools are furthest apart."""
        return float(self.t_s[self.tool_mm.argmax()])


class RunPair:
    """Two runs at the same time of their motions; raises InputError unless both are of one mechanism."""

    def __init__(self, first: Replay, second: Replay) -> None:
        for what in ("joint_names", "kinematics", "geometry"):
            values = [getattr(replay.run.robot, what) for replay in (first, second)]
            if values[0] != values[1]:
                names = [replay.run.report.run.robot for replay in (first, second)]
                raise InputError(f"{names[1]}: is another machine than {names[0]}: two runs of one can be compared")
        self.first, self.second = first, second

    def at(self, t_s: float) -> Apart:
        """Return how far the machines are apart at a time of both motions; after its end a machine stands still."""
        instant_s = np.array([t_s])
        joints = [replay.machine.counted_joints(instant_s)[0] for replay in (self.first, self.second)]
        poses = [replay.machine.counted_poses(instant_s) for replay in (self.first, self.second)]
        apart = dict(zip(self.first.run.robot.joint_names, (joints[1] - joints[0]).tolist(), strict=True))
        off = poses[1] - poses[0]
        return Apart(apart, float(np.linalg.norm(off[0, :3])), float(wrapped_deg(off[:, 3])[0]))

    @cached_property
    def course(self) -> Course:
        """The distance of the tools over the longer of the motions, at INSTANTS instants."""
        t_s = np.linspace(0.0, max(self.first.run.duration_s, self.second.run.duration_s), INSTANTS)
        first, second = (replay.machine.counted_poses(t_s)[:, :3] for replay in (self.first, self.second))
        return Course(t_s, np.linalg.norm(second - first, axis=1))
