"""Turn changes of output pins into changes of the outputs that a robot's file names."""

from collections.abc import Sequence

from steptwin.host.robots.robot import Robot
from steptwin.host.verify import AxisEvidence, OutputChange


def output_changes(robot: Robot, axes: Sequence[AxisEvidence]) -> tuple[OutputChange, ...]:
    """Return every change of the robot's outputs in order of time; pins without a named output are left out."""
    pins = {axis.name: axis.pins for axis in axes}
    changes = [
        OutputChange(name, counts, level)
        for name, output in robot.outputs.items()
        for edges in [pins[output.joint][f"out{output.out}"]]
        for counts, level in zip(edges.counts.tolist(), edges.levels.tolist(), strict=True)
    ]
    return tuple(sorted(changes, key=lambda change: change.counts))
