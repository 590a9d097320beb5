"""Make a robot file's chain from the joints of a URDF, with notes for its user.

m become mm and rad degrees. Fixed joints become part of the next frame: before the first moving joint that is the
chain's `base`, after the last one its `tool`. Rigid transforms become frames of robot files (place, roll, pitch and
yaw), without loss of accuracy.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, pi
from re import sub
from typing import Final

import numpy as np

from steptwin.features.urdf.urdf_tree import FIXED, MOVING, UrdfJoint, UrdfTree
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.robots.kinematics.serial.chain_geometry import Notation
from steptwin.host.robots.kinematics.serial.rows import FixedFrame
from steptwin.host.robots.poses.rotations import matrix
from steptwin.host.robots.robot import Dimension

_UPRIGHT: Final = 1e-14
"""Cosine of the pitch below which roll and yaw cannot be told apart; smaller values are rounding."""
_DECIMALS: Final = 12
"""Decimals of a frame's numbers; further ones are rounding errors of products."""
SNAPPED_RAD: Final = 2e-5
"""Largest distance from a multiple of 15 degrees for snapping: 1.5708 is 3.7e-6 from pi/2."""
_STEP_RAD: Final = pi / 12.0
_EXACT_RAD: Final = 1e-9
"""Distance below which an angle counts as exact: less than a nanometre on an arm of 1 m."""
_QUARTER_DEG: Final = 90.0
_QUARTER_OFF_DEG: Final = 0.1
"""Limits of 1.57 or 1.5708 on every joint are placeholders of exporters."""
_ENDLESS_DEG: Final = 180.0


def frame_of(transform: FloatArray) -> FixedFrame:
    """Return a transform of shape (4, 4) as a frame with that matrix, even near pitch 90.

    Roll and pitch are computed after the yaw is undone, so they fit any rounding of it.
    """
    turn = transform[:3, :3]
    upright = np.hypot(turn[0, 0], turn[1, 0]) < _UPRIGHT
    yaw = 0.0 if upright else float(np.arctan2(turn[1, 0], turn[0, 0]))
    c, s = np.cos(yaw), np.sin(yaw)
    rest = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ turn
    pitch, roll = np.arctan2(-rest[2, 0], rest[0, 0]), np.arctan2(-rest[1, 2], rest[1, 1])
    return FixedFrame(triple(transform[:3, 3].tolist()), triple(np.rad2deg([roll, pitch, yaw]).tolist()))


def triple(values: Iterable[float]) -> tuple[float, float, float]:
    """Return three numbers without rounding errors of products."""
    x, y, z = (round(value, _DECIMALS) + 0.0 for value in values)
    return x, y, z


@dataclass(frozen=True, slots=True)
class ChainMove:
    """A moving joint of the chain.

    Attributes:
        name: name in the robot file.
        kind: revolute, continuous or prismatic.
        lower: lowest position in mm or degrees; a continuous joint has a turn about 0.
        speed: highest speed in mm/s or degrees/s; infinite if the file has none above 0.
    """

    name: str
    kind: str
    lower: float
    upper: float
    speed: float


@dataclass(frozen=True, slots=True)
class UrdfChain:
    """A chain: dimensions for a robot file, joints, and notes for the user.

    Attributes:
        base: link at its start.
        tip: link at its end.
        geometry: keys of [kinematics].
        moves: the moving joints.
        notes: lines for the user to check.
    """

    base: str
    tip: str
    geometry: dict[str, Dimension]
    moves: tuple[ChainMove, ...]
    notes: tuple[str, ...]


def chain_of(tree: UrdfTree, base: str | None, tip: str | None, *, snap: bool) -> UrdfChain:
    """Return the chain between two links; None means the root, or the only leaf that needs no mimic.

    With `snap`, angles close to a multiple of 15 degrees become exact.

    Raises:
        InputError: with the joint, if one in the chain cannot have a motor of its own, or a number is invalid.
    """
    way = tree.way(base, tip)
    moving = [joint for joint in way if _is_moving(joint)]
    if not moving:
        ends = f"{way[0].parent!r} and {way[-1].child!r}" if way else "the root and itself"
        raise InputError(f"--tip: no joint moves between {ends}: take a link behind a revolute or prismatic joint")
    names, notes = _names(moving), []
    near = [joint.name for joint in way if any(map(_is_nearly, joint.rpy_rad))]
    if near:
        done = "are now exact" if snap else "--snap makes them exact"
        notes.append(f"angles within 2e-5 rad of multiples of 15 deg, at {_listed(near)}: {done}")
    if renamed := [f"{joint.name!r} is {name}" for joint, name in names.items() if joint.name != name]:
        notes.append(f"renamed, to letters, digits, - and _: {', '.join(renamed)}")
    moves = tuple(_move(joint, name) for joint, name in names.items())
    geometry = _geometry(way, names, _snapped if snap else float)
    return UrdfChain(way[0].parent, way[-1].child, geometry, moves, (*notes, *_notes_on_limits(moving, moves)))


def _is_moving(joint: UrdfJoint) -> bool:
    """Return whether a joint of the chain moves; raise InputError if it has no motor of its own."""
    if joint.kind not in (*MOVING, FIXED):
        raise InputError(
            f"joint {joint.name!r}: is of the type {joint.kind!r}, a chain has revolute, continuous, prismatic and"
            f" fixed joints: --base {joint.child} begins behind it, --tip {joint.parent} ends before it"
        )
    if joint.mimics:
        raise InputError(
            f"joint {joint.name!r}: follows {joint.mimics!r} (mimic), a chain's joints have a motor each:"
            f" --tip {joint.parent} ends before it"
        )
    return joint.kind != FIXED


def _names(moving: Sequence[UrdfJoint]) -> dict[UrdfJoint, str]:
    """Return the joints' names without characters that would end a name in a robot file."""
    names = {joint: sub(r"[^A-Za-z0-9_-]", "_", joint.name) for joint in moving}
    for joint, name in names.items():
        if list(names.values()).count(name) > 1:
            raise InputError(f"joint {joint.name!r}: another joint is called {name} in a robot file as well: rename it")
    return names


def _geometry(
    way: Sequence[UrdfJoint], names: dict[UrdfJoint, str], angle: Callable[[float], float]
) -> dict[str, Dimension]:
    """Return the keys of [kinematics]; `angle` converts angles in rad."""
    base: list[FixedFrame] = []
    fixed: list[FixedFrame] = []
    placed: dict[UrdfJoint, FixedFrame] = {}
    for joint in way:
        fixed.append(_frame(joint, angle))
        if joint in names:
            if not placed:
                base, fixed = fixed[:-1], fixed[-1:]
            placed[joint] = _product(fixed)
            fixed = []
    chain = {
        names[joint]: _entries(frame) | {"axis": list(joint.axis)} | ({"slides": True} if joint.slides else {})
        for joint, frame in placed.items()
    }
    ends = {"base": _entries(_product(base)), "tool": _entries(_product(fixed))}
    return {"notation": Notation.URDF, "chain": chain} | {key: entries for key, entries in ends.items() if entries}


def _frame(joint: UrdfJoint, angle: Callable[[float], float]) -> FixedFrame:
    quaternion = joint.quaternion_xyzw
    if quaternion is None:
        return FixedFrame(triple(joint.xyz_mm), triple(np.rad2deg(list(map(angle, joint.rpy_rad))).tolist()))
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = matrix(np.array(quaternion)), joint.xyz_mm
    return frame_of(transform)


def _product(frames: Sequence[FixedFrame]) -> FixedFrame:
    """Return the product of frames; a single frame stays as written."""
    if len(frames) == 1:
        return frames[0]
    transform = np.eye(4)
    for frame in frames:
        transform = transform @ frame.matrix
    return frame_of(transform)


def _entries(frame: FixedFrame) -> dict[str, Dimension]:
    given = {"xyz_mm": list(frame.xyz_mm), "rpy_deg": list(frame.rpy_deg)}
    return {key: values for key, values in given.items() if any(values)}


def _nearest(angle_rad: float) -> float:
    return round(angle_rad / _STEP_RAD) * _STEP_RAD


def _is_nearly(angle_rad: float) -> bool:
    """Return whether an angle is close to a multiple of 15 degrees, but not exact."""
    return _EXACT_RAD < abs(angle_rad - _nearest(angle_rad)) <= SNAPPED_RAD


def _snapped(angle_rad: float) -> float:
    nearest = _nearest(angle_rad)
    return nearest if abs(angle_rad - nearest) <= SNAPPED_RAD else angle_rad


def _move(joint: UrdfJoint, name: str) -> ChainMove:
    unit = 1000.0 if joint.slides else 180.0 / pi
    speed = joint.limit("velocity")
    lower, upper = (_round(unit * (joint.limit(key) or 0.0)) for key in ("lower", "upper"))
    if joint.kind == "continuous":
        lower, upper = -_ENDLESS_DEG, _ENDLESS_DEG
    return ChainMove(name, joint.kind, lower, upper, _round(unit * speed) if speed and speed > 0.0 else inf)


def _round(value: float) -> float:
    """Return a limit without rounding errors of its conversion."""
    return round(value, 9) + 0.0


def _notes_on_limits(joints: Sequence[UrdfJoint], moves: Sequence[ChainMove]) -> Iterator[str]:
    """Yield a note for each limit that is probably an exporter's placeholder."""
    rotary = [move for move in moves if move.kind == "revolute"]
    if len(rotary) > 1 and all(map(_is_quarter, rotary)):
        yield "limits are -90..90 deg at every revolute joint: probably a placeholder; set those of the machine"
    if placeholders := [joint.name for joint in joints if (joint.limit("effort") or 0.0) < 0.0]:
        yield f"effort is below 0 at {_listed(placeholders)}: a placeholder, as its other limits may be"
    if still := [move.name for move in moves if move.speed == inf]:
        yield f"no velocity above 0 at {_listed(still)}: speed_max follows from motor and driver alone"


def _is_quarter(move: ChainMove) -> bool:
    return max(abs(move.lower + _QUARTER_DEG), abs(move.upper - _QUARTER_DEG)) <= _QUARTER_OFF_DEG


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)
