"""`steptwin fk ROBOT Q1 Q2 ...` and `ik ROBOT --x --y --z --phi`: forward and inverse kinematics."""

from dataclasses import MISSING, asdict, dataclass
from math import hypot, isfinite, isnan, nan
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import (
    OrientationOptions,
    RobotAndJoints,
    RobotName,
    RobotOptions,
    finite_number,
    joint_values,
)
from steptwin.host.cli.options import option, switch
from steptwin.host.cli.output import fixed, pose_words, print_table, say
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from steptwin.host.common.arrays import FloatArray
    from steptwin.host.robots.kinematics import Branch, Kinematics
    from steptwin.host.robots.poses import Orientation, Pose
    from steptwin.host.robots.robot import Robot


_COLUMNS: Final = ("n", "o", "a", "p")


def matrices_document(kinematics: "Kinematics", joints: "FloatArray") -> dict[str, Any]:
    """Return the DH table with its values and matrices at joints of shape (1, joints); matrices are lists of rows."""
    from steptwin.host.robots.kinematics.base import link_frames, tool_frames
    from steptwin.host.robots.poses.base_frame import STATION

    variables = kinematics.dh_variables(joints)
    links = [
        {
            "alpha_deg": float(row.alpha_deg),
            "a_mm": float(row.a_mm),
            "d_mm": float(row.d_mm.values(variables).item()),
            "theta_deg": float(row.theta_deg.values(variables).item()),
            "d": str(row.d_mm),
            "theta": str(row.theta_deg),
            "matrix": _plain(frame[0]),
        }
        for row, frame in zip(kinematics.dh.rows, link_frames(kinematics, joints), strict=True)
    ]
    product = tool_frames(kinematics, joints)[0]
    axes = {name: _plain(product[:3, column]) for column, name in enumerate(_COLUMNS)}
    base = kinematics.dh.base
    return {
        **({} if base == STATION else {"base": {**asdict(base), "matrix": _plain(base.matrix)}}),
        "convention": kinematics.dh.convention.value,
        "links": links,
        "product": {"matrix": _plain(product), **axes},
    }


def print_matrices(document: dict[str, Any]) -> None:
    """Print the table, then three rows of each matrix; the fourth is always 0 0 0 1."""
    links = document["links"]
    modified = document["convention"] == "modified"
    start = "base" if "base" in document else "world"
    say(f"DH table, {'modified (Craig, proximal)' if modified else 'standard (distal)'}, from the {start} to the tool:")
    place = "i-1" if modified else "i"
    names = [f"alpha_{place} deg", f"a_{place} mm", "d_i mm", "theta_i deg"]
    keys = ("alpha_deg", "a_mm", "d_mm", "theta_deg")
    rows = [
        [str(i), link["d"], link["theta"], *(fixed(link[key]) for key in keys)] for i, link in enumerate(links, start=1)
    ]
    print_table(["i", "d_i", "theta_i", *names], rows, text_columns=3)
    of_base = "S_0T, the base in the station, " if "base" in document else ""
    whole = f"their product from the {'station' if of_base else 'world'} to the tool"
    say("", f"{of_base}matrix of each link, and T, {whole}; each has a fourth row 0 0 0 1:")
    base = {"S_0T": document["base"]["matrix"]} if "base" in document else {}
    of_links = {f"T{i}": link["matrix"] for i, link in enumerate(links, start=1)}
    matrices = base | of_links | {"T": document["product"]["matrix"]}
    rows = [
        [name if axis == 0 else "", "xyz"[axis], *(fixed(element, 6) for element in matrix[axis])]
        for name, matrix in matrices.items()
        for axis in range(3)
    ]
    print_table(["", "", *_COLUMNS], rows, text_columns=2)


def _plain(array: "FloatArray") -> Any:
    """Return nested lists, without negative zeros."""
    return (array + 0.0).tolist()


@command("ar4-mk3 0 0 0 0 45 0 --matrices", "corexy-gantry 100 80 50 --json", negatives=True)
def fk(
    which: RobotOptions,
    words: RobotAndJoints = None,
    matrices: bool = switch("Also the DH table, the matrix of each link and their product."),
) -> None:
    """Compute the tool's pose from joint positions (forward kinematics).

    If the robot's file states errors of its DH parameters, also say where the tool really is.
    """
    import numpy as np

    from steptwin.host.robots.kinematics import make_kinematics
    from steptwin.host.robots.kinematics.chain import actual_chain

    loaded, values = which.robot_and_joints(words)
    for joint, value in zip(loaded.joints, values, strict=True):
        if not joint.lower <= value <= joint.upper:
            limits = f"{joint.lower:g}..{joint.upper:g} {joint.unit}"
            say(f"note: {joint.name} = {value:g} is outside its limits {limits}", err=True)
    kinematics = make_kinematics(loaded)
    if not kinematics.task.width:
        raise InputError(f"{loaded.name} has no tool: its joints have positions, but no pose")
    pose = kinematics.forward(np.array([values]))[0]
    if not np.isfinite(pose).all():
        at = " ".join(f"{value:g}" for value in values)
        raise InputError(f"joints of {loaded.name}: the mechanism cannot be assembled at {at}")
    document: dict[str, Any] = {
        "joints": dict(zip(loaded.joint_names, values, strict=True)),
        "pose": kinematics.task.document(pose),
    }
    chain = actual_chain(loaded)
    if chain:
        actual = chain.poses(np.array([values]))[0]
        document["actual_pose"] = kinematics.task.document(actual)
        document["actual_tilt_deg"] = float(chain.tilts_deg(np.array([values]))[0])
        document["position_error_mm"] = float(np.linalg.norm(actual[:3] - pose[:3]))
    if matrices:
        document["dh"] = matrices_document(kinematics, np.array([values]))
    in_words = [pose_words(document["pose"], 6, "attitude deg")]
    if chain:
        off = f"{document['position_error_mm']:.6f} mm away, tilted by {document['actual_tilt_deg']:.6f} deg"
        actually = pose_words(document["actual_pose"], 6, "attitude deg")
        in_words += [f"actual: {actually}", f"{off}, by the dh_errors of the robot's file"]
    tables = ("", lambda: print_matrices(document["dh"])) if matrices else ()
    which.tell_of(loaded, document, *in_words, *tables)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceOptions:
    """Options for the tool's place, and its attitude if that is a single angle."""

    x: float = option("MM", "Tool position x.", default=MISSING, read=finite_number)
    y: float = option("MM", "Tool position y.", default=MISSING, read=finite_number)
    z: float = option("MM", "Tool position z.", default=MISSING, read=finite_number)
    phi: float | None = option("DEG", "Tool attitude; may be left out if it follows from the arm.", read=finite_number)

    @property
    def coordinates(self) -> dict[str, float]:
        """The given coordinates, by name."""
        return {"x": self.x, "y": self.y, "z": self.z} | ({} if self.phi is None else {"phi": self.phi})


@command("ar4-mk3 --x 300 --y 0 --z 250 --rpy '180 0 180'", "corexy-gantry --x 100 --y 80 --z 50")
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
    """Return the requested pose; raise InputError if it is incomplete, or not one of this tool."""
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
    """Distance of a branch's forward kinematics from the requested pose; NaN without joints."""

    position_mm: float
    attitude_deg: float


def _round_trip(kinematics: "Kinematics", branch: "Branch", pose: "Pose") -> _RoundTrip:
    """Return a branch's round trip; the attitude of a tool that does not turn by itself is left out."""
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
    """Return four decimals; a dash for an unreachable pose."""
    return fixed(value) if isfinite(value) else "-"


def _finite(value: float) -> float | None:
    """Return None for the joints of an unreachable pose: JSON has no NaN."""
    return value if isfinite(value) else None
