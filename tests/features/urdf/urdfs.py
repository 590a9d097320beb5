"""URDFs written by hand, and a forward kinematics of them that knows nothing of the code under test."""

from collections.abc import Sequence
from math import cos, sin
from pathlib import Path
from typing import Final

from steptwin.features.urdf.urdf_robot import UrdfSource
from steptwin.host.robots.new_file import NewRobot

LIMIT: Final = '<limit lower="-2" upper="2.5" effort="10" velocity="1"/>'
Matrix = list[list[float]]


def joint(name: str, parent: str, child: str, inside: str = "", kind: str = "revolute") -> str:
    """An element of a joint."""
    limit = LIMIT if kind in ("revolute", "prismatic") and "<limit" not in inside else ""
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}{limit}</joint>\n'


def urdf(*joints: str, links: str = "abcdefghij", inside: str = "") -> str:
    """A URDF with links of one letter each."""
    named = "".join(f'<link name="{link}"/>' for link in links)
    return f'<?xml version="1.0"?>\n<robot name="r">{named}\n{"".join(joints)}{inside}</robot>\n'


def robot_of(
    folder: Path, text: str, tip: str | None = None, base: str | None = None, *, snap: bool = False, **settings: str
) -> NewRobot:
    """The robot file of a URDF; settings are by JOINT__KEY."""
    path = folder / "r.urdf"
    path.write_text(text, encoding="utf-8")
    given = {key.replace("__", "."): value for key, value in settings.items()}
    return UrdfSource(str(path), tip, base, snap).robot("arm", given)


def _times(first: Matrix, second: Matrix) -> Matrix:
    return [[sum(first[i][k] * second[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def _turn(axis: Sequence[float], angle: float, place: Sequence[float] = (0.0, 0.0, 0.0)) -> Matrix:
    """The turn about a unit vector by an angle in rad (Rodrigues), then a shift."""
    x, y, z = axis
    c, s, v = cos(angle), sin(angle), 1.0 - cos(angle)
    return [
        [c + x * x * v, x * y * v - z * s, x * z * v + y * s, place[0]],
        [y * x * v + z * s, c + y * y * v, y * z * v - x * s, place[1]],
        [z * x * v - y * s, z * y * v + x * s, c + z * z * v, place[2]],
        [0.0, 0.0, 0.0, 1.0],
    ]


def placed(xyz: Sequence[float], rpy: Sequence[float]) -> Matrix:
    """The transform of an origin, in m and rad: the turn about z of that about y of that about x."""
    about_z = _turn((0, 0, 1), rpy[2], xyz)
    return _times(_times(about_z, _turn((0, 1, 0), rpy[1])), _turn((1, 0, 0), rpy[0]))


def moved(axis: Sequence[float], position: float, *, slides: bool = False) -> Matrix:
    """The transform of a joint at a position in m or rad."""
    norm = sum(part * part for part in axis) ** 0.5
    unit = [part / norm for part in axis]
    return _turn(unit, 0.0, [position * part for part in unit]) if slides else _turn(unit, position)


def product(*transforms: Matrix) -> Matrix:
    """The product of transforms."""
    result = placed((0, 0, 0), (0, 0, 0))
    for transform in transforms:
        result = _times(result, transform)
    return result
