"""What robots cannot do is refused before anything moves: each message has joint or reach, time, value and limit."""

import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from host.errors import InputError
from host.jobs import make_job
from host.laws import Trapezoid
from host.motions.joint_move import JointMove
from host.planner import Plan, plan
from host.robot import Robot
from host.robots import load_robot, parse_robot

LAB = load_robot("lab-scara")
HYBRID = load_robot("hybrid-arm")
TIME = r"t = \d+\.\d{3} s"


def refusal(robot: Robot, job: str, **options: str) -> str:
    with pytest.raises(InputError) as caught:
        plan(robot, make_job(robot, job, options))
    return str(caught.value)


class TestScrewOf10Mm:
    """The laboratory robot's lift with half its lead: 160 steps per mm."""

    TEXT = (files("host.robots") / "lab-scara.toml").read_text(encoding="utf-8")
    LEADS = ("travel_per_turn = 20.0", "travel_per_turn = 10.0")

    def lifted(self, robot: Robot, speed_mm_s: float) -> Plan:
        """d1 up 200 mm at a speed and 400 mm/s^2."""
        law = Trapezoid.fastest(1.0, speed_mm_s / 200.0, 400.0 / 200.0)
        return plan(robot, JointMove(robot.joint_names, (0.0, 0.0, 30.0, 0.0), (200.0, 0.0, 30.0, 0.0), law))

    def test_its_file_may_not_promise_140_mm_per_s(self) -> None:
        with pytest.raises(InputError) as caught:
            parse_robot(self.TEXT.replace(*self.LEADS), "mine.toml")
        assert str(caught.value) == (
            "mine.toml: joints.d1.speed_max: 140 mm/s takes 22.4 kHz of steps, more than the driver's 15.0 kHz"
        )

    def test_a_motion_of_140_mm_per_s_is_refused(self) -> None:
        slower = self.TEXT.replace(*self.LEADS).replace("speed_max = 140.0 ", "speed_max = 93.75 ")
        robot = parse_robot(slower, "mine.toml")
        self.lifted(LAB, 140.0)
        self.lifted(robot, 93.0)
        with pytest.raises(
            InputError, match=rf"^d1: 22\.4 kHz of steps at {TIME} is more than the driver's 15\.0 kHz$"
        ):
            self.lifted(robot, 140.0)


@pytest.mark.parametrize(
    ("x_mm", "y_mm", "pattern"),
    [
        (-600, 500, rf"at {TIME} the tool's path breaks off: out of reach: shoulder to wrist 80\d\.\d mm"),
        (
            0,
            900,
            rf"at {TIME} the tool's path breaks off: out of reach: shoulder to wrist 900\.0 mm is outside 0\.\.800 mm",
        ),
        (0, 330, rf"th3: 13\d\.\d+ deg at {TIME} is outside -130\.\.130 deg"),
        (0, -430, rf"th2: -1\d\d\.\d+ deg at {TIME} is outside -150\.\.150 deg"),
    ],
)
def test_a_spiral_out_of_reach(x_mm: float, y_mm: float, pattern: str) -> None:
    """Farther than 800 mm nothing reaches; nearer than 338.095 mm th3 would bend by more than 130 deg."""
    assert re.match(pattern, refusal(LAB, "spiral", x_mm=str(x_mm), y_mm=str(y_mm)))


@pytest.mark.parametrize(("y_mm", "stays"), [(443.0, True), (423.0, False)])
def test_a_spiral_around_the_base_keeps_338_mm_away(y_mm: float, stays: bool) -> None:
    """At its widest it is 94 mm from its axis; going down from there, at u = 11 / 2 pi and 4.8 pi, a bit less."""
    start = {"x_mm": "0", "y_mm": str(y_mm)}
    trajectory = make_job(LAB, "spiral", start)
    th3 = np.abs(trajectory.positions(np.arange(18801) / 1000)[:, 2])
    nearest_mm = 800.0 * np.cos(np.deg2rad(th3.max() / 2.0))
    assert (nearest_mm > 338.095) == stays == (th3.max() < 130.0)


def test_th3_beyond_130_deg() -> None:
    """By a hair, at the goal; 130 deg itself is allowed."""
    for goal, told in ((130.0, None), (130.001, r"th3: 130\.001 deg at t = 1\.\d{3} s is outside -130\.\.130 deg$")):
        move = JointMove(LAB.joint_names, LAB.home, (150.0, 0.0, goal, 0.0), Trapezoid(1.0, 2.0, 0.5))
        if told is None:
            plan(LAB, move)
        else:
            with pytest.raises(InputError, match=rf"^{told}"):
                plan(LAB, move)


def test_a_spiral_too_fast() -> None:
    """From point to point in 5 ms: the lift's screw would have to start with six times its acceleration.

    With motors of any acceleration it is the wrist's speed that is too high: 15.02 deg/s in 50 ms are 150 deg/s.
    """
    assert re.match(
        rf"d1: a mean acceleration over 1 ms of \d+\.\d mm/s\^2 at {TIME} is more than 500\.0 mm/s\^2$",
        refusal(LAB, "spiral", point_s="0.005"),
    )
    strong = replace(LAB, joints=tuple(replace(joint, acceleration_max=1e6) for joint in LAB.joints))
    told = refusal(strong, "spiral", point_s="0.005")
    assert re.match(rf"th\d: a speed of 1\d\d\.\d deg/s at {TIME} is more than 130\.0 deg/s$", told)


def test_a_helix_too_fast() -> None:
    assert re.match(
        rf"Z5: 18\.7 kHz of steps at {TIME} is more than the driver's 15\.0 kHz$",
        refusal(HYBRID, "helix", duration_s="10"),
    )
