"""Forward and inverse kinematics, one module for each kind of mechanism."""

from steptwin.host.robots.kinematics.base import Branch, Kinematics, within_limits
from steptwin.host.robots.kinematics.kinds import make_kinematics
from steptwin.host.robots.kinematics.links import ArmPart, Role
from steptwin.host.robots.kinematics.scara import Elbow, Planar2R, Scara

__all__ = [
    "ArmPart",
    "Branch",
    "Elbow",
    "Kinematics",
    "Planar2R",
    "Role",
    "Scara",
    "make_kinematics",
    "within_limits",
]
