"""Impossible motions are refused before anything moves; the message has joint or reach, time, value and limit."""

import re
from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import brought_text, load_robot, parse_robot
from steptwin.host.robots.robot import Robot
from tests.host.complaints import complaint_of
from tests.messages import refusing

LAB = load_robot("lab-scara")
HYBRID = load_robot("hybrid-arm")
TIME = r"t = \d+\.\d{3} s"


def refusal(robot: Robot, job: str, **options: str) -> str:
    return complaint_of(lambda: plan(robot, make_job(robot, job, options)))


class TestScrewOf10Mm:
    """The laboratory robot's lift with half its lead: 160 steps per mm."""

    TEXT = brought_text("lab-scara")
    LEADS = ("travel_per_turn = 20.0", "travel_per_turn = 10.0")

    def lifted(self, robot: Robot, speed_mm_s: float) -> Plan:
        """Return d1 moved up by 200 mm at a speed and 400 mm/s^2."""
        law = Trapezoid.fastest(1.0, speed_mm_s / 200.0, 400.0 / 200.0)
        return plan(robot, joint_move(robot.joint_names, (0.0, 0.0, 30.0, 0.0), (200.0, 0.0, 30.0, 0.0), law))

    def test_its_file_may_not_set_140_mm_per_s(self) -> None:
        told = complaint_of(lambda: parse_robot(self.TEXT.replace(*self.LEADS), "mine.toml"))
        assert told == (
            "mine.toml: joints.d1.speed_max: 140 mm/s takes 22.4 kHz of steps, more than the driver's 15.0 kHz;"
            " speed_max = 93.75 or microsteps = 2 would do"
        )

    def test_a_motion_of_140_mm_per_s_is_refused(self) -> None:
        slower = self.TEXT.replace(*self.LEADS).replace("speed_max = 140.0 ", "speed_max = 93.75 ")
        robot = parse_robot(slower, "mine.toml")
        self.lifted(LAB, 140.0)
        self.lifted(robot, 93.0)
        with refusing(InputError):
            self.lifted(robot, 140.0)


OUT_OF_REACH = rf"at {TIME} the tool's path breaks off: shoulder to wrist"
SLOWER = r"; [\d.]+ times slower passes \(stretch=[\d.]+\)$"
TOO_BENT = rf"th3: 13\d\.\d+ deg at {TIME} is outside -130\.\.130 deg, by .* deg; the nearest is 130 deg$"


@pytest.mark.parametrize(
    ("x_mm", "y_mm", "pattern"),
    [
        (
            -600,
            500,
            rf"{OUT_OF_REACH} 80\d\.\d mm is outside 0\.\.800 mm, by up to [\d.]+ mm; it passes up to x .* deg$",
        ),  # 781 mm and up to 94 mm more
        (0, 900, rf"{OUT_OF_REACH} 900\.0 mm is outside 0\.\.800 mm, by up to [\d.]+ mm$"),
        (
            0,
            338.09,
            r"th3: 130\.001 deg at t = 0\.000 s is outside -130\.\.130 deg, by .* deg; the nearest is 130 deg$",
        ),
        (0, 330, TOO_BENT),
        (0, 424, TOO_BENT),
        (
            300,
            -400,
            rf"th2: 1\d\d\.\d+ deg at {TIME} is outside -150\.\.150 deg, by .* deg; the nearest is -?150 deg$",
        ),
    ],
)
def test_a_spiral_beyond_the_arm(x_mm: float, y_mm: float, pattern: str) -> None:
    """The reach ends at 800 mm; nearer than 338.095 mm th3 would bend by more than 130 deg."""
    told = refusal(LAB, "spiral", x_mm=str(x_mm), y_mm=str(y_mm))
    reason, _, options = told.partition("; the options set the place: ")
    assert re.match(pattern, reason)
    assert options == "x_mm y_mm z_mm mm_per_rad"


def test_a_spiral_as_near_as_it_may_be() -> None:
    """Around (0, 425) it comes within 338.49 mm of the base, in agreement with r = 800 mm cos(th3 / 2)."""
    motion = plan(LAB, make_job(LAB, "spiral", {"x_mm": "0", "y_mm": "425"})).motion
    th3 = motion.positions(np.arange(18_801) / 1000)[:, 2]
    u = np.linspace(0.0, 18.8, 18_801)
    nearest_mm = np.hypot(5.0 * u * np.cos(u), 425.0 + 5.0 * u * np.sin(u)).min()
    assert nearest_mm == pytest.approx(338.49, abs=0.01)
    assert 800.0 * np.cos(np.deg2rad(th3.max() / 2.0)) == pytest.approx(nearest_mm, abs=0.01)


def test_th3_beyond_130_deg() -> None:
    def move(goal_deg: float) -> Motion:
        return joint_move(LAB.joint_names, LAB.home, (150.0, 0.0, goal_deg, 0.0), Trapezoid(1.0, 2.0, 0.5))

    plan(LAB, move(130.0))
    with refusing(InputError):
        plan(LAB, move(130.001))


STRONG = replace(LAB, joints=tuple(replace(joint, acceleration_max=1e6) for joint in LAB.joints))
"""The laboratory robot without limits of acceleration, so that only its speeds are exceeded."""


@pytest.mark.parametrize(
    ("robot", "job", "options"),
    [
        (LAB, "spiral", {"point_s": "0.005"}),
        (STRONG, "spiral", {"point_s": "0.005"}),
        (STRONG, "spiral", {"point_s": "0.006"}),
        (HYBRID, "helix", {"duration_s": "10"}),
        (HYBRID, "helix", {"duration_s": "20"}),
    ],
)
def test_jobs_too_fast(robot: Robot, job: str, options: dict[str, str]) -> None:
    """The spiral's lift would need six times its acceleration at the start, before the joints exceed their speeds."""
    refusal(robot, job, **options)
