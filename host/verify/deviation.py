"""Compute the deviation of the counted motion from the planned one, in steps, millimetres and degrees.

Between two edges the counters are constant. So an error is largest just before an edge, just after one, or at a turning
point of the planned motion: these instants and both ends of the motion give the largest error of all.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify.comparison import Comparison, Expectation, Forward

INSTANTS_PER_CHUNK = 16_384
"""Number of instants evaluated at once; it bounds the memory for any number of steps."""


@dataclass(frozen=True, slots=True)
class ToolDeviation:
    """Deviation of the tool from the planned poses, just before and just after n edges.

    Attributes:
        position_mm: shape (2, n, 3), in x, y and z.
        attitude_deg: shape (2, n), the angle between the orientations; of a SCARA in (-180, 180].
    """

    position_mm: FloatArray
    attitude_deg: FloatArray

    @property
    def distance_mm(self) -> FloatArray:
        """Distance from the planned position, shape (2, n)."""
        x_mm, y_mm, z_mm = np.moveaxis(self.position_mm, -1, 0)
        distance: FloatArray = np.sqrt(x_mm**2 + y_mm**2 + z_mm**2)
        return distance


@dataclass(frozen=True, slots=True)
class Deviation:
    """Counted minus planned at n instants, each just before (index 0) and just after (index 1) an edge.

    Attributes:
        t_s: shape (n,), the instants in the trajectory's time.
        steps: shape (2, n, axes), the driver's count minus the planned axis position in steps.
        skews: shape (2, n, second motors), lead of each over its joint's own motor, in mm or degrees.
        tool: deviation of the nominal tool at the counted joints; None without a tool.
        actual_tool: deviation of the actual tool at the counted joints; None if the robot's file has no errors.
    """

    t_s: FloatArray
    steps: FloatArray
    skews: FloatArray
    tool: ToolDeviation | None
    actual_tool: ToolDeviation | None = None


def critical_instants(comparison: Comparison) -> FloatArray:
    """Return the sorted instants of every accepted edge, every planned turning point, the start and the end."""
    times = [axis.time_s for axis in comparison.counted] + [axis.turning_s for axis in comparison.ideal]
    return np.unique(np.concatenate([*times, [0.0, comparison.expected.motion.duration_s]]))


def deviations(comparison: Comparison, t_s: FloatArray) -> Iterator[Deviation]:
    """Yield the deviations at sorted instants, chunk by chunk; the planned motion is constant after its end."""
    for first in range(0, len(t_s), INSTANTS_PER_CHUNK):
        yield _deviation(comparison, t_s[first : first + INSTANTS_PER_CHUNK])


def _deviation(comparison: Comparison, t_s: FloatArray) -> Deviation:
    """Compute one chunk; each joint's column is contiguous for speed."""
    expected = comparison.expected
    planned = np.asfortranarray(expected.motion.positions(np.minimum(t_s, expected.motion.duration_s)))
    planned_pose = expected.forward(planned)
    counts = np.stack([axis.around(t_s) for axis in comparison.counted]).transpose(1, 2, 0)
    joints = [expected.joints(side) for side in counts]
    return Deviation(
        t_s,
        counts - expected.axis_steps(planned),
        expected.skews(counts),
        _off(expected, planned_pose, expected.forward, joints) if expected.task.width else None,
        expected.actual_forward and _off(expected, planned_pose, expected.actual_forward, joints),
    )


def _off(
    expected: Expectation, planned_pose: FloatArray, forward: Forward, joints: Sequence[FloatArray]
) -> ToolDeviation:
    """Return the deviation of the tool at counted joints from the planned poses, before and after each edge."""
    poses = np.stack([forward(side) for side in joints])
    return ToolDeviation(poses[..., :3] - planned_pose[..., :3], expected.task.off_deg(poses, planned_pose))
