"""Kinematics: from joints to tool poses and back, one module for each kind of mechanism."""

from collections.abc import Callable
from typing import Final

from host.inputs import unknown
from host.kinematics.base import Branch, Constraint, Kinematics, singularity_measure, within_limits
from host.kinematics.calibration import calibration_scara
from host.kinematics.hybrid import HybridArm
from host.kinematics.lab import lab_scara
from host.kinematics.planar2r import Elbow, Planar2R
from host.kinematics.scara import Scara
from host.kinematics.slider_pair import AssemblyMode, SliderPair, WorkingMode
from host.kinematics.teaching import teaching_scara
from host.kinematics.warehouse import warehouse_scara
from host.robot import Robot

__all__ = [
    "AssemblyMode",
    "Branch",
    "Constraint",
    "Elbow",
    "HybridArm",
    "Kinematics",
    "Planar2R",
    "Scara",
    "SliderPair",
    "WorkingMode",
    "make_kinematics",
    "singularity_measure",
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
    """The kinematics of a robot.

    Raises:
        InputError: an unknown kind, or dimensions or joints that do not fit it; the message begins with the key.
    """
    if robot.kinematics not in _KINDS:
        raise unknown("kinematics.kind:", robot.kinematics, _KINDS)
    return _KINDS[robot.kinematics](robot)
