"""What is wired to the board's outputs: from the pins of the axes to the outputs that a robot's file names."""

from collections.abc import Sequence

from steptwin.host.robots.robot import Robot
from steptwin.host.verify import AxisEvidence, OutputChange


def output_changes(robot: Robot, axes: Sequence[AxisEvidence]) -> tuple[OutputChange, ...]:
    """Every change of the robot's outputs in order of time; a pin that nothing is wired to is left out."""
    pins = {axis.name: axis.pins for axis in axes}
    changes = [
        OutputChange(name, counts, level)
        for name, output in robot.outputs.items()
        for edges in [pins[output.joint][f"out{output.out}"]]
        for counts, level in zip(edges.counts.tolist(), edges.levels.tolist(), strict=True)
    ]
    return tuple(sorted(changes, key=lambda change: change.counts))
