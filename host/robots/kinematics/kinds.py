"""The kinds of mechanisms as data: description, dimensions, and constructor of the kinematics."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.features import giving
from steptwin.host.robots.kinematics.bare_axes import AxesGeometry, bare_axes
from steptwin.host.robots.kinematics.base import Kinematics
from steptwin.host.robots.kinematics.cartesian import CartesianGeometry, gantry
from steptwin.host.robots.kinematics.serial.chain_geometry import ChainGeometry
from steptwin.host.robots.kinematics.serial.serial_chain import SerialChain
from steptwin.host.robots.kinematics.usual_scara import ScaraGeometry, usual_scara
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of mechanism.

    Attributes:
        summary: description in a few words.
        geometry: dataclass of its options and dimensions, the keys of [kinematics].
        make: returns a robot's kinematics with its base at the station's origin; raises InputError if dimensions or
            joints do not fit.
    """

    summary: str
    geometry: type[Any]
    make: Callable[[Robot], Kinematics]


CORE_KINDS: Final[dict[str, Kind]] = {
    "scara": Kind(
        "a SCARA: lift first, last or none; a tool that turns or not, up or down", ScaraGeometry, usual_scara
    ),
    "cartesian": Kind("a gantry: slides along x, y and z, and perhaps a rotary axis c", CartesianGeometry, gantry),
    "axes": Kind("1 to 8 joints without a tool: turntables, sliders, test benches", AxesGeometry, bare_axes),
    "chain": Kind(
        "1 to 8 joints in a row, turning or sliding: six-axis arms and others", ChainGeometry, SerialChain.of
    ),
}


def kinds() -> Mapping[str, Kind]:
    """Return the kinds by their names in robot files: those of the core, replaced or extended by features."""
    found = dict(CORE_KINDS)
    for _, given in giving("kinematics"):
        found |= given()
    return found


def kind_named(name: str) -> Kind:
    """Return a kind by its name in robot files; raise InputError for an unknown one."""
    if name not in kinds():
        raise unknown("kinematics.kind:", name, kinds())
    return kinds()[name]


_KEPT: Final = 8
"""Number of robots in the cache: planning needs the kinematics of one robot repeatedly."""
_made: dict[int, tuple[Robot, Kinematics]] = {}
"""Cache of kinematics by the identity of the robot; the stored robot keeps this identity valid."""


def make_kinematics(robot: Robot) -> Kinematics:
    """Return a robot's kinematics; raise InputError, with the key, if kind, dimensions or joints do not fit."""
    made = _made.get(id(robot))
    if made is None:
        made = robot, kind_named(robot.kinematics).make(robot).on(robot.base)
        if len(_made) >= _KEPT:
            _made.clear()
        _made[id(robot)] = made
    return made[1]
