"""The SCARAs of four papers, with their printed dimensions and DH tables."""

from dataclasses import dataclass
from functools import partial
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Positive, check_limits
from steptwin.host.common.findings import check_all
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.kinematics.base import dimension, read_geometry, require_joints
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow, DhTable
from steptwin.host.robots.kinematics.scara import Planar2R, Scara
from steptwin.host.robots.kinematics.usual_scara import Lift, ScaraGeometry, Vertical, chain, scara_of
from steptwin.host.robots.robot import Robot

_TOOLS: Final = {0.0: Vertical.UP, 180.0: Vertical.DOWN}
"""Direction of the tool by alpha3."""


@dataclass(frozen=True, slots=True)
class CalibrationGeometry(FileTable):
    """Dimensions of the calibrated SCARA; raises InputError for a link not longer than 0 or a twist not 0 or 180.

    Source: "Kinematic modeling and verification for a SCARA robot", ICMEMTC 2016, Atlantis Press, from p. 918.
    """

    L1_mm: Positive = dimension("first link, from shoulder to elbow", 250.0)
    L2_mm: Positive = dimension("second link, from elbow to wrist", 350.0)
    d1_mm: float = dimension("height of the column", 300.0)
    alpha3_deg: float = dimension("twist at the wrist: 180 for a tool that points down, 0 for up", 180.0)

    def __post_init__(self) -> None:
        check_all(partial(check_limits, self), self._check_tool)

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return chain(Lift.LAST)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, self.L1_mm, DhParameter(self.d1_mm), DhParameter(variable="th1")),
            DhRow(0.0, self.L2_mm, DhParameter(), DhParameter(variable="th2")),
            DhRow(self.alpha3_deg, 0.0, DhParameter(variable="d3", sign=-1), DhParameter()),
            DhRow(0.0, 0.0, DhParameter(), DhParameter(variable="th4")),
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
        lift_positive=Vertical.DOWN,
        tool=_TOOLS[geometry.alpha3_deg],
        base_mm=geometry.d1_mm,
    )
    return scara_of(robot, scara, geometry.dh)


_JOINTS: Final = {"sx": Unit.MM, "sz": Unit.MM, "L1": Unit.MM, "th1": Unit.DEG, "th2": Unit.DEG, "th3": Unit.DEG}


@dataclass(frozen=True, slots=True)
class WarehouseGeometry(FileTable):
    """Dimensions of the warehouse robot; raises InputError for a link that is not longer than 0.

    The slide sx shifts the arm along x, the slide sz along z.

    Source: A. Jiang, L. Guo, X. Tan, "Development of Prototype of a New Intelligent Warehouse Robot", 2019(05),
    from p. 62, DOI 10.3969/j.issn.1009-9492.2019.05.018, with its inverse corrected: the paper takes the wrist's
    direction from an arc cosine, which loses the sign of y, and has only one elbow. Its table 1 has a = L4 in row 4 for
    what its equation 1 calls L5.
    """

    L2_mm: Positive = dimension("first link, from shoulder to elbow", 200.0)
    L3_mm: Positive = dimension("second link, from elbow to wrist", 150.0)
    L4_mm: float = dimension("tip of the tool below the arm", 40.0)
    L5_mm: float = dimension("tip of the tool beside the wrist's axis", 40.0)

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return dict(_JOINTS)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, 0.0, DhParameter(variable="sz"), DhParameter(90.0)),
            DhRow(90.0, 0.0, DhParameter(variable="sx"), DhParameter()),  # z of this frame lies along the aisle
            DhRow(-90.0, 0.0, DhParameter(variable="L1"), DhParameter(-90.0, "th1")),
            DhRow(0.0, self.L2_mm, DhParameter(), DhParameter(variable="th2")),
            DhRow(0.0, self.L3_mm, DhParameter(), DhParameter(variable="th3")),
            DhRow(0.0, self.L5_mm, DhParameter(-self.L4_mm), DhParameter()),
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


@dataclass(frozen=True, slots=True)
class TeachingGeometry(FileTable):
    """Dimensions of the teaching SCARA; raises InputError for a link that is not longer than 0.

    Source: X. Yao, Y. Pan, Y. Gao, "Research and Implementation of SCARA Manipulator Control Algorithm in Experimental
    Teaching", 2017, DOI 10.3969/j.issn.1000-386x.2017.06.019. Its text and its code disagree about the sign of d3. Here
    d3 >= 0 pushes downwards, as in the text; in the paper's experiment d3 is 0, so the two agree.
    """

    l1_mm: Positive = dimension("first link, from shoulder to elbow", 95.0)
    l2_mm: Positive = dimension("second link, from elbow to wrist", 100.0)
    d4_mm: float = dimension("tip of the tool above the arm, negative below it", -40.0)

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return chain(Lift.LAST)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, 0.0, DhParameter(), DhParameter(variable="th1")),
            DhRow(0.0, self.l1_mm, DhParameter(), DhParameter(variable="th2")),
            DhRow(0.0, self.l2_mm, DhParameter(variable="d3", sign=-1), DhParameter()),
            DhRow(0.0, 0.0, DhParameter(self.d4_mm), DhParameter(variable="th4")),
        )
        return DhTable(Convention.MODIFIED, rows)


def teaching_scara(robot: Robot) -> Scara:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(TeachingGeometry, robot)
    scara = ScaraGeometry(
        geometry.l1_mm,
        geometry.l2_mm,
        lift=Lift.LAST,
        lift_positive=Vertical.DOWN,
        tool=Vertical.UP,
        drop_mm=-geometry.d4_mm,
    )
    return scara_of(robot, scara, geometry.dh)


@dataclass(frozen=True, slots=True)
class LabGeometry(FileTable):
    """Dimensions of the laboratory SCARA (P-R-R-R); raises InputError for a link that is not longer than 0.

    A ball screw lifts the arm of three parallel rotary joints; the tool points down.

    Source: H. Wang, B. Yin, R. Luo, X. Wang, "Mechanism design and kinematics analysis of 4-dof SCARA robot system",
    J. Mechanical & Electrical Engineering 36(12), 2019, 1320-1324, its equations corrected (docs/papers/lab-scara.md).
    """

    a2_mm: Positive = dimension("first link, from shoulder to elbow", 400.0)
    a3_mm: Positive = dimension("second link, from elbow to wrist", 400.0)
    d5_mm: float = dimension("tip of the tool below the arm", 150.0)

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units, along the chain."""
        return chain(Lift.FIRST)

    @property
    def dh(self) -> DhTable:
        """The DH table, with the joints' names as variables."""
        rows = (
            DhRow(0.0, 0.0, DhParameter(variable="d1"), DhParameter(90.0)),
            DhRow(0.0, 0.0, DhParameter(), DhParameter(variable="th2")),
            DhRow(0.0, self.a2_mm, DhParameter(), DhParameter(variable="th3")),
            DhRow(180.0, self.a3_mm, DhParameter(), DhParameter(variable="th4")),
            DhRow(0.0, 0.0, DhParameter(self.d5_mm), DhParameter()),
        )
        return DhTable(Convention.MODIFIED, rows)


def lab_scara(robot: Robot) -> Scara:
    """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
    geometry = read_geometry(LabGeometry, robot)
    scara = ScaraGeometry(
        geometry.a2_mm,
        geometry.a3_mm,
        lift=Lift.FIRST,
        lift_positive=Vertical.UP,
        tool=Vertical.DOWN,
        heading_deg=90.0,
        drop_mm=geometry.d5_mm,
    )
    return scara_of(robot, scara, geometry.dh)
