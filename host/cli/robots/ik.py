"""`steptwin ik ROBOT --x --y --z --phi`: compute all joint positions that reach a tool pose."""

from dataclasses import MISSING, dataclass
from math import hypot, isfinite, isnan, nan
from typing import TYPE_CHECKING, Any, NamedTuple

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import RobotName, RobotOptions, finite_number, joint_values
from steptwin.host.cli.options import option
from steptwin.host.cli.orientation_options import OrientationOptions
from steptwin.host.cli.output import fixed, print_table, say
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from steptwin.host.robots.kinematics import Branch, Kinematics
    from steptwin.host.robots.poses import Orientation, Pose
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceOptions:
    """The options that say where the tool is to be, and its attitude if a single angle tells it."""

    x: float = option("MM", "Tool position x.", default=MISSING, read=finite_number)
    y: float = option("MM", "Tool position y.", default=MISSING, read=finite_number)
    z: float = option("MM", "Tool position z.", default=MISSING, read=finite_number)
    phi: float | None = option("DEG", "Tool attitude; may be left out if it follows from the arm.", read=finite_number)

    @property
    def coordinates(self) -> dict[str, float]:
        """The coordinates that are given, by name."""
        return {"x": self.x, "y": self.y, "z": self.z} | ({} if self.phi is None else {"phi": self.phi})


@command("teaching-scara --x 150 --y 60 --z -60 --phi 30", "hybrid-arm --x 350 --y 150 --z 500 --phi 0")
def ik(
    place: PlaceOptions,
    turned: OrientationOptions,
    which: RobotOptions,
    robot: RobotName = None,
    near: str | None = option("'Q1 Q2 ...'", "Present joints: those that the pose leaves free stay there."),
) -> None:
    """Compute joint positions from a tool pose (inverse kinematics): every branch, and why one is out of reach.

    Exit code 1: no branch reaches the pose.
    """
    import numpy as np

    from steptwin.host.robots.kinematics import make_kinematics
    from steptwin.host.robots.workspace.nearest_pose import nearest_pose, passing_words

    loaded = which.robot(robot)
    kinematics = make_kinematics(loaded)
    pose = _pose(loaded, kinematics, place.coordinates, turned.orientation())
    standing = None if near is None else np.array(joint_values(near.split(), loaded.joint_names, "--near"))
    branches = kinematics.inverse(np.array([pose]), standing)
    reached = any(branch.reachable[0] for branch in branches)
    slides_at = np.zeros(len(loaded.joints)) if standing is None else standing
    nearest = None if reached else nearest_pose(loaded, pose, slides_at)
    trips = [(branch, _round_trip(kinematics, branch, pose)) for branch in branches]
    listed = [_document(branch, loaded.joint_names, trip) for branch, trip in trips]
    which.tell_of(
        loaded,
        {"branches": listed} | ({} if reached else {"nearest": nearest and _pose_document(kinematics, nearest)}),
        lambda: _print_branches(branches, loaded.joint_names),
        lambda: _print_round_trips({branch.name: trip for branch, trip in trips if branch.reachable[0]}),
        *([f"the nearest pose in reach: {passing_words(kinematics.task, pose, nearest)}"] if nearest else []),
    )
    end_unless(reached)


def _pose(
    robot: "Robot", kinematics: "Kinematics", place: dict[str, float], orientation: "Orientation | None"
) -> "Pose":
    """Return the pose that is asked for; raise InputError unless it is one that the tool can be told, and whole."""
    from steptwin.host.robots.poses import DIRECTION_TASK

    task = kinematics.task
    if not task.width:
        raise InputError(f"{robot.name} has no tool: its joints have positions, but no pose")
    task.check(place, orientation)
    if "phi" in task.coordinates and "phi" not in place and not kinematics.attitude_follows:
        raise InputError(f"--phi is missing: the tool of {robot.name} turns")
    if not task.is_flat and orientation is None:
        options = "--direction 'X Y Z'" if task is DIRECTION_TASK else "--rpy 'R P Y', --quaternion, --rotvec or --abc"
        raise InputError(f"the orientation is missing: {options}")
    return task.changed((nan,) * task.width, place, orientation)


def _print_branches(branches: "Sequence[Branch]", names: tuple[str, ...]) -> None:
    rows = [
        [branch.name, "yes" if branch.reachable[0] else "no", *map(_figure, branch.joints[0].tolist())]
        for branch in branches
    ]
    print_table(["branch", "reachable", *names], rows, text_columns=2)
    for branch in branches:
        if not branch.reachable[0]:
            say(f"{branch.name}: {branch.reason(0)}")


class _RoundTrip(NamedTuple):
    """The distance of the forward kinematics of a branch from the pose asked for; NaN where there are no joints."""

    position_mm: float
    attitude_deg: float


def _round_trip(kinematics: "Kinematics", branch: "Branch", pose: "Pose") -> _RoundTrip:
    """Return a branch's round trip; the attitude of a tool that does not turn by itself is its own."""
    import numpy as np

    reached, wanted = kinematics.forward(branch.joints)[0], np.array(pose)
    off_deg = 0.0 if isnan(pose[-1]) else abs(float(kinematics.task.off_deg(reached, wanted)))
    return _RoundTrip(hypot(*(reached - wanted)[:3].tolist()), off_deg)


def _print_round_trips(trips: dict[str, _RoundTrip]) -> None:
    if trips:
        texts = (
            f"{name} {fixed(off.position_mm, 9)} mm {fixed(off.attitude_deg, 9)} deg" for name, off in trips.items()
        )
        say(f"round trip, forward kinematics minus the pose: {', '.join(texts)}")


def _document(branch: "Branch", names: tuple[str, ...], off: _RoundTrip) -> dict[str, Any]:
    return {
        "name": branch.name,
        "reachable": bool(branch.reachable[0]),
        "reason": branch.reason(0),
        "joints": dict(zip(names, map(_finite, branch.joints[0].tolist()), strict=True)),
        "round_trip": {"position_error_mm": _finite(off.position_mm), "attitude_error_deg": _finite(off.attitude_deg)},
    }


def _pose_document(kinematics: "Kinematics", pose: "Pose") -> dict[str, Any]:
    return {
        key: _finite(value) if isinstance(value, float) else value
        for key, value in kinematics.task.document(pose).items()
    }


def _figure(value: float) -> str:
    """Return four decimals; a dash where no joint position reaches the pose."""
    return fixed(value) if isfinite(value) else "-"


def _finite(value: float) -> float | None:
    """Return None for the joints of a pose out of reach: JSON has no NaN."""
    return value if isfinite(value) else None
