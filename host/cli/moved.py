"""Print where a move or a step of a live board has ended."""

from dataclasses import asdict
from typing import TYPE_CHECKING

from steptwin.host.cli.output import fixed, pose_text, print_json, say

if TYPE_CHECKING:
    from steptwin.host.operate.moving import Moved
    from steptwin.host.robots.robot import Robot


def print_moved(robot: "Robot", moved: "Moved", pose: dict[str, float] | None, *, as_json: bool) -> None:
    """Print the joints at the end, and the tool's pose if it is known; with JSON also start, goal and duration."""
    names = robot.joint_names
    if as_json:
        figures = {
            key: dict(zip(names, value, strict=True)) if isinstance(value, list) else value
            for key, value in asdict(moved).items()
        }
        print_json({"robot": robot.name, **figures, "pose": pose})
        return
    say(", ".join(f"{name} {fixed(position)}" for name, position in zip(names, moved.end, strict=True)))
    if pose is not None:
        say(pose_text(pose))
