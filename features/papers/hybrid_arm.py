"""The hybrid arm: a waist carries a planar mechanism of two sliders, which carries an arm with a turning gripper.

The sliders' mechanism moves its platform radially by z2 and vertically by z3:

    rho = l2 + l3 + z2       X = rho cos th1       Y = rho sin th1       Z = l1 + z3 - l4       phi = th1 + th4

Source: H. Zhou, four-DOF hybrid handling robot. The copy used has lost its display equations and dimensions;
the radial layout is assumed (docs/papers/hybrid-arm.md).

The mechanism is planar and parallel: two links of equal length L meet at the point c = (z2, z3). Its screws are at -h
and +h; the sliders on them are at heights Z5 and Z6:

    (z2 + h)^2 + (z3 - Z5)^2 = L^2        (z2 - h)^2 + (z3 - Z6)^2 = L^2

Each slider may be below c or above it: four working modes. For given sliders, c may be above or below the line through
them: two assembly modes. A machine always keeps its modes, because a change would pass through a singularity.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final, Self

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.kinematics.base import (
    LIMIT_TOLERANCE,
    Branch,
    Constraint,
    dimension,
    joint_constraints,
    nearest_turns,
    read_geometry,
    require_joints,
)
from steptwin.host.robots.kinematics.dh import Convention, DhParameter, DhRow, DhTable, TwoSliders
from steptwin.host.robots.kinematics.links import ArmPart, Role, line, point, slide, tool
from steptwin.host.robots.kinematics.on_base import OnBase
from steptwin.host.robots.poses.rotations import wrapped_deg
from steptwin.host.robots.robot import Robot


class WorkingMode(Enum):
    """Positions of sliders 5 and 6: below c (+) or above it (-). Machines use the first mode."""

    BOTH_BELOW = "(+,+)"
    RIGHT_ABOVE = "(+,-)"
    LEFT_ABOVE = "(-,+)"
    BOTH_ABOVE = "(-,-)"

    @property
    def signs(self) -> tuple[int, int]:
        """e5 and e6: +1 for a slider below c, -1 for a slider above it."""
        return (1 if self.value[1] == "+" else -1), (1 if self.value[3] == "+" else -1)


class AssemblyMode(Enum):
    """Side of c relative to the line through the sliders."""

    ABOVE = 1
    BELOW = -1


@dataclass(frozen=True, slots=True)
class SliderPair:
    """The mechanism by h, half the distance between the screws, and L, the links' length, in mm; 0 < h < L."""

    h_mm: float
    L_mm: float

    def __post_init__(self) -> None:
        if not 0 < self.h_mm < self.L_mm:
            raise InputError(f"h_mm: {self.h_mm:g} mm is not above 0 and below the links' L_mm, {self.L_mm:g} mm")

    @property
    def reach_mm(self) -> float:
        """Largest |z2| at which both links reach their screws."""
        return self.L_mm - self.h_mm

    def forward(
        self, left_mm: FloatArray, right_mm: FloatArray, assembly: AssemblyMode
    ) -> tuple[FloatArray, FloatArray]:
        """Return z2 and z3 for Z5 and Z6; NaN where the sliders are further apart than the links allow."""
        apart = left_mm - right_mm
        square = 4.0 * self.L_mm**2 / (4.0 * self.h_mm**2 + apart**2) - 1.0
        k = np.sqrt(np.where(square >= 0.0, square, np.nan))
        return assembly.value * apart * k / 2.0, (left_mm + right_mm) / 2.0 + assembly.value * self.h_mm * k

    def inverse(self, z2_mm: FloatArray, z3_mm: FloatArray, mode: WorkingMode) -> tuple[FloatArray, FloatArray]:
        """Return Z5 and Z6; NaN where |z2| is beyond reach."""
        (left_sign, right_sign), (left_rise, right_rise) = mode.signs, self._rises(z2_mm)
        return z3_mm - left_sign * left_rise, z3_mm - right_sign * right_rise

    def assembly_of(self, z2_mm: FloatArray, mode: WorkingMode) -> FloatArray:
        """Return the assembly mode, +1 or -1, of a working mode with c at this z2; 0 where a mixed mode is singular."""
        (left_sign, right_sign), (left_rise, right_rise) = mode.signs, self._rises(z2_mm)
        above = (self.h_mm - z2_mm) * left_sign * left_rise + (self.h_mm + z2_mm) * right_sign * right_rise
        return np.sign(above)

    def slider_velocities(
        self, left_mm: FloatArray, right_mm: FloatArray, z2_mm: FloatArray, z3_mm: FloatArray,
        dz2: FloatArray, dz3: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Return the sliders' velocities for the velocity (dz2, dz3) of c; not finite where a link is level."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (
                dz3 + (z2_mm + self.h_mm) / (z3_mm - left_mm) * dz2,
                dz3 + (z2_mm - self.h_mm) / (z3_mm - right_mm) * dz2,
            )

    def sines(
        self, left_mm: FloatArray, right_mm: FloatArray, z2_mm: FloatArray, z3_mm: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the sine of each link's slope and of the angle between the links; 0 at a singularity."""
        left_rise, right_rise = z3_mm - left_mm, z3_mm - right_mm
        cross = (z2_mm + self.h_mm) * right_rise - (z2_mm - self.h_mm) * left_rise
        return np.abs(left_rise) / self.L_mm, np.abs(right_rise) / self.L_mm, np.abs(cross) / self.L_mm**2

    def _rises(self, z2_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the height difference between the ends of each link, never negative; NaN out of reach."""
        squares = (self.L_mm**2 - (z2_mm + self.h_mm) ** 2, self.L_mm**2 - (z2_mm - self.h_mm) ** 2)
        left, right = (np.sqrt(np.where(square >= 0.0, square, np.nan)) for square in squares)
        return left, right


_JOINTS: Final = {"th1": Unit.DEG, "Z5": Unit.MM, "Z6": Unit.MM, "th4": Unit.DEG}
TH1, Z5, Z6, TH4 = range(4)
"""Columns of the joints."""

SINGULAR: Final = 0.005
"""Least sine of a link's slope or of the angle between the links (0.29 degrees); below, the arm is near singular."""

GUIDE_PART: Final = 0.15
"""Distance of the third chain's link, as it is drawn, above that of Z5, as a fraction of its length."""


@dataclass(frozen=True, slots=True)
class HybridGeometry(FileTable):
    """Dimensions of the hybrid arm; raises InputError if links and travels do not fit together."""

    h_mm: float = dimension("half the distance between the screws", 150.0)
    L_mm: float = dimension("the two links of the sliders", 350.0)
    l1_mm: float = dimension("height of the mechanism's frame", 400.0)
    l2_mm: float = dimension("from the waist's axis out to the frame", 100.0)
    l3_mm: float = dimension("from the platform out to the tool", 300.0)
    l4_mm: float = dimension("from the platform down to the tool", 120.0)
    z2_max_mm: float = dimension("farthest way of the platform to either side", 150.0)

    def __post_init__(self) -> None:
        reach_mm = self.sliders.reach_mm
        if not 0 < self.z2_max_mm <= reach_mm:
            raise InputError(f"z2_max_mm: {self.z2_max_mm:g} mm is not above 0 and up to L_mm - h_mm, {reach_mm:g} mm")
        if not self.radius_mm > self.z2_max_mm:
            raise InputError(
                f"z2_max_mm: {self.z2_max_mm:g} mm takes the tool through the waist's axis,"
                f" l2_mm + l3_mm = {self.radius_mm:g} mm away"
            )

    @property
    def joints(self) -> dict[str, Unit]:
        """The joints' names and units."""
        return dict(_JOINTS)

    @property
    def dh(self) -> DhTable:
        """DH table of the serial chain R-P-P-R with the same motion; z2 and z3 are no joints."""
        rows = (
            DhRow(0.0, 0.0, DhParameter(self.l1_mm), DhParameter(90.0, "th1")),
            DhRow(90.0, 0.0, DhParameter(self.l2_mm, "z2"), DhParameter()),
            DhRow(-90.0, 0.0, DhParameter(variable="z3"), DhParameter(-90.0)),
            DhRow(0.0, self.l3_mm, DhParameter(-self.l4_mm), DhParameter(variable="th4")),
        )
        sliders = TwoSliders("th1", "Z5", "Z6", "z2", "z3", self.l2_mm, self.h_mm, self.L_mm)
        return DhTable(Convention.MODIFIED, rows, sliders=sliders)

    @property
    def sliders(self) -> SliderPair:
        """The parallel mechanism."""
        return SliderPair(self.h_mm, self.L_mm)

    @property
    def radius_mm(self) -> float:
        """Distance of the tool from the waist's axis with the platform in the middle."""
        return self.l2_mm + self.l3_mm


@dataclass(frozen=True, slots=True)
class HybridArm(OnBase):
    """The kinematics of the hybrid arm; implements Kinematics.

    Attributes:
        limits: joints th1, Z5, Z6, th4; their limits determine only whether a pose is reachable.
        sliders: the parallel mechanism.
        radius_mm: rho at z2 = 0.
        height_mm: height of the tool at z3 = 0.
        z2_max_mm: largest allowed |z2|.
        geometry: the dimensions.
    """

    limits: tuple[Joint, ...]
    sliders: SliderPair
    radius_mm: float
    height_mm: float
    z2_max_mm: float
    geometry: HybridGeometry

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return a robot's kinematics; raise InputError if its dimensions or joints are not this mechanism's."""
        geometry = read_geometry(HybridGeometry, robot)
        require_joints(robot, geometry.joints)
        return cls(
            limits=robot.joints,
            sliders=geometry.sliders,
            radius_mm=geometry.radius_mm,
            height_mm=geometry.l1_mm - geometry.l4_mm,
            z2_max_mm=geometry.z2_max_mm,
            dh=geometry.dh,
            geometry=geometry,
        )

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the working modes, `(+,+)` first: signs of sliders 5 and 6, + for a slider below the platform."""
        return tuple(mode.value for mode in WorkingMode)

    @property
    def attitude_follows(self) -> bool:
        """False: the gripper turns."""
        return False

    @property
    def turning(self) -> int:
        """The gripper's joint, th4."""
        return TH4

    def dh_variables(self, joints: FloatArray) -> dict[str, FloatArray]:
        """Return th1, z2, z3, th4."""
        z2_mm, z3_mm = self.sliders.forward(joints[:, Z5], joints[:, Z6], AssemblyMode.ABOVE)
        return {"th1": joints[:, TH1], "z2": z2_mm, "z3": z3_mm, "th4": joints[:, TH4]}

    def forward_from_base(self, joints: FloatArray) -> FloatArray:
        """Return poses of shape (n, 4) in the base's frame, with the platform assembled above the sliders."""
        return self._assembled(joints, AssemblyMode.ABOVE)

    def forward_as(self, joints: FloatArray, assembly: AssemblyMode) -> FloatArray:
        """Return poses for either assembly mode; NaN where the sliders are further apart than the links allow."""
        return self.in_station(self._assembled(joints, assembly))

    def _assembled(self, joints: FloatArray, assembly: AssemblyMode) -> FloatArray:
        z2_mm, z3_mm = self.sliders.forward(joints[:, Z5], joints[:, Z6], assembly)
        th1_rad = np.deg2rad(joints[:, TH1])
        rho_mm = self.radius_mm + z2_mm
        return np.column_stack(
            [
                rho_mm * np.cos(th1_rad),
                rho_mm * np.sin(th1_rad),
                self.height_mm + z3_mm,
                wrapped_deg(joints[:, TH1] + joints[:, TH4]),
            ]
        )

    def links_from_base(self, joints: FloatArray) -> tuple[ArmPart, ...]:
        """Return waist, screws, sliders with their links, guide, platform, arm and tool, for joints of shape (n, 4).

        The paper's third chain, which keeps the platform level, is drawn as a link beside that of Z5, parallel to it
        and equally long. This is our interpretation of figure 1, whose lengths are lost.
        """
        geometry, poses = self.geometry, self.forward_from_base(joints)
        th1_rad = np.deg2rad(joints[:, TH1])
        outwards = point(np.cos(th1_rad), np.sin(th1_rad), 0.0)
        reach_mm = self.radius_mm + self.z2_max_mm

        def at(radius_mm: FloatArray | float, height_mm: FloatArray | float) -> FloatArray:
            return np.asarray(outwards * np.reshape(radius_mm, (-1, 1)) + point(0.0, 0.0, height_mm))

        z2_mm, z3_mm = self.sliders.forward(joints[:, Z5], joints[:, Z6], AssemblyMode.ABOVE)
        platform_mm = at(geometry.l2_mm + z2_mm, geometry.l1_mm + z3_mm)
        wrist_mm = at(self.radius_mm + z2_mm, geometry.l1_mm + z3_mm)
        parts = []
        for column, radius_mm in ((Z5, geometry.l2_mm - geometry.h_mm), (Z6, geometry.l2_mm + geometry.h_mm)):
            limits, slid_mm = self.limits[column], geometry.l1_mm + joints[:, column]
            ends = (at(radius_mm, geometry.l1_mm + end_mm) for end_mm in (limits.lower, limits.upper))
            parts += [
                line(f"screw {limits.name}", Role.GUIDE, *ends),
                slide(f"slider {limits.name}", at(radius_mm, slid_mm), reach_mm),
                line(f"link {limits.name}", Role.LINK, at(radius_mm, slid_mm), platform_mm),
            ]
        apart_mm = point(0.0, 0.0, GUIDE_PART * geometry.L_mm)
        carriage_mm = at(geometry.l2_mm - geometry.h_mm, geometry.l1_mm + joints[:, Z5])
        frame = (at(geometry.l2_mm - geometry.h_mm, geometry.l1_mm), at(geometry.l2_mm + geometry.h_mm, geometry.l1_mm))
        return (
            line("waist", Role.GUIDE, at(0.0, 0.0), at(0.0, geometry.l1_mm)),
            line("frame", Role.GUIDE, at(0.0, geometry.l1_mm), *frame),
            *parts,
            line("guide link", Role.LINK, carriage_mm + apart_mm, platform_mm + apart_mm),
            line("platform", Role.SLIDE, platform_mm, platform_mm + apart_mm),
            line("arm", Role.LINK, platform_mm, wrist_mm),
            *tool(wrist_mm, poses, reach_mm),
        )

    def solve_from_base(self, poses: FloatArray, branch: str, near: FloatArray | None) -> Branch:
        """Return one working mode; th4 is in the turn within its limits nearest to `near`.

        A mode of the other assembly mode is solved, but is not reachable: the machine would have to be reassembled.
        """
        mode = WorkingMode(branch)
        z2_mm = np.hypot(poses[:, 0], poses[:, 1]) - self.radius_mm
        joints = np.empty((len(poses), 4))
        joints[:, TH1] = np.rad2deg(np.arctan2(poses[:, 1], poses[:, 0]))
        joints[:, Z5], joints[:, Z6] = self.sliders.inverse(z2_mm, poses[:, 2] - self.height_mm, mode)
        joints[:, TH4] = wrapped_deg(poses[:, 3] - joints[:, TH1])
        nearest_turns(self.limits, joints, near)
        mechanism = (self._reach(z2_mm), self._assembly(z2_mm, mode))
        return Branch(branch, joints, mechanism, joint_constraints(self.limits, joints))

    def singularities(self, joints: FloatArray) -> tuple[Constraint, ...]:
        """Return the sines of the links' slopes (0: level) and of the angle between them (0: in line)."""
        z2_mm, z3_mm = self.sliders.forward(joints[:, Z5], joints[:, Z6], AssemblyMode.ABOVE)
        sines = self.sliders.sines(joints[:, Z5], joints[:, Z6], z2_mm, z3_mm)
        names = ("Z5: near singular, |sin| of its link's slope", "Z6: near singular, |sin| of its link's slope")
        between = "Z5: near singular, |sin| of the angle between its link and Z6's"
        return tuple(
            Constraint(name, "", sine, SINGULAR, 1.0, sine >= SINGULAR)
            for name, sine in zip((*names, between), sines, strict=True)
        )

    def velocities_from_base(self, joints: FloatArray, tool_velocities: FloatArray) -> FloatArray:
        """Return joint velocities for joints and pose derivatives; all three have the shape (n, 4)."""
        z2_mm, z3_mm = self.sliders.forward(joints[:, Z5], joints[:, Z6], AssemblyMode.ABOVE)
        th1_rad = np.deg2rad(joints[:, TH1])
        outward_mm_s = np.cos(th1_rad) * tool_velocities[:, 0] + np.sin(th1_rad) * tool_velocities[:, 1]
        around_mm_s = np.cos(th1_rad) * tool_velocities[:, 1] - np.sin(th1_rad) * tool_velocities[:, 0]
        velocities = np.empty_like(joints)
        velocities[:, TH1] = np.rad2deg(around_mm_s / (self.radius_mm + z2_mm))
        velocities[:, Z5], velocities[:, Z6] = self.sliders.slider_velocities(
            joints[:, Z5], joints[:, Z6], z2_mm, z3_mm, outward_mm_s, tool_velocities[:, 2]
        )
        velocities[:, TH4] = tool_velocities[:, 3] - velocities[:, TH1]
        return velocities

    def _reach(self, z2_mm: FloatArray) -> Constraint:
        kept = np.abs(z2_mm) <= self.z2_max_mm + LIMIT_TOLERANCE
        nearest_mm, farthest_mm = self.radius_mm - self.z2_max_mm, self.radius_mm + self.z2_max_mm
        return Constraint("waist to tool", "mm", self.radius_mm + z2_mm, nearest_mm, farthest_mm, kept)

    def _assembly(self, z2_mm: FloatArray, mode: WorkingMode) -> Constraint:
        assembly = self.sliders.assembly_of(z2_mm, mode)
        complaint = (
            "the machine is assembled with its platform above its sliders' line; this takes it to the other side"
        )
        return Constraint("assembly mode", "", assembly, 1.0, 1.0, assembly == 1.0, lambda _: complaint)
