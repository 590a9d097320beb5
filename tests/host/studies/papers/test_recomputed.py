"""Every number on the papers' pages, computed again from the papers' geometry in plain Python, without the project's.

No job is run here: the numbers of runs are the verifier's, which has oracles of its own.
"""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from math import acos, asin, atan2, cos, degrees, floor, hypot, pi, radians, sin, sqrt
from typing import Any

import pytest
import scipy

from steptwin.host.studies.papers import PAPERS, Runs
from steptwin.host.studies.papers.paper import Formula, Value

Numbers = tuple[float, ...]


@cache
def study(robot: str) -> Any:
    return PAPERS[robot].study(Runs())


def value(robot: str, what: str) -> Value:
    (found,) = (one for item in PAPERS[robot].items for one in item.values if one.what == what)
    return found


def ours(robot: str, what: str) -> float:
    return float(value(robot, what).ours(study(robot)))


def rows(robot: str, title: str) -> list[list[str]]:
    """Return the rows of the listing whose title begins so."""
    (found,) = (one for item in PAPERS[robot].items for one in item.listings if one.title.startswith(title))
    listed: list[list[str]] = found.rows(study(robot))
    return listed


def formulas(robot: str, what: str) -> list[Formula]:
    return [one for erratum in PAPERS[robot].errata for one in erratum.formulas if one.what.startswith(what)]


def check_formula(robot: str, what: str, printed: float | None, corrected: float, tolerance: float = 1e-6) -> None:
    """Compare a formula with both numbers; a printed one that has no value is NaN."""
    (formula,) = formulas(robot, what)
    numbers = formula.compute(study(robot))
    if printed is None:
        assert numbers.printed != numbers.printed
    else:
        assert numbers.printed == pytest.approx(printed, abs=tolerance)
    assert numbers.corrected == pytest.approx(corrected, abs=tolerance)
    assert numbers.truth == pytest.approx(corrected, abs=max(tolerance, formula.tolerance))


def two_links(x: float, y: float, l1: float, l2: float, side: int = 1) -> tuple[float, float]:
    """Return both angles in degrees, by half-angle formulas."""
    r = hypot(x, y)
    th2 = side * 2 * atan2(sqrt((l1 + l2) ** 2 - r**2), sqrt(r**2 - (l1 - l2) ** 2))
    return degrees(atan2(y, x) - atan2(l2 * sin(th2), l1 + l2 * cos(th2))), degrees(th2)


def rounded(joints: Sequence[Numbers], steps_per_unit: Numbers) -> list[list[int]]:
    return [[floor(q * spu + 0.5) for q, spu in zip(row, steps_per_unit, strict=True)] for row in joints]


def counted(steps: Sequence[Sequence[int]]) -> list[int]:
    columns = list(zip(*steps, strict=True))
    return [sum(abs(b - a) for a, b in pairwise(column)) for column in columns]


def back(steps: Sequence[Sequence[int]], steps_per_unit: Numbers) -> list[Numbers]:
    return [tuple(n / spu for n, spu in zip(row, steps_per_unit, strict=True)) for row in steps]


class TestLab:
    """400 + 400 mm, the lift first, at 0 along +y; the tool 150 mm below."""

    SPU = (80.0, 400 / 9, 400 / 9, 80 / 9)

    @staticmethod
    @cache
    def points() -> list[Numbers]:
        us = [0.05 * k for k in range(377)]
        return [(-300 + 5 * u * cos(u), 400 + 5 * u * sin(u), u / 2) for u in us]

    @classmethod
    @cache
    def joints(cls) -> list[Numbers]:
        rows: list[Numbers] = []
        for x, y, z in cls.points():
            th1, th3 = two_links(x, y, 400, 400)
            rows.append((z + 150, th1 - 90, th3, th1 + th3))
        return rows

    @staticmethod
    def tip(joints: Numbers) -> Numbers:
        d1, th2, th3, _ = joints
        a, b = radians(th2), radians(th2 + th3)
        return (-400 * sin(a) - 400 * sin(b), 400 * cos(a) + 400 * cos(b), d1 - 150)

    def errors(self) -> list[float]:
        stepped = back(rounded(self.joints(), self.SPU), self.SPU)
        return [sqrt(sum((a - b) ** 2 for a, b in zip(self.tip(q), p, strict=True)))
                for q, p in zip(stepped, self.points(), strict=True)]  # fmt: skip

    def test_mistakes(self) -> None:
        c4, s4, c23, s23 = cos(pi / 3), sin(pi / 3), cos(radians(75)), sin(radians(75))
        check_formula("lab-scara", "o_x", c4 * c23 - s4 * s23, cos(radians(15)))
        check_formula("lab-scara", "length of column o", hypot(c4 * c23 - s4 * s23, sin(radians(15))), 1.0)
        check_formula("lab-scara", "p_z", 300.0, 0.0)
        check_formula("lab-scara", "th2 with", 75.0, 30.0)
        check_formula("lab-scara", "th4 with", 75 - degrees(atan2(sin(radians(15)), -cos(radians(15)))), 60.0)

    def test_workspace(self) -> None:
        assert ours(
            "lab-scara", "greatest distance of the tool from joint 2's axis: the reach, 400 + 400"
        ) == pytest.approx(800, abs=1e-6)
        assert ours("lab-scara", "the tool's way from lowest to highest: the stroke") == pytest.approx(250)
        assert [
            ours("lab-scara", f"{end} tool, at d1 = {at}") for end, at in (("lowest", "0"), ("highest", "250 mm"))
        ] == [-150.0, 100.0]
        least_mm = 800 * cos(radians(65))
        assert ours("lab-scara", "least distance, at th3 = 130 deg") == pytest.approx(least_mm, abs=1e-6)

    def test_spiral(self) -> None:
        assert ours("lab-scara", "points in three turns of 0.05 rad") == 1 + sum(
            0.05 * k <= 6 * pi for k in range(1, 400)
        )
        assert ours("lab-scara", "rise, law A: pi mm a turn") == pytest.approx(18.8 / 2)
        assert ours("lab-scara", "rise, law B: pi mm a radian") == pytest.approx(18.8 * pi)
        ways = [[abs(b - a) for a, b in zip(p, q, strict=True)]
                for p, q in zip(self.joints(), self.joints()[1:], strict=False)]  # fmt: skip
        fastest_s = max(max(way[0] / 140, *(angle / 130 for angle in way[1:])) for way in ways)
        what = "shortest time from point to point at table 1's speeds"
        assert ours("lab-scara", what) == pytest.approx(1000 * fastest_s, abs=1e-6)
        limits = ((0, 250), (-150, 150), (-130, 130), (-360, 360))
        for row, axis, limit in zip(rows("lab-scara", "The spiral's joints"), zip(*self.joints(), strict=True), limits,
                                    strict=True):  # fmt: skip
            assert [float(cell) for cell in row[1:]] == pytest.approx([min(axis), max(axis), *limit], abs=5e-4)
            assert limit[0] <= min(axis) <= max(axis) <= limit[1]

    def test_round_trip(self) -> None:
        assert max(abs(a - b) for q, p in zip(self.joints(), self.points(), strict=True)
                   for a, b in zip(self.tip(q), p, strict=True)) < 1e-9  # fmt: skip
        errors_mm = self.errors()
        stepped = "position with joints in whole steps, "
        assert ours("lab-scara", f"{stepped}largest error") == pytest.approx(max(errors_mm), abs=1e-9)
        rms_mm = sqrt(sum(error**2 for error in errors_mm) / 377)
        assert ours("lab-scara", f"{stepped}rms") == pytest.approx(rms_mm, abs=1e-9)
        stepped_joints = back(rounded(self.joints(), self.SPU), self.SPU)
        turned = [radians(90 + th2 + th3 - th4) for _, th2, th3, th4 in stepped_joints]
        worst = max(max(abs(cos(angle) - 1), abs(sin(angle))) for angle in turned)
        what = "direction cosines with joints in whole steps, largest error"
        assert ours("lab-scara", what) == pytest.approx(worst, abs=1e-12)


class TestWarehouse:
    """200 + 150 + 40 mm; 180 mm in 10 s, with ramps of 2 s."""

    SPU = (400 / 9, 400 / 9, 80 / 3)
    Y0 = 150 * sqrt(3) / 2 + 40

    @staticmethod
    def way(t: float) -> float:
        """Integrate the trapezoidal speed of 22.5 mm/s."""
        ramp = min(t, 2.0)
        after = max(t - 8.0, 0.0)
        return 22.5 * (ramp**2 / 4 + max(min(t, 8.0) - 2.0, 0.0) + after - after**2 / 4)

    @classmethod
    @cache
    def joints(cls) -> list[Numbers]:
        rows: list[Numbers] = []
        for k in range(1001):
            th1, th2 = two_links(275.0, cls.Y0 - 40 - cls.way(k / 100), 200, 150)
            rows.append((th1, th2, 90 - th1 - th2))
        return rows

    @staticmethod
    def tip(joints: Numbers) -> tuple[float, float]:
        a, b, c = radians(joints[0]), radians(sum(joints[:2])), radians(sum(joints))
        return (
            200 * cos(a) + 150 * cos(b) + 40 * cos(c), 200 * sin(a) + 150 * sin(b) + 40 * sin(c)
        )  # fmt: skip

    def test_figure_6(self) -> None:
        assert ours("warehouse-scara", "y at the start") == pytest.approx(self.Y0, abs=1e-9)
        assert ours("warehouse-scara", "y at the end") == pytest.approx(self.Y0 - 180, abs=1e-9)
        assert ours("warehouse-scara", "way along y") == pytest.approx(180.0, abs=1e-9)
        names = ("P_x of eq. 1 with L5 = 40", "P_y of eq. 1 with L5 = 40", "P_z = L1 - L4")
        assert [ours("warehouse-scara", name) for name in names] == pytest.approx([275.0, self.Y0, 60.0])
        assert abs(ours("warehouse-scara", "x, largest change")) < 1e-9
        assert abs(ours("warehouse-scara", "phi, largest change")) < 1e-9

    def test_mistakes(self) -> None:
        robot, wrist_y = "warehouse-scara", self.Y0 - 40
        square = 275**2 + 235**2
        check_formula(robot, "cos beta", (square + 17500) / (400 * sqrt(square)), cos(atan2(wrist_y, 275)))
        check_formula(robot, "beta", None, degrees(atan2(wrist_y, 275)))
        mirrored = -(wrist_y - 180) * 2
        check_formula(robot, "tool off the drawer's line", mirrored, 0.0)
        check_formula(robot, "S at t1", 45.0, self.way(2.0))
        check_formula(robot, "S at T - t1 / 2", 180.0, self.way(9.0))
        (at_the_end,) = (one for one in formulas(robot, "S at T") if one.what == "S at T")
        numbers = at_the_end.compute(study(robot))
        assert numbers.printed == pytest.approx(202.5)
        assert numbers.corrected == pytest.approx(self.way(10.0)) == pytest.approx(180.0)
        check_formula(robot, "time of 1 000 steps", 1.0, 10.0)
        check_formula(robot, "y at the end", self.Y0 + 180, self.Y0 - 180, 0.2)
        check_formula(robot, "attitude at n = 500", 45.0, 90.0)

    def test_joints(self) -> None:
        joints = self.joints()
        for axis, name in enumerate(("th1", "th2", "th3")):
            peak = max(abs(b[axis] - a[axis]) for a, b in pairwise(joints)) / 0.01
            assert ours("warehouse-scara", f"peak speed of {name}") == pytest.approx(peak, abs=1e-6)
            pulses = counted(rounded(joints, self.SPU))[axis]
            assert ours("warehouse-scara", f"pulses of {name} in the samples") == pulses
        stepped = back(rounded(joints, self.SPU), self.SPU)
        off_mm = max(hypot(*(a - b for a, b in zip(self.tip(p), self.tip(q), strict=True)))
                     for p, q in zip(joints, stepped, strict=True))  # fmt: skip
        what = "tool off with joints in whole steps, max"
        assert ours("warehouse-scara", what) == pytest.approx(off_mm, abs=1e-9)

    def test_times(self) -> None:
        crossing_s = 2.0 + (self.Y0 - 40 - 22.5) / 22.5
        assert ours("warehouse-scara", "time at which the wrist crosses y = 0") == pytest.approx(crossing_s, abs=1e-6)
        for name, way_mm in (("first", 60), ("second", 120)):
            out_s = 1.0 + way_mm / 22.5
            assert ours("warehouse-scara", f"{name} cell out") == pytest.approx(out_s, abs=1e-6)
        assert ours("warehouse-scara", "third cell out") == pytest.approx(10.0, abs=1e-3)
        assert ours("warehouse-scara", "speed between the ramps") == pytest.approx(180 / 8)


class TestTeaching:
    """95 + 100 mm; from qa to qb in 1 s."""

    SPU = (320 / 9, 320 / 9, 320.0, 160 / 9)
    QA = (-0.000062, 0.000178, 0.0, -0.000117)
    QB = (-0.522315, 1.504080, 0.0, -0.981765)

    def joints(self) -> list[Numbers]:
        times = [0.015 * k for k in range(67)] + [1.0]
        return [
            tuple(degrees(a + (b - a) * (3 - 2 * t) * t * t) for a, b in zip(self.QA, self.QB, strict=True))
            for t in times
        ]

    @staticmethod
    def tip(joints: Numbers) -> tuple[float, float]:
        a, b = radians(joints[0]), radians(joints[0] + joints[1])
        return 95 * cos(a) + 100 * cos(b), 95 * sin(a) + 100 * sin(b)

    def test_mistakes(self) -> None:
        robot = "teaching-scara"
        x, y = self.tip((30.0, 60.0))
        assert x * cos(pi / 6) + y / 2 == pytest.approx(95 + 100 * cos(pi / 3))
        assert ours(robot, "p_x = l1 cos th1 + l2 cos(th1 + th2)") == pytest.approx(x)
        assert ours(robot, "p_y = l1 sin th1 + l2 sin(th1 + th2)") == pytest.approx(y)
        check_formula(robot, "d3", 60.0, 20.0)
        check_formula(robot, "sin(phi - th1)", sin(radians(45)), sin(radians(75)))
        at_the_ends = ours(robot, "largest acceleration at an end, cubic")
        assert at_the_ends == pytest.approx(6 * degrees(self.QB[1] - self.QA[1]))
        assert abs(ours(robot, "largest acceleration at an end in the test, law quintic")) < 1e-9
        joints = self.joints()
        check_formula(robot, "th2 at the last sample", joints[66][1], degrees(self.QB[1]))

    def test_points(self) -> None:
        assert ours("teaching-scara", "l2 / l1 of an arm that has qb at y = 0") == pytest.approx(3 / 5, abs=1e-5)
        assert ours("teaching-scara", "x at qb of that arm, in parts of the stretched arm") == pytest.approx(
            6 / 8, abs=1e-5
        )
        for name, angle in (("th1", -asin(sqrt(1 - (13 / 15) ** 2))), ("th2", acos(1 / 15)), ("th4", -acos(5 / 9))):
            assert ours("teaching-scara", f"{name} at the end of the motion") == pytest.approx(angle, abs=1e-6)
        goal = self.tip(tuple(map(degrees, self.QB)))
        assert [ours("teaching-scara", f"{axis} at qb with 95 and 100 mm") for axis in "xy"] == pytest.approx(goal)
        assert ours("teaching-scara", "det J at qa") == pytest.approx(9500 * sin(0.000178))

    def test_motion(self) -> None:
        robot, joints = "teaching-scara", self.joints()
        for axis, name in ((0, "th1"), (1, "th2")):
            way_rad = self.QB[axis] - self.QA[axis]
            coefficients = (self.QA[axis], 0.0, 3 * way_rad, -2 * way_rad)
            assert rows(robot, "Eqs. 25 to 28")[axis] == [name, *(f"{value:.6f}" for value in coefficients)]
        way_deg = degrees(self.QB[1] - self.QA[1])
        assert ours(robot, "peak speed of th2, cubic") == pytest.approx(1.5 * way_deg)
        assert ours(robot, "peak speed of th2, quintic") == pytest.approx(1.875 * way_deg)
        jtraj = ours(robot, "peak speed of th2, `jtraj` in the 0.99 s of its samples")
        assert jtraj == pytest.approx(163.195525, abs=0.2)  # jtraj's own figure is a mean over a sample
        for axis, name in ((0, "th1"), (1, "th2"), (3, "th4")):
            assert ours(robot, f"pulses of {name} in the samples") == counted(rounded(joints, self.SPU))[axis]
        stepped = back(rounded(joints, self.SPU), self.SPU)
        off_mm = max(hypot(*(a - b for a, b in zip(self.tip(p), self.tip(q), strict=True)))
                     for p, q in zip(joints, stepped, strict=True))  # fmt: skip
        assert ours(robot, "tool off with joints in whole steps, max") == pytest.approx(off_mm, abs=1e-9)


class TestCalibration:
    """250 + 350 mm on a column of 300 mm."""

    def test_closed_form(self) -> None:
        robot = "calibration-scara"
        x, y = (250 * f(radians(30)) + 350 * f(radians(75)) for f in (cos, sin))
        assert [ours(robot, name) for name in ("x", "y", "z", "psi")] == pytest.approx([x, y, 250.0, 55.0])
        assert ours(robot, "a_z: the tool points down") == pytest.approx(-1.0)

    def test_mistakes(self) -> None:
        robot = "calibration-scara"
        x_mm = 250 * cos(radians(30)) + 350 * cos(radians(75))
        check_formula(robot, "x of the tip", self.modified_x_mm(30.0, 45.0), x_mm)
        for th2_deg in (45.0, 145.0):
            distance_mm = hypot(250 + 350 * cos(radians(th2_deg)), 350 * sin(radians(th2_deg)))
            check_formula(robot, f"distance of the tip from the column at th2 = {th2_deg:g}", 600.0, distance_mm)

    @staticmethod
    def modified_x_mm(th1_deg: float, th2_deg: float) -> float:
        """Return x of a chain that goes 250 mm along x before it turns by th1, and 350 mm before it turns by th2."""
        del th2_deg
        return 250 + 350 * cos(radians(th1_deg))

    def test_drawn_and_computed_arm(self) -> None:
        for what in ("drawn and computed tip", "closed form and matrices"):
            assert ours("calibration-scara", f"{what} apart, largest of 1000 random positions") < 1e-9

    def test_calibration(self) -> None:
        """The sensitivities by differences of the plane arm; the residuals of 50 poses show the noise of 0.02 mm."""
        (listing,) = (one for item in PAPERS["calibration-scara"].items for one in item.listings
                      if one.title == "Transfer coefficients")  # fmt: skip
        rows = {name: [float(cell) for cell in cells] for name, *cells in listing.rows(study("calibration-scara"))}
        a, b = radians(30), radians(75)
        assert rows["link1.a_mm"][:3] == pytest.approx([cos(a), sin(a), 0.0], abs=1e-6)
        assert rows["link2.a_mm"][:3] == pytest.approx([cos(b), sin(b), 0.0], abs=1e-6)
        turned = [radians(1) * move for move in (-350 * sin(b), 350 * cos(b), 0.0)]
        assert rows["link2.theta_deg"][:3] == pytest.approx(turned, abs=1e-6)
        assert rows["link1.d_mm"] == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        assert ours("calibration-scara", "parameters of the model") == 16
        rank = ours("calibration-scara", "parameters that measured positions tell apart")
        assert 0 < rank < 16
        expected_mm = 0.02 * sqrt(3 * (1 - rank / 150))
        rms_mm = ours("calibration-scara", "tool off the identified model, rms")
        assert rms_mm == pytest.approx(expected_mm, rel=0.25)
        assert ours("calibration-scara", "tool off the nominal model, rms") > 10 * expected_mm
        assert ours("calibration-scara", "an identified parameter off the true one, most") < 4


class TestHybrid:
    """h 150, L 350, l1 400, l2 100, l3 300, l4 120; a helix of four turns, radius 80 mm about (350, 150)."""

    SPU = (400 / 9, 160.0, 160.0, 80 / 9)

    @staticmethod
    def inverse(x: float, y: float, z: float) -> Numbers:
        z2, z3 = hypot(x, y) - 400, z - 400 + 120
        left, right = (z3 - sqrt(350**2 - (z2 + side * 150) ** 2) for side in (1, -1))
        th1 = degrees(atan2(y, x))
        return th1, left, right, -th1

    @staticmethod
    def tip(joints: Numbers) -> Numbers:
        """Find the platform above both sliders as the apex of an isosceles triangle, then go out by the waist."""
        th1, left, right, _ = joints
        half = (300.0, right - left)
        length = hypot(*half)
        height = sqrt(350**2 - (length / 2) ** 2)
        z2 = -height * half[1] / length
        z3 = (left + right) / 2 + height * half[0] / length
        rho = 400 + z2
        return rho * cos(radians(th1)), rho * sin(radians(th1)), 400 + z3 - 120

    @staticmethod
    def helix(t: float) -> Numbers:
        w = 2 * pi * t / 20
        return 350 + 80 * cos(w), 150 + 80 * sin(w), 500 + 3 * t

    def off_mm(self, joints: Numbers, other: Numbers) -> float:
        return sqrt(sum((a - b) ** 2 for a, b in zip(self.tip(joints), other, strict=True)))

    def test_samples(self) -> None:
        joints = [self.inverse(*self.helix(k / 3)) for k in range(241)]
        assert max(self.off_mm(q, self.helix(k / 3)) for k, q in enumerate(joints)) < 1e-9
        pulses = counted(rounded(joints, self.SPU))
        for axis, name in enumerate(("th1", "Z5", "Z6", "th4")):
            assert ours("hybrid-arm", f"pulses of {name} in the 241 samples") == pulses[axis]
        stepped = back(rounded(joints, self.SPU), self.SPU)
        off_mm = max(self.off_mm(q, self.tip(p)) for p, q in zip(joints, stepped, strict=True))
        assert ours("hybrid-arm", "tool off with joints in whole steps, max") == pytest.approx(off_mm, abs=1e-9)

    def test_between_the_samples(self) -> None:
        """The job's splines go through whole milliseconds and rest at the ends, so they differ in the fifth digit."""
        t_s = [k / 3 for k in range(241)]
        joints = [self.inverse(*self.helix(t)) for t in t_s]
        between = [2 + 76 * k / 4800 for k in range(4801)]
        for curve, what, tolerance in (
            (scipy.interpolate.Akima1DInterpolator(t_s, joints), "joints on Akima's splines", 1e-4),
            (scipy.interpolate.make_interp_spline(t_s, joints, k=1), "straight lines in the joints", 1e-4),
        ):
            off_mm = max(self.off_mm(tuple(q), self.helix(t)) for t, q in zip(between, curve(between), strict=True))
            assert ours("hybrid-arm", f"tool off the helix, {what}, max") == pytest.approx(off_mm, abs=tolerance)

    def test_points(self) -> None:
        robot = "hybrid-arm"
        second = study(robot).points[1, :3].tolist()
        th1, left, right, _ = self.inverse(*second)
        assert ours(robot, "Z5 by the fragment, completed by the root") == pytest.approx(left)
        assert ours(robot, "Z6 by the fragment, completed by the root") == pytest.approx(right)
        for joints, pose in zip(study(robot).point_joints.tolist(), study(robot).points.tolist(), strict=True):
            assert joints == pytest.approx(self.inverse(*pose[:3]), abs=1e-9)
            assert self.off_mm(tuple(joints), pose[:3]) < 1e-9
        points = rows(robot, "Tables 2 and 3")
        assert [float(cell) for cell in points[1]] == pytest.approx([2, *second, th1, left, right, -th1], abs=1e-6)
        simulated = [[float(cell) for cell in row] for row in rows(robot, "Table 5")]
        assert simulated[1][:4] == pytest.approx([2, th1, left, right], abs=1e-6)
        assert max(row[4] for row in simulated) < 1e-9
        driven = [[float(cell) for cell in row] for row in rows(robot, "Table 6")]
        assert driven[1][:4] == pytest.approx([2, *second], abs=1e-6)
        assert max(row[4] for row in driven) < 1e-9


RUNS = {
    "tool off the plan by the counted steps, max",
    "checks of the run that failed",
    "duration of `store`",
    "duration of `fetch`",
    "checks of `store` that failed",
    "checks of `fetch` that failed",
    "T",
    "duration",
}
"""Values that need a run."""


@pytest.mark.parametrize(
    "robot",
    [
        pytest.param(name, marks=pytest.mark.slow if name in ("warehouse-scara", "hybrid-arm") else ())
        for name in PAPERS
    ],
)
def test_what_needs_no_run_agrees_with_the_paper(robot: str) -> None:
    values = [one for item in PAPERS[robot].items for one in item.values if one.what not in RUNS]
    compared = [one for one in values if one.expected is not None]
    assert compared
    for one in compared:
        assert abs(one.ours(study(robot)) - (one.expected or 0.0)) <= one.tolerance, one.what


@pytest.mark.parametrize("robot", PAPERS)
def test_every_mistake_that_is_computed_is_one(robot: str) -> None:
    found = [one for erratum in PAPERS[robot].errata for one in erratum.formulas]
    assert bool(found) is (robot != "hybrid-arm")  # whose formulas are lost in our copy
    for one in found:
        printed, corrected, truth = one.compute(study(robot))
        assert abs(corrected - truth) <= one.tolerance, one.what
        assert not abs(printed - truth) <= one.tolerance, one.what
