"""The options by which a tool's orientation is given: one of several notations, whose names carry their conventions."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

import typer

from steptwin.host.cli.arguments import finite_number
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


@dataclass(frozen=True, slots=True)
class OrientationOptions:
    """The orientation of a tool that turns in space; at most one option is given."""

    rpy: Annotated[
        str | None, typer.Option(metavar="'R P Y'", help="Roll, pitch, yaw about the fixed x, y, z in deg: Rz Ry Rx.")
    ] = None
    quaternion: Annotated[str | None, typer.Option(metavar="'X Y Z W'", help="Unit quaternion, scalar last.")] = None
    rotvec: Annotated[str | None, typer.Option(metavar="'X Y Z'", help="Axis, as long as the angle in deg.")] = None
    abc: Annotated[str | None, typer.Option(metavar="'A B C'", help="KUKA's angles: yaw, pitch, roll in deg.")] = None
    direction: Annotated[
        str | None, typer.Option(metavar="'X Y Z'", help="Where the tool points, for arms of five axes.")
    ] = None

    def orientation(self) -> "Orientation | None":
        """Return the orientation; None without one. Raises InputError for two, or for wrong numbers."""
        from steptwin.host.robots.poses import Orientation

        given = {option: text for option in _KEYS if (text := getattr(self, option)) is not None}
        if not given:
            return None
        (option, text), *others = given.items()
        if others:
            raise InputError(f"--{others[0][0]}: beside --{option}; a pose has one orientation")
        values = tuple(finite_number(word, f"--{option}") for word in text.replace(",", " ").split())
        with prefixed(f"--{option}: "):
            return Orientation(_KEYS[option], values)
