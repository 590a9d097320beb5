"""The SCARA of a calibration paper: R-R-P-R in standard DH parameters; the tool points down, or up if alpha3 = 0.

Source: "Kinematic modeling and verification for a SCARA robot", ICMEMTC 2016, Atlantis Press, from p. 918.
"""

from dataclasses import dataclass
from functools import partial
from typing import Final

from steptwin.host.common.bad_input import require_positive
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import check_all
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.base import read_geometry
from steptwin.host.robots.kinematics.dh import Convention, DhRow, DhTable, Parameter
from steptwin.host.robots.kinematics.dimension import dimension
from steptwin.host.robots.kinematics.scara import Scara
from steptwin.host.robots.kinematics.usual_scara import Direction, Lift, ScaraGeometry, chain, scara_of
from steptwin.host.robots.robot import Robot

_TOOLS: Final = {0.0: Direction.UP, 180.0: Direction.DOWN}
"""Direction of the tool by alpha3."""


@dataclass(frozen=True, slots=True)
class CalibrationGeometry:
    """The dimensions; raises InputError for a link that is not longer than 0 or another twist than 180 or 0."""

    L1_mm: float = dimension("first link, from shoulder to elbow", 250.0)
    L2_mm: float = dimension("second link, from elbow to wrist", 350.0)
    d1_mm: float = dimension("height of the column", 300.0)
    alpha3_deg: float = dimension("twist at the wrist: 180 for a tool that points down, 0 for up", 180.0)

    def __post_init__(self) -> None:
        check_all(partial(require_positive, self, "L1_mm", "L2_mm"), self._check_tool)

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return chain(Lift.LAST)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, self.L1_mm, Parameter(self.d1_mm), Parameter(variable="th1")),
            DhRow(0.0, self.L2_mm, Parameter(), Parameter(variable="th2")),
            DhRow(self.alpha3_deg, 0.0, Parameter(variable="d3", sign=-1), Parameter()),
            DhRow(0.0, 0.0, Parameter(), Parameter(variable="th4")),
        )
        return DhTable(Convention.STANDARD, rows)

    def _check_tool(self) -> None:
        if self.alpha3_deg not in _TOOLS:
            raise InputError(f"alpha3_deg: {self.alpha3_deg:g} deg is neither 180 (tool down) nor 0 (tool up)")


def calibration_scara(robot: Robot) -> Scara:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(CalibrationGeometry, robot)
    scara = ScaraGeometry(
        geometry.L1_mm,
        geometry.L2_mm,
        lift=Lift.LAST,
        lift_positive=Direction.DOWN,
        tool=_TOOLS[geometry.alpha3_deg],
        base_mm=geometry.d1_mm,
    )
    return scara_of(robot, scara, geometry.dh)
