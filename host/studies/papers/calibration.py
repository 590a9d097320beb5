"""What is computed for the calibration robot's paper, whose items are in calibration.toml.

"Kinematic modeling and verification for a SCARA robot", ICMEMTC 2016, Atlantis Press, from p. 918.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, radians
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.kinematics.dh import Convention
from steptwin.host.robots.link_errors import QUANTITIES, LinkErrors
from steptwin.host.studies.calibration.identification import Identification, identify_errors, rms_mm
from steptwin.host.studies.calibration.measurements import simulate_measurements
from steptwin.host.studies.papers.paper import Computed, Figures, Rows
from steptwin.host.studies.papers.study import Study, texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

L1_MM: Final = 250.0
L2_MM: Final = 350.0
_BENT_DEG: Final = (45.0, 145.0)
"""Angles th2 at which the conventions are told apart."""
_RANDOM: Final = 1000
MEASURED: Final = 50
NOISE_MM: Final = 0.02
DISTURBED: Final = {
    "link2": LinkErrors(a_mm=0.4, theta_deg=0.1),
    "link1": LinkErrors(alpha_deg=0.1),
}
"""Errors of the simulated arm by the rows of table 1."""


@dataclass(frozen=True)
class CalibrationStudy(Study):
    """Table 1 in both conventions, the drawn arm, and a calibration; matrices at th1, th2, d3, th4 of `at`."""

    robot_name = "calibration-scara"
    at: ClassVar[tuple[float, ...]] = (30.0, 45.0, 50.0, 20.0)
    shown: ClassVar[tuple[float, ...]] = (20.0, 50.0, 60.0, 30.0)

    def _tip_mm(self, joints: FloatArray, convention: Convention = Convention.STANDARD) -> FloatArray:
        """Return the tip, of shape (n, 3), by the table read in a convention."""
        table = replace(self.kinematics.dh, convention=convention)
        return table.transforms(self.kinematics.dh_variables(joints))[:, :3, 3]

    @property
    def formulas(self) -> dict[str, Computed]:
        """The tip with table 1 in the modified convention, in the standard one, and by the plane's trigonometry.

        These are its x at `at`, by two links, and its distance from the column, by the law of cosines.
        """
        th1, th2 = np.deg2rad(self.at[:2]).tolist()
        bent = np.array([(0.0, th2_deg, 0.0, 0.0) for th2_deg in _BENT_DEG])
        (x_modified, *modified), (x_standard, *standard) = (
            [self._tip_mm(np.array([self.at]), convention)[0, 0], *np.hypot(*self._tip_mm(bent, convention)[:, :2].T)]
            for convention in (Convention.MODIFIED, Convention.STANDARD)
        )
        sides_mm = [(L1_MM**2 + L2_MM**2 + 2 * L1_MM * L2_MM * cos(radians(angle))) ** 0.5 for angle in _BENT_DEG]
        return {
            "x": Computed(x_modified, x_standard, L1_MM * cos(th1) + L2_MM * cos(th1 + th2)),
            **{f"at_{th2_deg:g}": Computed(*distances)
               for th2_deg, *distances in zip(_BENT_DEG, modified, standard, sides_mm, strict=True)},
        }  # fmt: skip

    @property
    def tip_mm(self) -> FloatArray:
        """The tip at `at` by the product of the matrices, of shape (3,)."""
        return np.asarray(self._tip_mm(np.array([self.at]))[0])

    @cached_property
    def positions(self) -> FloatArray:
        """Six joint positions, the second of them `at`, of shape (6, 4)."""
        others = ((90, -90, 120, 0), (-45, 60, 10, -90), (60, 120, 200, 180), (-120, -145, 75.5, 33.3))
        return np.array([(0.0, 0.0, 0.0, 0.0), self.at, *others], dtype=np.float64)

    @cached_property
    def random_joints(self) -> FloatArray:
        """Joint positions within the limits, of shape (1000, 4), from a fixed seed."""
        lower, upper = ([getattr(joint, end) for joint in self.robot.joints] for end in ("lower", "upper"))
        return np.random.default_rng(1).uniform(lower, upper, (_RANDOM, len(self.robot.joints)))

    @property
    def apart(self) -> Figures:
        """Largest distances of the computed tip from the drawn one and from the closed form's, in mm."""
        joints, computed_mm = self.random_joints, self._tip_mm(self.random_joints)
        drawn_mm, closed_mm = self.kinematics.links(joints)[-1].points_mm[:, -1], self.kinematics.forward(joints)[:, :3]
        return {
            "drawn": float(np.linalg.norm(drawn_mm - computed_mm, axis=1).max()),
            "closed_form": float(np.linalg.norm(closed_mm - computed_mm, axis=1).max()),
        }

    @property
    def pose_rows(self) -> Rows:
        """Poses, and the joints of the other elbow."""
        rows = []
        for joints in self.positions:
            pose = self.kinematics.forward(joints[np.newaxis])
            other = self.kinematics.solve(pose, "left" if joints[1] >= 0 else "right")
            reached = "yes" if other.reachable[0] else "no"
            numbers = (*pose[0].tolist(), *other.joints[0, [0, 1, 3]].tolist())
            rows.append([" ".join(f"{joint:g}" for joint in joints), reached, *texts(numbers)])
        return rows

    @property
    def verification_picture(self) -> "Figure":
        """The drawn arm with its column and the computed tip in four positions."""
        from steptwin.host.record.plots.in_space import draw_positions_in_space

        joints = self.positions[1:5]
        return draw_positions_in_space(self.robot, joints, self._tip_mm(joints), "tip by the matrices")

    @cached_property
    def identified(self) -> Identification:
        """The parameters identified from simulated measurements of an arm with errors."""
        measured = simulate_measurements(replace(self.robot, dh_errors=DISTURBED), MEASURED, NOISE_MM, seed=1)
        return identify_errors(Chain.of(self.robot), measured)

    @property
    def calibrated(self) -> Figures:
        """The calibration: what it tells apart, residuals in mm rms, and the worst parameter's error in sigma."""
        found = self.identified
        true = {f"{link}.{q}": getattr(errors, q) for link, errors in DISTURBED.items() for q in QUANTITIES}
        off = (abs(one.found - true.get(one.name, 0.0)) / one.deviation for one in found.parameters if one.deviation)
        return {
            "rank": found.rank,
            "nominal_mm": rms_mm(found.before_mm),
            "identified_mm": rms_mm(found.after_mm),
            "largest_sigma": float(max(off)),
        }

    @property
    def sensitivity_rows(self) -> Rows:
        """The derivatives of the tool by each parameter at `at`."""
        chain = Chain.of(self.robot)
        moves = chain.sensitivities(np.array([self.at]))[0].T
        return [[name, *texts(row)] for name, row in zip(chain.parameters, moves.tolist(), strict=True)]

    @property
    def synthesis_rows(self) -> Rows:
        """Rows of the tool's move: each error's linear part, their sum, the exact move, and what the sum lacks."""
        chain = Chain.of(replace(self.robot, dh_errors=DISTURBED))
        together = chain.synthesis(np.array([self.at]))
        wrong = np.flatnonzero(chain.errors.ravel())
        moves = {chain.parameters[i]: together.parts[0, :, i] for i in wrong}
        moves |= {"sum": together.linear[0], "exact": together.exact[0]}
        moves |= {"lacking": (together.exact - together.linear)[0]}
        return [[name, *texts(move.tolist())] for name, move in moves.items()]
