"""The classroom SCARA (R-R-P-R): two rotary joints, a lift that pushes down, and a wrist; the tool points up.

Source: X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental
Teaching", 2017, DOI 10.3969/j.issn.1000-386x.2017.06.019. Its text and its code disagree about the sign of d3. Here
d3 >= 0 pushes downwards, as in the text; in the paper's experiment d3 is 0, so the two agree.
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
class TeachingGeometry:
    """The dimensions; raises InputError for a link that is not longer than 0."""

    l1_mm: float = dimension("first link, from shoulder to elbow", 95.0)
    l2_mm: float = dimension("second link, from elbow to wrist", 100.0)
    d4_mm: float = dimension("tip of the tool above the arm, negative below it", -40.0)

    def __post_init__(self) -> None:
        require_positive(self, "l1_mm", "l2_mm")

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return chain(Lift.LAST)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, 0.0, Parameter(), Parameter(variable="th1")),
            DhRow(0.0, self.l1_mm, Parameter(), Parameter(variable="th2")),
            DhRow(0.0, self.l2_mm, Parameter(variable="d3", sign=-1), Parameter()),
            DhRow(0.0, 0.0, Parameter(self.d4_mm), Parameter(variable="th4")),
        )
        return DhTable(Convention.MODIFIED, rows)


def teaching_scara(robot: Robot) -> Scara:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(TeachingGeometry, robot)
    scara = ScaraGeometry(
        geometry.l1_mm,
        geometry.l2_mm,
        lift=Lift.LAST,
        lift_positive=Direction.DOWN,
        tool=Direction.UP,
        drop_mm=-geometry.d4_mm,
    )
    return scara_of(robot, scara, geometry.dh)
