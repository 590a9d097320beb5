"""Kinematics: tool poses from joint positions and back, a module for each kind of mechanism."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.robots.kinematics.base import Branch, Kinematics, geometry_of, pose_words, within_limits
from steptwin.host.robots.kinematics.calibration import CalibrationGeometry, calibration_scara
from steptwin.host.robots.kinematics.hybrid import HybridArm, HybridGeometry
from steptwin.host.robots.kinematics.lab import LabGeometry, lab_scara
from steptwin.host.robots.kinematics.planar2r import Elbow, Planar2R
from steptwin.host.robots.kinematics.scara import Scara
from steptwin.host.robots.kinematics.slider_pair import AssemblyMode, SliderPair, WorkingMode
from steptwin.host.robots.kinematics.teaching import TeachingGeometry, teaching_scara
from steptwin.host.robots.kinematics.usual_scara import ScaraGeometry, usual_scara
from steptwin.host.robots.kinematics.warehouse import WarehouseGeometry, warehouse_scara
from steptwin.host.robots.robot import Dimension, Robot

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
    "check_dimensions",
    "make_kinematics",
    "pose_words",
    "within_limits",
]

_KINDS: Final[dict[str, tuple[type[Any], Callable[[Robot], Kinematics]]]] = {
    "scara": (ScaraGeometry, usual_scara),
    "lab-scara": (LabGeometry, lab_scara),
    "warehouse-scara": (WarehouseGeometry, warehouse_scara),
    "teaching-scara": (TeachingGeometry, teaching_scara),
    "calibration-scara": (CalibrationGeometry, calibration_scara),
    "hybrid-arm": (HybridGeometry, HybridArm.of),
}
"""The kinds of mechanisms, each with the dataclass of its dimensions and its maker."""


def make_kinematics(robot: Robot) -> Kinematics:
    """Return a robot's kinematics; raise InputError, with the key, if kind, dimensions or joints do not fit."""
    return _known(robot.kinematics)[1](robot)


def check_dimensions(kind: str, dimensions: Mapping[str, Dimension]) -> None:
    """Raise InputError, with the key, if there is no such kind, or if these are not its dimensions."""
    geometry_of(_known(kind)[0], dimensions)


def _known(kind: str) -> tuple[type[Any], Callable[[Robot], Kinematics]]:
    if kind not in _KINDS:
        raise unknown("kinematics.kind:", kind, _KINDS)
    return _KINDS[kind]
