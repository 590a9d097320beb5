"""Kinematics: tool poses from joint positions and back, a module for each kind of mechanism."""

from collections.abc import Callable
from typing import Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.robots.kinematics.base import Branch, Kinematics, within_limits
from steptwin.host.robots.kinematics.calibration import calibration_scara
from steptwin.host.robots.kinematics.hybrid import HybridArm
from steptwin.host.robots.kinematics.lab import lab_scara
from steptwin.host.robots.kinematics.planar2r import Elbow, Planar2R
from steptwin.host.robots.kinematics.scara import Scara
from steptwin.host.robots.kinematics.slider_pair import AssemblyMode, SliderPair, WorkingMode
from steptwin.host.robots.kinematics.teaching import teaching_scara
from steptwin.host.robots.kinematics.warehouse import warehouse_scara
from steptwin.host.robots.robot import Robot

__all__ = [
    "AssemblyMode",
    "Branch",
    "Elbow",
    "HybridArm",
    "Kinematics",
    "Planar2R",
    "Scara",
    "SliderPair",
    "WorkingMode",
    "make_kinematics",
    "within_limits",
]

_KINDS: Final[dict[str, Callable[[Robot], Kinematics]]] = {
    "lab-scara": lab_scara,
    "warehouse-scara": warehouse_scara,
    "teaching-scara": teaching_scara,
    "calibration-scara": calibration_scara,
    "hybrid-arm": HybridArm.of,
}


def make_kinematics(robot: Robot) -> Kinematics:
    """Return a robot's kinematics; raise InputError, with the key, if kind, dimensions or joints do not fit."""
    if robot.kinematics not in _KINDS:
        raise unknown("kinematics.kind:", robot.kinematics, _KINDS)
    return _KINDS[robot.kinematics](robot)
