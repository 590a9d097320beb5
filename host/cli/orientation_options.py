"""The options by which a tool's orientation is given: one of several notations, whose names carry their conventions."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from steptwin.host.cli.arguments import finite_number
from steptwin.host.cli.options import option
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.robots.poses import Orientation

_KEYS: Final = {
    "rpy": "rpy_deg",
    "quaternion": "quaternion_xyzw",
    "rotvec": "rotvec_deg",
    "abc": "abc_deg",
    "direction": "direction",
}
"""The keys of files that the options stand for."""


Numbers = tuple[float, ...]


def _numbers(text: str, name: str) -> Numbers:
    return tuple(finite_number(word, name) for word in text.replace(",", " ").split())


@dataclass(frozen=True, slots=True)
class OrientationOptions:
    """The orientation of a tool that turns in space; at most one option is given."""

    rpy: Numbers | None = option("'R P Y'", "Roll, pitch, yaw about the fixed x, y, z in deg: Rz Ry Rx.", read=_numbers)
    quaternion: Numbers | None = option("'X Y Z W'", "Unit quaternion, scalar last.", read=_numbers)
    rotvec: Numbers | None = option("'X Y Z'", "Axis, as long as the angle in deg.", read=_numbers)
    abc: Numbers | None = option("'A B C'", "KUKA's angles: yaw, pitch, roll in deg.", read=_numbers)
    direction: Numbers | None = option("'X Y Z'", "Where the tool points, for arms of five axes.", read=_numbers)

    def orientation(self) -> "Orientation | None":
        """Return the orientation; None without one. Raises InputError for two, or for wrong numbers."""
        from steptwin.host.robots.poses import Orientation

        given = {name: values for name in _KEYS if (values := getattr(self, name)) is not None}
        if not given:
            return None
        (name, values), *others = given.items()
        if others:
            raise InputError(f"--{others[0][0]}: beside --{name}; a pose has one orientation")
        with prefixed(f"--{name}: "):
            return Orientation(_KEYS[name], values)
