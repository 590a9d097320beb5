"""Tool moves: the joints hold the tool on its path at every instant and turn without jumps; errors."""

from functools import cache

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.planning.laws import Cubic, Quintic, SCurve, Trapezoid
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.tool_move import ToolMove, follow, tool_move
from steptwin.host.planning.paths import Arc, SampledPath, Smoothing, StraightLine, ToolPath
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.poses import Pose
from tests.host.complaints import complaint_of
from tests.laws import law_of
from tests.messages import refusing

ROBOT = load_robot("lab-scara")
SCARA = make_kinematics(ROBOT)
HYBRID = load_robot("hybrid-arm")
TH4 = 3

START: Pose = (-300.0, 400.0, 0.0, 0.0)
"""A pose in the middle of the reach, with th4 at 178 deg."""


def standing(branch: str, pose: Pose = START) -> FloatArray:
    """Return the joints of a pose."""
    joints: FloatArray = SCARA.solve(np.array([pose]), branch).joints[0]
    return joints


def turning(attitudes_deg: list[float]) -> SampledPath:
    """Return a curve through four poses with these attitudes."""
    places = np.array([[-300.0, 400.0, 0.0], [-200.0, 420.0, 0.0], [-100.0, 500.0, 0.0], [50.0, 600.0, 0.0]])
    return SampledPath.through(np.column_stack([places, attitudes_deg]), Smoothing.C2_SPLINE)


LINE = StraightLine(START, (-100.0, 500.0, 40.0, 60.0))
ARC = Arc.through(START, (-350.0, 450.0, 10.0), (-400.0, 400.0, 20.0, -45.0))


@cache
def moves() -> dict[str, Motion]:
    return {
        "line, right": tool_move(ROBOT, LINE, Trapezoid(LINE.length_mm, 3.0, 0.5), "right", standing("right")),
        "line, left": tool_move(ROBOT, LINE, SCurve(LINE.length_mm, 3.0, 1.0, 0.3), "left", standing("left")),
        "arc": tool_move(ROBOT, ARC, Quintic(ARC.length_mm, 4.0), "right", standing("right")),
        "turns": along(turning([0.0, -60.0, -120.0, -170.0])),
    }


def along(path: ToolPath, duration_s: float = 4.0, from_s: float = 0.0, start: FloatArray | None = None) -> Motion:
    """Return a move with the elbow on the right, by a cubic, by default from the beginning of the path."""
    start = SCARA.solve(path.poses(np.zeros(1)), "right").joints[0] if start is None else start
    return tool_move(ROBOT, path, Cubic(path.length_mm, duration_s), "right", start, from_s)


def instants_s(move: Motion) -> FloatArray:
    """Return instants between the whole milliseconds, at which all was checked, and both ends."""
    return np.linspace(0.0, move.duration_s, 1237)


@pytest.mark.parametrize("name", ["line, right", "line, left", "arc", "turns"])
class TestEveryMove:
    def test_the_tool_is_where_the_path_is(self, name: str) -> None:
        move = moves()[name]
        t_s, law = instants_s(move), law_of(move, ToolMove)
        off = SCARA.forward(move.positions(t_s)) - law.path.poses(law.law.position(t_s))
        off[:, 3] = (off[:, 3] + 180.0) % 360.0 - 180.0
        assert np.abs(off).max() < 1e-9

    def test_velocities_are_the_derivatives(self, name: str) -> None:
        move, h_s = moves()[name], 1e-5
        t_s = np.setdiff1d(np.round(instants_s(move)[1:-1], 4), move.breakpoints_s)
        differences = (move.positions(t_s + h_s) - move.positions(t_s - h_s)) / (2 * h_s)
        assert move.velocities(t_s) == pytest.approx(differences, abs=2e-4)

    def test_it_begins_and_ends_at_rest(self, name: str) -> None:
        move = moves()[name]
        assert np.abs(move.velocities(np.array([0.0, move.duration_s]))).max() == 0.0
        law = law_of(move, ToolMove).law
        assert (move.duration_s, move.breakpoints_s) == (law.duration_s, law.breakpoints_s)
        assert move.output_changes == ()
        plan(ROBOT, move)


@pytest.mark.parametrize("branch", ["right", "left"])
def test_the_straight_line_is_straight(branch: str) -> None:
    """Every position is at distance 0 from the line through both ends."""
    poses = SCARA.forward(moves()[f"line, {branch}"].positions(np.linspace(0.0, 3.0, 501)))
    away = poses[:, :3] - LINE.start[:3]
    direction = np.subtract(LINE.goal, LINE.start)[:3] / LINE.length_mm
    assert np.linalg.norm(np.cross(away, direction), axis=1).max() < 1e-9
    assert np.linalg.norm(away[-1]) == pytest.approx(LINE.length_mm, abs=1e-9)


def test_the_arc_is_round() -> None:
    poses = SCARA.forward(moves()["arc"].positions(np.linspace(0.0, 4.0, 501)))
    from_centre = poses[:, :3] - ARC.centre_mm
    assert np.abs(np.linalg.norm(from_centre, axis=1) - ARC.radius_mm).max() < 1e-9
    assert np.abs(from_centre @ np.cross(ARC.outward, ARC.onward)).max() < 1e-9


class TestTurns:
    """th4 = 90 deg + th2 + th3 - attitude, which begins at 178 deg and has the limits +-360 deg."""

    def test_th4_goes_on_beyond_half_a_turn(self) -> None:
        th4 = moves()["turns"].positions(np.linspace(0.0, 4.0, 4001))[:, TH4]
        assert th4[0] == pytest.approx(178.187710192)
        assert th4[-1] > 270.0
        assert np.abs(np.diff(th4)).max() < 0.2

    def test_th4_makes_more_than_a_full_turn(self) -> None:
        move = along(turning([0.0, 160.0, 320.0, 480.0]), 10.0)
        th4 = move.positions(instants_s(move))[:, TH4]
        assert th4[0] - th4[-1] > 480.0
        assert np.abs(np.diff(th4)).max() < 2.0
        plan(ROBOT, move)

    def test_th4_may_begin_on_another_turn(self) -> None:
        path = turning([0.0, -100.0, -200.0, -300.0])
        start = standing("right") - [0.0, 0.0, 0.0, 360.0]
        move = along(path, 10.0, start=start)
        assert move.positions(np.zeros(1))[0] == pytest.approx(start)
        plan(ROBOT, move)
        with refusing(InputError):
            plan(ROBOT, along(path, 10.0))

    def test_the_order_of_instants_does_not_matter(self) -> None:
        move = along(turning([0.0, 160.0, 320.0, 480.0]), 10.0)
        t_s = instants_s(move)
        backwards = move.positions(t_s[::-1])[::-1]
        assert backwards.tolist() == move.positions(t_s).tolist()
        assert move.positions(t_s[700:701])[0] == pytest.approx(backwards[700], abs=0.0)


RADIAL = StraightLine((0.0, 700.0, 0.0, 0.0), (0.0, 850.0, 0.0, 0.0))
INWARD = StraightLine((0.0, 300.0, 0.0, 0.0), (0.0, -300.0, 0.0, 0.0))
STRETCHED = Arc.through((-100.0, 780.0, 0.0, 0.0), (0.0, 799.999, 0.0), (100.0, 780.0, 0.0, 0.0))


class TestRefusals:
    @pytest.mark.parametrize(("from_s", "t_s"), [(0.0, "2.501"), (10.0, "12.501"), (3599.5, "3602.001")])
    def test_out_of_reach(self, from_s: float, t_s: str) -> None:
        """50 mm/s (t - 0.5 s) are 100 mm after 2.5 s."""
        start = standing("right", RADIAL.start)
        told = complaint_of(lambda: tool_move(ROBOT, RADIAL, Trapezoid(150.0, 4.0, 1.0), "right", start, from_s))
        assert told == (
            f"at t = {t_s} s the tool's path breaks off: shoulder to wrist 800.05 mm is outside 0..800 mm"
            ", by up to 50 mm; it passes up to x 0, y 799.9, z 0 mm, phi 0 deg"
        )
        shorter = StraightLine(RADIAL.start, (0.0, 799.9, 0.0, 0.0))
        assert tool_move(ROBOT, shorter, Trapezoid(99.9, 4.0, 1.0), "right", start).duration_s == 4.0

    @pytest.mark.parametrize(("path", "t_s"), [(STRETCHED, "1.9"), (INWARD, "1.9")])
    def test_singular(self, path: ToolPath, t_s: str) -> None:
        """Stretched at 799.9975 mm from the base, folded at 2 mm."""
        reason = r"th3: near singular, \|sin th3\| 0\.00\d* is outside 0\.005\.\.1; it passes up to x "
        pattern = f"s the tool's path breaks off: {reason}"
        with pytest.raises(InputError, match=rf"^at t = {t_s}\d\d {pattern}"):
            along(path)
        with pytest.raises(InputError, match=rf"^at t = 6{t_s[1:]}\d\d {pattern}"):
            along(path, from_s=5.0)

    def test_nearly_singular_is_allowed(self) -> None:
        """799.99 mm from the base |sin th3| is 0.01."""
        nearly = Arc.through((-100.0, 780.0, 0.0, 0.0), (0.0, 799.99, 0.0), (100.0, 780.0, 0.0, 0.0))
        move = along(nearly)
        th3 = move.positions(np.array([2.0]))[0, 2]
        assert np.sin(np.deg2rad(th3)) == pytest.approx(0.01, abs=1e-6)

    @pytest.mark.parametrize("distance_mm", [223.0, -LINE.length_mm, LINE.length_mm + 1e-6, np.nan])
    def test_a_law_of_another_distance_is_refused(self, distance_mm: float) -> None:
        with refusing(InputError):
            tool_move(ROBOT, LINE, Cubic(distance_mm, 2.0), "right", standing("right"))

    def test_the_other_branch(self) -> None:
        with refusing(InputError):
            along(LINE, from_s=7.0, start=standing("left"))

    @pytest.mark.parametrize(("axis", "half_step"), [(0, 0.00625), (1, 0.01125), (2, 0.01125), (3, 0.05625)])
    @pytest.mark.parametrize("side", [-1.0, 1.0])
    def test_more_than_half_a_step_beside_the_path(self, axis: int, half_step: float, side: float) -> None:
        joint = ROBOT.joints[axis]
        off = np.eye(4)[axis] * side * half_step
        assert along(LINE, start=standing("right") + 0.999 * off).positions(np.zeros(1)) == pytest.approx(
            standing("right")[np.newaxis], abs=1e-9
        )
        with pytest.raises(InputError, match=rf"^{joint.name}: at t = 0\.000 s .* {joint.unit}, the joint is at .*"):
            along(LINE, start=standing("right") + 1.01 * off)


class TestFollowing:
    def test_the_turns_begin_near_the_machine_and_go_on(self) -> None:
        """The poses make a circle, their attitude two turns; the joints' limits are not checked."""
        w = np.linspace(0.0, 2.0 * np.pi, 201)
        poses = np.column_stack([-300 + 20 * np.cos(w), 400 + 20 * np.sin(w), 0 * w, -np.rad2deg(2.0 * w)])
        for th4 in (-190.0, 190.0):
            joints = follow(ROBOT, poses, w, "right", np.array([0.0, 0.0, 0.0, th4]))
            assert abs(joints[0, TH4] - th4) < 20.0
            assert joints[-1] - joints[0] == pytest.approx([0.0, 0.0, 0.0, 720.0], abs=1e-9)
            assert np.abs(np.diff(joints, axis=0)).max() < 10.0

    def test_waist_and_gripper_turn_beyond_half_a_turn(self) -> None:
        """The hybrid arm's tool circles its base at constant attitude: th1 turns forwards, th4 backwards."""
        w = np.linspace(0.0, 4.0 * np.pi, 401)
        poses = np.column_stack([400 * np.cos(w), 400 * np.sin(w), 0 * w + 500, 0 * w])
        joints = follow(HYBRID, poses, w, "(+,+)", np.array(HYBRID.home))
        assert joints[:, 0] == pytest.approx(np.rad2deg(w), abs=1e-9)
        assert joints[:, 3] == pytest.approx(-np.rad2deg(w), abs=1e-9)

    @pytest.mark.parametrize(
        ("pose", "branch", "words"),
        [
            ((551.0, 0.0, 500.0, 0.0), "(+,+)", "waist to tool 551.0 mm is outside 250..550 mm"),
            ((249.0, 0.0, 500.0, 0.0), "(+,+)", "waist to tool 249.0 mm is outside 250..550 mm"),
            ((400.0, 0.0, 500.0, 0.0), "(-,-)", "the machine is assembled with its platform above"),
        ],
    )
    def test_where_the_path_breaks_off(self, pose: Pose, branch: str, words: str) -> None:
        """The message names the first pose that is not reachable."""
        good = (400.0, 0.0, 500.0, 0.0)
        poses = np.array([pose, pose] if branch == "(-,-)" else [good, good, pose, pose])
        t_s = np.array([1.5, 1.75, 2.0, 2.25])[-len(poses) :]
        told = complaint_of(lambda: follow(HYBRID, poses, t_s, branch, np.array(HYBRID.home)))
        assert told.startswith(f"at t = 2.000 s the tool's path breaks off: {words}")


@pytest.mark.parametrize("th3_deg", [-180.0, 180.0])
def test_at_half_a_turn_the_move_begins_at_the_joints_position(th3_deg: float) -> None:
    """-180 and 180 deg are the same pose, for which the inverse gives 180 deg."""
    robot = load_robot("warehouse-scara")
    start = np.array([0.0, 0.0, 100.0, 20.0, 60.0, th3_deg])
    x_mm, y_mm, z_mm, attitude_deg = make_kinematics(robot).forward(start[np.newaxis])[0].tolist()
    path = StraightLine((x_mm, y_mm, z_mm, attitude_deg), (x_mm, y_mm, z_mm + 50.0, attitude_deg))
    move = tool_move(robot, path, Cubic(path.length_mm, 3.0), "right", start)
    assert move.positions(np.array([0.0, 1.5, 3.0]))[:, 5] == pytest.approx(np.full(3, th3_deg))
    plan(robot, move)
