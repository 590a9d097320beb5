"""Compare fastest motions with toppra, with the look-ahead of a G-code controller, and with their own growth.

All machines here have the jerk of an averaging time of 0.01 s. The look-ahead is written here anew, after the formulas
of Klipper's toolhead: a speed in each corner and trapezoids between them, whose acceleration jumps.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, Final

import numpy as np
import scipy
import toppra
from rich.table import Table
from toppra.algorithm import TOPPRA
from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint

from steptwin.bench import bench_table
from steptwin.bench.fastest_motions import PICK, glue_legs
from steptwin.features.fastest.chain import timed_chains
from steptwin.features.fastest.corners import JointLeg, MotionLeg, ToolLeg, flowing
from steptwin.features.fastest.executed import timed
from steptwin.features.fastest.flow_path import FlowPath
from steptwin.features.fastest.pieces import FollowedPath, JointPiece, PiecewisePath
from steptwin.features.fastest.rows import machine_average_s, with_axes
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.findings import Findings
from steptwin.host.common.planning_time import plan_within
from steptwin.host.planning.motions.tool_move import present_branch
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.paths import straight
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot

toppra.setup_logging("ERROR")
AVERAGE_S: Final = 0.01
FEED_MM_S: Final = 150.0
CORNER_MM_S: Final = 5.0
"""Speed of the look-ahead in a corner of 90 degrees: Klipper's default."""
SPLINES: Final = 7


def with_jerk(name: str) -> Robot:
    """Return a robot whose joints have the jerk of the averaging time."""
    robot = load_robot(name)
    joints = (replace(each, jerk_max=2.0 * each.acceleration_max / AVERAGE_S) for each in robot.joints)
    return replace(robot, joints=tuple(joints))


COREXY: Final = with_jerk("corexy-gantry")
TEACHING: Final = with_jerk("teaching-scara")
AR4: Final = with_jerk("ar4-mk3")


# --- beside toppra


def toppra_table() -> Table:
    """Compare 26 motions with the optimum that toppra finds for the same path and limits, whose acceleration jumps."""
    rows, ratios = list[str](), list[float]()
    for name, robot, path, lasts_s in (*_moves(), *_chains(), *_splines()):
        best_s = by_toppra(robot, path)
        ratios.append(lasts_s / best_s)
        rows.append(f"{name}|{lasts_s:.3f}|{best_s:.3f}|{ratios[-1]:.3f}")
    rows.append(f"{len(ratios)} motions: median {median(ratios):.3f}, worst {max(ratios):.3f}|||")
    return bench_table("Fastest motions beside toppra, averaged over 0.01 s", "motion|lasts s|toppra s|ratio", rows)


_Case = tuple[str, Robot, FlowPath | PiecewisePath, float]


def _moves() -> Iterator[_Case]:
    """Yield eleven straight moves of joints."""
    lab, parol = with_jerk("lab-scara"), with_jerk("parol6")
    travels: list[tuple[str, Robot, Sequence[float]]] = [
        ("corexy-gantry, X by 2 mm", COREXY, (2, 0, 0)),
        ("corexy-gantry, X by 20 mm", COREXY, (20, 0, 0)),
        ("corexy-gantry, X by 200 mm", COREXY, (200, 0, 0)),
        ("corexy-gantry, X and Y by 100 mm", COREXY, (100, 100, 0)),
        ("teaching-scara, th1 by 5 deg", TEACHING, (5, 0, 0, 0)),
        ("teaching-scara, th1 by 90 deg", TEACHING, (90, 0, 0, 0)),
        ("teaching-scara, all joints", TEACHING, (60, -40, 20, 90)),
        ("ar4-mk3, J1 by 3 deg", AR4, (3, 0, 0, 0, 0, 0)),
        ("ar4-mk3, all joints", AR4, (60, 20, -25, 40, 30, 90)),
        ("lab-scara, all joints", lab, (60, 60, -70, 90)),
        ("parol6, all joints", parol, (40, 30, 20, 60, 50, 90)),
    ]
    for name, robot, travel in travels:
        start = np.array(robot.home)
        leg = JointLeg(robot, start, start + np.array(travel, float), Pace())
        yield _case(name, robot, [leg], [])


def _chains() -> Iterator[_Case]:
    """Yield eight motions of several legs, or of the tool."""
    pick = [JointLeg(TEACHING, start, goal, Pace()) for start, goal in pairwise(PICK)]
    yield _case("teaching-scara, pick and place, corners of 20 mm", TEACHING, pick, [20.0] * 2)
    yield _case("teaching-scara, pick and place, corners of 5 mm", TEACHING, pick, [5.0] * 2)
    glue = glue_legs(Pace())
    yield _case("teaching-scara, glue of lines and arcs", TEACHING, glue, [0.0] * (len(glue) - 1))
    here = np.array([20.0, 80.0, 20.0, 0.0])
    ways = [(-10.0, 0.0, 0.0), (0.0, 10.0, 0.0)] * 4
    yield _case(
        "teaching-scara, zigzag of 10 mm, corners of 2 mm", TEACHING, tool_legs(TEACHING, here, ways), [2.0] * 7
    )
    head = np.array([50.0, 50.0, 20.0])
    box = [(60.0, 0.0, 0.0), (0.0, 40.0, 0.0), (-60.0, 0.0, 0.0), (0.0, -40.0, 0.0)]
    for r_mm in (2.0, 10.0):
        legs = tool_legs(COREXY, head, box)
        yield _case(f"corexy-gantry, rectangle, corners of {r_mm:g} mm", COREXY, legs, [r_mm] * 3)
    yield _case("corexy-gantry, line of 100 mm", COREXY, tool_legs(COREXY, head, [(80.0, 60.0, 0.0)]), [])
    arm = np.array([0.0, 0.0, 0.0, 10.0, 60.0, 0.0])
    yield _case("ar4-mk3, line of 50 mm", AR4, tool_legs(AR4, arm, [(0.0, 40.0, 30.0)]), [])


def tool_legs(robot: Robot, start: FloatArray, ways_mm: Sequence[Sequence[float]]) -> list[ToolLeg]:
    """Return lines of the tool from joints on, each by a way in mm, the orientation kept."""
    kinematics = make_kinematics(robot)
    branch, joints, legs = present_branch(robot, start), start, list[ToolLeg]()
    pose = kinematics.forward(start[np.newaxis])[0]
    for way_mm in ways_mm:
        goal = pose.copy()
        goal[:3] += way_mm
        path = straight(kinematics.task, tuple(pose.tolist()), tuple(goal.tolist()))
        legs.append(ToolLeg(FollowedPath.along(robot, path, branch, joints), Pace()))
        pose, joints = goal, legs[-1].followed.end
    return legs


def _case(name: str, robot: Robot, legs: Sequence[MotionLeg], radii_mm: list[float]) -> _Case:
    lasts_s = timed_chains(robot, legs, radii_mm)[-1].timed.law.duration_s
    return name, robot, flowing(robot, legs, radii_mm).path, lasts_s


def _splines() -> Iterator[_Case]:
    """Yield curves through six random positions of the joints."""
    random = np.random.default_rng(7)
    for number in range(1, SPLINES + 1):
        robot = (TEACHING, COREXY, AR4)[number % 3]
        home, reach = np.array(robot.home), 0.3 * np.array([each.upper - each.lower for each in robot.joints])
        rows = home + random.uniform(-0.5, 0.5, (6, len(home))) * reach
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1))])
        coarse, fine = scipy.interpolate.CubicSpline(s, rows), np.linspace(0.0, s[-1], 400)
        curve = scipy.interpolate.CubicSpline(fine, coarse(fine))
        path = PiecewisePath(robot, (JointPiece.through(robot, curve, Pace()),))
        made = timed(robot, path, machine_average_s(robot, path.rates()))
        yield f"spline {number}, {robot.name}", robot, path, made.law.duration_s


class _Geometry(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
    """The joints and axes of one of our paths, and its own parameter, as toppra asks for them."""

    def __init__(self, robot: Robot, path: FlowPath | PiecewisePath) -> None:
        self._robot, self._path = robot, path

    def __call__(self, s: Any, order: int = 0) -> FloatArray:
        at, path = np.atleast_1d(np.asarray(s, np.float64)), self._path
        which = np.clip(np.searchsorted(path.starts, at, side="right") - 1, 0, len(path.pieces) - 1)
        joints = np.empty((len(at), len(self._robot.joints)))
        for piece in np.unique(which):
            own = which == piece
            joints[own] = path.pieces[piece].joints(at[own] - path.starts[piece], order)
        values = with_axes(self._robot, joints)
        return values if np.ndim(s) else np.asarray(values[0])

    @property
    def dof(self) -> int:
        return len(self._robot.joints) + len(self._robot.axes)

    @property
    def path_interval(self) -> FloatArray:
        return np.array([0.0, self._path.starts[-1]])


def by_toppra(robot: Robot, path: FlowPath | PiecewisePath) -> float:
    """Return how long toppra's optimum on a path takes within the limits of joints and axes, in s."""
    speeds = np.concatenate([[each.speed_max for each in robot.joints], robot.axis_speeds_max])
    accelerations = np.concatenate([[each.acceleration_max for each in robot.joints], robot.axis_accelerations_max])
    s = path.rates().s
    grid = s[np.concatenate([[True], np.diff(s) > 1e-9])]
    return _optimum_s(_Geometry(robot, path), grid, speeds, accelerations)


def _optimum_s(geometry: Any, grid: FloatArray, speeds: FloatArray, accelerations: FloatArray) -> float:
    scheme = DiscretizationType.Interpolation
    limits = [
        JointVelocityConstraint(np.column_stack([-speeds, speeds])),
        JointAccelerationConstraint(np.column_stack([-accelerations, accelerations]), discretization_scheme=scheme),
    ]
    _, speed, _ = TOPPRA(limits, geometry, gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0, 0)
    return float((2.0 * np.diff(grid) / (speed[:-1] + speed[1:])).sum())


# --- beside a look-ahead


def look_ahead_table() -> Table:
    """Compare parts of G-code at 150 mm/s with a look-ahead, and a rosette with the optimum on a fitted path."""
    rows = list[str]()
    for name, points in (("strokes", strokes()), ("pocket", pocket()), ("rosette", rosette())):
        exact = f"{cut(points, 'G61')[0]:.3f}" if name != "rosette" else "-"
        for p_mm in (0.1, 0.02):
            lasts_s, took_s = cut(points, f"G64 P{p_mm:g}")
            if name == "rosette":
                other_s, other = fitted_optimum_s(points, p_mm), "optimum on a fitted path"
            else:
                other_s, other = look_ahead_s(points), "look-ahead"
            ratio = lasts_s / other_s
            rows.append(f"{name}, P {p_mm:g}|{lasts_s:.3f}|{exact}|{other}|{other_s:.3f}|{ratio:.3f}|{took_s:.2f}")
    return bench_table(
        "G-code of corexy-gantry at 150 mm/s, averaged over 0.01 s",
        "part|lasts s|exact stop s|beside|its s|ratio|planned in s",
        rows,
    )


def strokes() -> FloatArray:
    """Return 63 strokes of 20 mm there and back, 1 mm apart."""
    rows = [(0.0, 0.0)]
    for i in range(63):
        rows.append((float(i), 20.0 * ((i + 1) % 2)))
        rows.append((float(i + 1), rows[-1][1]))
    return np.array(rows[:-1])


def pocket() -> FloatArray:
    """Return a spiral of 40 lines, each second one longer by 3 mm."""
    turns = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
    ways = [3.0 * (i // 2 + 1) * turns[i % 4] for i in range(40)]
    return np.concatenate([np.zeros((1, 2)), np.cumsum(ways, axis=0)])


def rosette() -> FloatArray:
    """Return a curve of six leaves as 1199 short lines."""
    angle = np.linspace(0.0, 2.0 * np.pi, 1200)
    r_mm = 40.0 + 10.0 * np.cos(6.0 * angle)
    places = np.column_stack([r_mm * np.cos(angle) - 50.0, r_mm * np.sin(angle)])
    return np.asarray(np.round(places, 4), np.float64)


_HEAD: Final = """
start = {{ {start} }}
[frames.plate]
x = {x}
y = {y}
z = {z}
[[step]]
gcode = "part.ngc"
frame = "plate"
"""


def cut(points: FloatArray, mode: str) -> tuple[float, float]:
    """Return how long a part of lines lasts, and the processor time of its planning, in s."""
    lines = [f"G1 X{x:.4f} Y{y:.4f}" for x, y in points[1:]]
    head = _HEAD.format(start="X = 125, Y = 125, Z = 20", x=125.0, y=125.0, z=20.0)
    return _compiled(COREXY, head, [f"{mode} F{60.0 * FEED_MM_S:g}", *lines])


def _compiled(robot: Robot, head: str, lines: Sequence[str]) -> tuple[float, float]:
    with TemporaryDirectory() as folder, plan_within(600):
        (Path(folder) / "part.ngc").write_text("\n".join(lines), encoding="utf-8")
        begin_s = process_time()
        compiled = compile_program(parse_program(head, Findings(), Path(folder)), robot)
        return compiled.motion.duration_s, process_time() - begin_s


def look_ahead_s(points: FloatArray, acceleration_mm_s2: float = 3000.0) -> float:
    """Return how long a look-ahead takes for lines: corners have a speed, and between them is a trapezoid.

    The speed of a corner is that of a circle which passes it at a distance: the one at which a right angle is passed at
    `CORNER_MM_S`. The tool's acceleration is limited, but not that of the belts.
    """
    ways = np.diff(points, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    directions = ways / lengths[:, np.newaxis]
    half = np.sqrt(
        np.maximum(0.5 * (1.0 + (directions[1:] * directions[:-1]).sum(axis=1)), 0.0)
    )  # cos of half the turn
    deviation_mm = CORNER_MM_S**2 * (2.0**0.5 - 1.0) / acceleration_mm_s2
    with np.errstate(divide="ignore"):
        by_deviation = deviation_mm * half / (1.0 - half)
        by_length = 0.5 * half / np.sqrt(np.maximum(1.0 - half**2, 1e-30))
    shorter = np.minimum(lengths[:-1], lengths[1:])
    corners = acceleration_mm_s2 * np.minimum(by_deviation, by_length * shorter)
    squares = np.concatenate([[0.0], np.minimum(corners, FEED_MM_S**2), [0.0]])
    for i in range(len(lengths) - 1, -1, -1):
        squares[i] = min(squares[i], squares[i + 1] + 2.0 * acceleration_mm_s2 * lengths[i])
    for i in range(len(lengths)):
        squares[i + 1] = min(squares[i + 1], squares[i] + 2.0 * acceleration_mm_s2 * lengths[i])
    before, after = squares[:-1], squares[1:]
    top = np.minimum((before + after) / 2.0 + acceleration_mm_s2 * lengths, FEED_MM_S**2)
    ramps_mm = (2.0 * top - before - after) / (2.0 * acceleration_mm_s2)
    ramps_s = (2.0 * np.sqrt(top) - np.sqrt(before) - np.sqrt(after)) / acceleration_mm_s2
    return float((ramps_s + (lengths - ramps_mm) / np.sqrt(top)).sum())


class _Spline(toppra.interpolator.AbstractGeometricPath):  # type: ignore[misc]
    """A curve in the plane: both slides, both belts, and the length of the curve, which the feed limits."""

    def __init__(self, curve: Any, length_mm: float) -> None:
        self._curve, self._length_mm = curve, length_mm

    def __call__(self, s: Any, order: int = 0) -> FloatArray:
        at = np.atleast_1d(np.asarray(s, np.float64))
        x, y = self._curve(at, order).T
        values = np.column_stack([x, y, x + y, y - x, (at, np.ones_like(at), np.zeros_like(at))[order]])
        return values if np.ndim(s) else np.asarray(values[0])

    @property
    def dof(self) -> int:
        return 5

    @property
    def path_interval(self) -> FloatArray:
        return np.array([0.0, self._length_mm])


def fitted_optimum_s(points: FloatArray, off_mm: float) -> float:
    """Return the optimum on the smoothest spline that passes all points within a distance, by toppra."""
    fitted: Any = None
    for smoothing in off_mm**2 * len(points) * 0.5 ** np.arange(12):
        knots: Any
        knots, u = scipy.interpolate.splprep(points.T, s=float(smoothing), k=5)
        if np.linalg.norm(np.column_stack(scipy.interpolate.splev(u, knots)) - points, axis=1).max() <= off_mm:
            fitted = knots
            break
    if fitted is None:
        raise ValueError(f"no spline passes the points within {off_mm:g} mm")
    fine = np.linspace(0.0, 1.0, 20_001)
    places = np.column_stack(scipy.interpolate.splev(fine, fitted))
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    curve = scipy.interpolate.CubicSpline(lengths[::10], places[::10])
    limits = np.array(
        [each.acceleration_max for each in COREXY.joints[:2]] + COREXY.axis_accelerations_max[:2].tolist()
    )
    speeds = np.array([each.speed_max for each in COREXY.joints[:2]] + COREXY.axis_speeds_max[:2].tolist())
    grid = np.linspace(0.0, lengths[-1], 2000)
    return _optimum_s(_Spline(curve, float(lengths[-1])), grid, np.append(speeds, FEED_MM_S), np.append(limits, 1e9))


# --- how the work grows


def growth_table(legs: Sequence[int] = (64, 5000), lines: int = 20_000) -> Table:
    """Measure the processor time of long chains, and of a long file of G-code, on one core."""
    teaching = load_robot("teaching-scara")
    rows = [_zigzag(teaching, 8), *(_zigzag(teaching, count) for count in legs)]
    text = ["G21 G90 G17 G64 P0.02 Q0.01", "G0 X0 Y0 Z3", "G1 Z0 F900"]
    for i in range(lines):
        angle, r_mm = 2.0 * np.pi * 160 * i / lines, 4.0 + 26.0 * i / lines
        text.append(f"G1 X{r_mm * np.cos(angle):.4f} Y{0.7 * r_mm * np.sin(angle):.4f} F3000")
    start = 'x = 130.0, y = 0.0, z = -50.0, phi = 0.0, branch = "right"'
    lasts_s, took_s = _compiled(teaching, _HEAD.format(start=start, x=130.0, y=0.0, z=-60.0), text)
    rows.append(f"G-code of {lines} lines|{lasts_s:.3f}|{took_s:.2f}")
    return bench_table("Long motions of teaching-scara: the first row loads", "motion|lasts s|planned in s", rows)


def _zigzag(robot: Robot, count: int) -> str:
    ways = [(6.0 if i % 2 else -6.0, 8.0 if i // 2 % 2 else -8.0, 0.0) for i in range(count)]
    legs = tool_legs(robot, np.array([20.0, 80.0, 20.0, 0.0]), ways)
    with plan_within(600):
        begin_s = process_time()
        chain = timed_chains(robot, legs, [1.0] * (count - 1))[0]
        took_s = process_time() - begin_s
    return f"chain of {count} legs, corners of 1 mm|{chain.timed.law.duration_s:.3f}|{took_s:.2f}"
