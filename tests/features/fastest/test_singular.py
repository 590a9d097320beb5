"""The fastest motions at a wrist's singularity: no joint jumps, none becomes slow without end, and time is bounded."""

from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from steptwin.features.fastest.executed import UntimedError, timed
from steptwin.features.fastest.pieces import FollowedPath, JointPiece, PiecewisePath
from steptwin.features.fastest.rows import AVERAGE_S
from steptwin.host.common.errors import InputError
from steptwin.host.common.planning_time import PlanningTimeError, plan_within
from steptwin.host.planning.motions.whole import Pace
from steptwin.host.planning.paths import OutOfReachError, straight
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import CompiledProgram, compile_program, read_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics

PAROL6 = load_robot("parol6")
JOINTS = "J1 = 90.0, J2 = -72.572, J3 = 180.0, J4 = 0.0, J6 = 180.0"
CROSSWAYS = "x = 3.96, y = -3.011736336, z = -0.494149295"


def compiled(folder: Path, j5_deg: float, step: str, law: str = "fastest") -> CompiledProgram:
    file = folder / "program.toml"
    file.write_text(
        f'robot = "parol6"\nlaw = "{law}"\n[[step]]\ngo = {{ {JOINTS}, J5 = {j5_deg} }}\n[[step]]\n{step}\n',
        encoding="utf-8",
    )
    return compile_program(read_program(file), PAROL6)


def test_a_line_that_turns_the_wrist_at_once_is_refused(tmp_path: Path) -> None:
    """From the stretched wrist the line needs J4 at 61.9 deg at once; the motion lasted 42 709 s."""
    with pytest.raises(
        InputError,
        match=r"^step 2 \(by x 3\.96, .*\): after 0\.00 mm the tool's path breaks off: J4 would turn by 61\.\d deg on"
        r" 0\.000\d+ mm, near the stretched wrist, at x 0, y 304\.979, z 208\.94 mm",
    ):
        compiled(tmp_path, 0.0, f"by = {{ {CROSSWAYS} }}\nspeed_mm_s = 60")


@pytest.mark.parametrize("j4_deg", [1.0, 4.0, 30.0])
def test_so_is_a_small_jump(j4_deg: float) -> None:
    """A wrist at J4 = 0 that a line needs at some degrees jumps by them, however few."""
    kinematics = make_kinematics(PAROL6)
    start = np.array([90.0, -72.572, 180.0, 0.0, 0.0, 180.0])
    turned = start + np.array([0.0, 0.0, 0.0, j4_deg, 5.0, -j4_deg])
    begin, end = (tuple(kinematics.forward(each[np.newaxis])[0].tolist()) for each in (start, turned))
    line = straight(kinematics.task, begin, end)
    with pytest.raises(OutOfReachError, match=r"^after 0\.00 mm the tool's path breaks off: J[46] would turn by"):
        FollowedPath.along(PAROL6, line, "front-up-noflip", start)


def test_a_line_near_the_stretched_wrist_keeps_all_limits(tmp_path: Path) -> None:
    """It passes 0.4 deg from the singularity, where J4 and J6 turn by half a turn on a few mm."""
    program = compiled(tmp_path, 0.4, f"by = {{ {CROSSWAYS} }}\nspeed_mm_s = 60")
    made = plan(PAROL6, program.motion)
    assert max(peak.percent for peak in made.peaks) <= 100.0
    assert 0.2 < program.steps[1].duration_s < 3.0


def test_what_no_pace_makes_slow_enough_names_limit_and_step(tmp_path: Path) -> None:
    """J5 at a hundred thousandth of a degree: the places of the path do not show how J4 turns."""
    with pytest.raises(InputError, match=r"^step 2 \(by x 3\.96, .*\): after 0\.\d\d mm "):
        compiled(tmp_path, 1e-5, f"by = {{ {CROSSWAYS} }}\nspeed_mm_s = 60")


def looks() -> Iterator[float]:
    return map(float, count())


@pytest.mark.slow
def test_a_turn_that_no_place_of_a_path_shows_is_refused() -> None:
    """J1 turns by 5 deg on a thousandth of a mm; the motion was made slower a hundred thousand times."""
    s = np.array([0.0, 50.05, 50.051, 100.0])
    joints = np.zeros((4, 6))
    joints[:, 0], joints[2:, 0] = s / 10.0, s[2:] / 10.0 + 5.0
    piece = JointPiece(PAROL6, PchipInterpolator(s, joints), Pace(), is_straight=True)
    with pytest.raises(UntimedError, match=r"^J1's .* times the highest at whatever pace") as raised:
        timed(PAROL6, PiecewisePath(PAROL6, (piece,)), AVERAGE_S)
    assert 49.0 < raised.value.s < 51.0


@pytest.mark.parametrize("law", ["fastest", "s-curve"])
def test_a_program_has_no_more_time_than_its_bound(tmp_path: Path, law: str) -> None:
    """Each look at the clock is a second: a number of them stands for any length of work."""
    clock = looks()
    with (
        plan_within(3, lambda: next(clock)),
        pytest.raises(PlanningTimeError, match=r"^step [12] \((go to|by) .*\): is not planned after 3 s of processor"),
    ):
        compiled(tmp_path, 20.0, "by = { x = 2.0 }\nspeed_mm_s = 20", law)
