"""Make the text of a robot file from a URDF, and list the values that the user has to fill in."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from steptwin.features.arms.six_axis_arm import SixAxisArm
from steptwin.features.arms.spherical_wrist import MISS_MAX_MM, TILT_MAX, wrist_miss_mm
from steptwin.features.urdf.urdf_chain import ChainMove, UrdfChain, chain_of
from steptwin.features.urdf.urdf_tree import read_urdf
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import MIB
from steptwin.host.common.findings import Findings
from steptwin.host.common.own_files import read_text
from steptwin.host.robots import read_robot
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.kinds import make_kinematics
from steptwin.host.robots.kinematics.serial.chain_geometry import JOINTS_MAX, TASKS, ArmAxes, axes_of
from steptwin.host.robots.new_file import DRIVER_PROFILE, NewRobot, robot_text
from steptwin.host.robots.new_joint import NewJoint, board_with, read_joint
from steptwin.host.robots.robot import Dimension

KIND: Final = "chain"
URDF_BYTES_MAX: Final = 1 * MIB
"""A link of a URDF with masses, meshes and a joint has some 1 KiB; a robot with two arms and hands has some 100."""
_RATIO: Final = 20.0
_LEAD_MM: Final = 8.0
_MICROSTEPS: Final = 8
"""Placeholders for the user: a gear of 20, a screw of 8 mm, an eighth of a step."""


@dataclass(frozen=True, slots=True)
class UrdfSource:
    """Part of a URDF that becomes a robot.

    Attributes:
        path: path of the file.
        tip: link of the tool; None for the only leaf that needs no mimic.
        base: link of the base; None for the root.
        snap: True to make angles exact that are close to a multiple of 15 degrees.
    """

    path: str
    tip: str | None = None
    base: str | None = None
    snap: bool = False

    def robot(self, name: str, settings: Mapping[str, str]) -> NewRobot:
        """Return the robot file; raise InputError, with the file or the setting, for errors.

        Args:
            name: name of the robot.
            settings: values as texts: of joints by `JOINT.ratio` and the like, `task`, and `held`, names with commas.
        """
        with prefixed(f"{self.path}: "):
            chain = chain_of(read_urdf(read_text(self.path, URDF_BYTES_MAX)), self.base, self.tip, snap=self.snap)
        with prefixed("--set "):
            joints = _with_settings(tuple(map(_new_joint, chain.moves)), settings)
            geometry = chain.geometry | {key: read(settings[key]) for key, read in _TOLD.items() if key in settings}
        with prefixed(f"{self.path}: "):
            _check_ranges(joints)
            _check_held(geometry)
            text = robot_text(name, KIND, geometry, list(joints))
        notes = (*_notes_on_inverse(text), *chain.notes, *_to_fill_in(chain, joints, settings))
        return NewRobot(text, KIND, geometry, tuple(joint.name for joint in joints), notes)


def _new_joint(move: ChainMove) -> NewJoint:
    slides = move.kind == "prismatic"
    return NewJoint(
        move.name,
        Unit.MM if slides else Unit.DEG,
        f"{move.kind} in the URDF; {'travel_per_turn' if slides else 'ratio'}, microsteps and switches: fill in",
        move.lower,
        move.upper,
        _LEAD_MM if slides else _RATIO,
        _MICROSTEPS,
        speed_most=move.speed,
    )


def _with_settings(joints: tuple[NewJoint, ...], settings: Mapping[str, str]) -> tuple[NewJoint, ...]:
    by_name, findings = {joint.name: joint for joint in joints}, Findings()
    if DRIVER_PROFILE in settings:
        with prefixed(f"{DRIVER_PROFILE}: "):
            board = board_with(settings[DRIVER_PROFILE])
        by_name = {name: joint.on(board) for name, joint in by_name.items()}
    for key, text in settings.items():
        with findings.collecting():
            if key in _TOLD or key == DRIVER_PROFILE:
                continue
            name, _, quantity = key.partition(".")
            if name not in by_name:
                raise unknown("joint", name, by_name)
            by_name[name] = read_joint(by_name[name], quantity, text)
    findings.raise_first()
    return tuple(by_name.values())


def _held(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


_TOLD: Final[dict[str, Callable[[str], Dimension]]] = {"task": str, "held": _held}


def _check_held(geometry: Mapping[str, Dimension]) -> None:
    """Raise InputError, with the remedy, if more joints move the tool than its task determines."""
    held = geometry.get("held", [])
    free = [name for name in geometry["chain"] if name not in held]
    if "task" in geometry or len(free) > JOINTS_MAX:
        return
    most = max((joints for _, joints in TASKS.values() if joints <= len(free)), default=len(free))
    if len(free) > most:
        names = ",".join([*held, *free[: len(free) - most]])
        raise InputError(
            f"{len(free)} joints move the tool, its place and turn take 3, 5 or 6: hold {len(free) - most} where they"
            f" stand, as in --set held={names}"
        )


def _check_ranges(joints: tuple[NewJoint, ...]) -> None:
    """Raise InputError, with the remedy, for limits that exporters left without a range."""
    findings = Findings()
    for joint in joints:
        with findings.collecting():
            if not joint.lower < joint.upper:
                limits = (
                    f"upper limit {joint.upper:g} {joint.unit} is not above the lower, {joint.lower:g} {joint.unit}"
                )
                ways = f"--set {joint.name}.lower=VALUE --set {joint.name}.upper=VALUE"
                raise InputError(f"joint {joint.name!r}: {limits}: give the machine's by {ways}")
    findings.raise_first()


def _notes_on_inverse(text: str) -> Iterator[str]:
    """Yield a note on the method of the inverse, and on wrist axes that miss each other."""
    robot = read_robot(text)
    kinematics = make_kinematics(robot)
    assert isinstance(kinematics, SixAxisArm)
    words = f"inverse kinematics {kinematics.inverse_words}"
    yield words
    miss_mm = _wrist_miss_mm(axes_of(kinematics.dh, robot.joint_names))
    missing = f"axes 4, 5 and 6 miss one point by {miss_mm:.3g} mm"
    if miss_mm > MISS_MAX_MM and missing not in words:
        yield f"inverse kinematics numeric for another reason as well: {missing}"


def _wrist_miss_mm(axes: ArmAxes) -> float:
    """Return the miss of the last three of six rotary axes; 0 for an arm without such a wrist."""
    if len(axes.slides) != 6 or any(axes.slides):
        return 0.0
    neighbours = np.cross(axes.directions[3:5], axes.directions[4:6])
    return wrist_miss_mm(axes) if np.linalg.norm(neighbours, axis=1).min() >= TILT_MAX else 0.0


def _to_fill_in(chain: UrdfChain, joints: tuple[NewJoint, ...], settings: Mapping[str, str]) -> Iterator[str]:
    """Yield the values that the URDF does not have, with their placeholders."""
    ends = ("lower", "upper")
    endless = [move.name for move in chain.moves if move.kind == "continuous"]
    if unset := [name for name in endless if not all(f"{name}.{end}" in settings for end in ends)]:
        yield f"fill in lower and upper of {', '.join(unset)}, continuous in the URDF: -180..180 deg stands there"
    for key in ("ratio", "travel_per_turn", "microsteps"):
        if of_joints := [joint for joint in joints if key in joint.settings and f"{joint.name}.{key}" not in settings]:
            value = of_joints[0].microsteps if key == "microsteps" else of_joints[0].turn
            yield f"fill in {key} of {', '.join(joint.name for joint in of_joints)}: {value:g} stands there"
    if DRIVER_PROFILE not in settings:
        yield "fill in drivers: [board] has those of a TB6560; --set driver_profile takes others"
    yield "fill in switches and homing: switches are 5 beyond each range"
