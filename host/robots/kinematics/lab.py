"""The laboratory SCARA (P-R-R-R): a ball screw lifts the arm of three parallel rotary joints; the tool points down.

Source: H. Wang, B. Yin, R. Luo, X. Wang, "Mechanism design and kinematics analysis of 4-dof SCARA robot system",
J. Mechanical & Electrical Engineering 36(12), 2019, 1320-1324, its equations corrected (docs/robots.md).
"""

from dataclasses import dataclass

from steptwin.host.common.bad_input import require_positive
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.base import read_geometry
from steptwin.host.robots.kinematics.dh import Convention, DhRow, DhTable, Parameter
from steptwin.host.robots.kinematics.dimension import dimension
from steptwin.host.robots.kinematics.scara import Scara
from steptwin.host.robots.kinematics.usual_scara import Direction, Lift, ScaraGeometry, chain, scara_of
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class LabGeometry:
    """The dimensions; raises InputError for a link that is not longer than 0."""

    a2_mm: float = dimension("first link, from shoulder to elbow", 400.0)
    a3_mm: float = dimension("second link, from elbow to wrist", 400.0)
    d5_mm: float = dimension("tip of the tool below the arm", 150.0)

    def __post_init__(self) -> None:
        require_positive(self, "a2_mm", "a3_mm")

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return chain(Lift.FIRST)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, 0.0, Parameter(variable="d1"), Parameter(90.0)),
            DhRow(0.0, 0.0, Parameter(), Parameter(variable="th2")),
            DhRow(0.0, self.a2_mm, Parameter(), Parameter(variable="th3")),
            DhRow(180.0, self.a3_mm, Parameter(), Parameter(variable="th4")),
            DhRow(0.0, 0.0, Parameter(self.d5_mm), Parameter()),
        )
        return DhTable(Convention.MODIFIED, rows)


def lab_scara(robot: Robot) -> Scara:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(LabGeometry, robot)
    scara = ScaraGeometry(
        geometry.a2_mm,
        geometry.a3_mm,
        lift=Lift.FIRST,
        lift_positive=Direction.UP,
        tool=Direction.DOWN,
        heading_deg=90.0,
        drop_mm=geometry.d5_mm,
    )
    return scara_of(robot, scara, geometry.dh)
