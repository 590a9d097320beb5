"""The warehouse robot: two slides carry a lift and an arm of three parallel rotary joints; the tool points up.

The slide sx shifts the arm along x, the slide sz along z.

Source: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019,
DOI 10.3969/j.issn.1009-9492.2019.05.018, with its inverse corrected: the paper takes the wrist's direction
from an arc cosine, which loses the sign of y, and has only one elbow.
"""

from dataclasses import dataclass
from typing import Final

from steptwin.host.common.bad_input import require_positive
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.base import read_geometry, require_joints
from steptwin.host.robots.kinematics.dh import Convention, DhRow, DhTable, Parameter
from steptwin.host.robots.kinematics.dimension import dimension
from steptwin.host.robots.kinematics.planar2r import Planar2R
from steptwin.host.robots.kinematics.scara import Scara
from steptwin.host.robots.robot import Robot

_JOINTS: Final = {"sx": Unit.MM, "sz": Unit.MM, "L1": Unit.MM, "th1": Unit.DEG, "th2": Unit.DEG, "th3": Unit.DEG}


@dataclass(frozen=True, slots=True)
class WarehouseGeometry:
    """The dimensions; raises InputError for a link that is not longer than 0."""

    L2_mm: float = dimension("first link, from shoulder to elbow", 200.0)
    L3_mm: float = dimension("second link, from elbow to wrist", 150.0)
    L4_mm: float = dimension("tip of the tool below the arm", 40.0)
    L5_mm: float = dimension("tip of the tool beside the wrist's axis", 40.0)

    def __post_init__(self) -> None:
        require_positive(self, "L2_mm", "L3_mm")

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return dict(_JOINTS)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, 0.0, Parameter(variable="sz"), Parameter(90.0)),
            DhRow(90.0, 0.0, Parameter(variable="sx"), Parameter()),  # z of this frame lies along the aisle
            DhRow(-90.0, 0.0, Parameter(variable="L1"), Parameter(-90.0, "th1")),
            DhRow(0.0, self.L2_mm, Parameter(), Parameter(variable="th2")),
            DhRow(0.0, self.L3_mm, Parameter(), Parameter(variable="th3")),
            DhRow(0.0, self.L5_mm, Parameter(-self.L4_mm), Parameter()),
        )
        return DhTable(Convention.MODIFIED, rows)


def warehouse_scara(robot: Robot) -> Scara:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(WarehouseGeometry, robot)
    require_joints(robot, geometry.joints)
    return Scara(
        limits=robot.joints,
        dh=geometry.dh,
        arm=Planar2R(geometry.L2_mm, geometry.L3_mm),
        lift=2,
        shoulder=3,
        elbow=4,
        wrist=5,
        height_mm=-geometry.L4_mm,
        tool_mm=geometry.L5_mm,
        slides=((0, 0), (1, 2)),
    )
