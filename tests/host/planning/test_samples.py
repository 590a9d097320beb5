"""Motions are looked at in windows: these must not be seen in what is planned, and an hour is the longest motion."""

import numpy as np
import pytest

from steptwin.host.common.findings import Findings
from steptwin.host.planning import peaks as samples
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.motions.stretched import largest_stretch, stretched
from steptwin.host.planning.peaks import TooLongError, sampled, windows_ms
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import compile_program, parse_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from tests.end_to_end.pages import ROOT
from tests.host.complaints import complaint_of
from tests.messages import refusing

TEACHING = load_robot("teaching-scara")


def program_of(robot: Robot, text: str) -> Motion:
    return compile_program(parse_program(text, Findings()), robot).motion


def test_windows_share_a_millisecond(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(samples, "WINDOW_MS", 4)
    assert [times_ms.tolist() for times_ms in windows_ms(9)] == [[0, 1, 2, 3, 4], [4, 5, 6, 7, 8], [8, 9]]
    assert [times_ms.tolist() for times_ms in windows_ms(8)] == [[0, 1, 2, 3, 4], [4, 5, 6, 7, 8]]
    assert [times_ms.tolist() for times_ms in windows_ms(1)] == [[0, 1]]


@pytest.mark.slow
@pytest.mark.parametrize("window_ms", [137, 1000])
@pytest.mark.parametrize("name", ["calibration-scara", "lab-scara", "warehouse-scara"])
def test_windows_change_no_plan(monkeypatch: pytest.MonkeyPatch, name: str, window_ms: int) -> None:
    """With circles, arcs and curves of the tool, moves of joints, and pauses; points at other times than windows."""
    robot, text = load_robot(name), (ROOT / "docs" / "programs" / f"{name}.toml").read_text(encoding="utf-8")
    whole = plan(robot, program_of(robot, text))
    monkeypatch.setattr(samples, "WINDOW_MS", window_ms)
    pieced = plan(robot, program_of(robot, text))
    assert len(list(sampled(pieced.motion))) == -(-round(1000 * whole.motion.duration_s) // window_ms)
    assert np.array_equal(pieced.times_ms, whole.times_ms)
    assert np.array_equal(pieced.points_units, whole.points_units)
    assert np.array_equal(pieced.velocities, whole.velocities)
    assert [(peak.joint, peak.quantity) for peak in pieced.peaks] == [
        (peak.joint, peak.quantity) for peak in whole.peaks
    ]
    assert [peak.value for peak in pieced.peaks] == pytest.approx([peak.value for peak in whole.peaks], rel=1e-12)


def test_windows_change_no_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """A circle with the tool turned along: each window begins in the turn in which the one before ended."""
    robot = load_robot("calibration-scara")
    text = (ROOT / "docs" / "programs" / "calibration-scara.toml").read_text(encoding="utf-8")
    whole = program_of(robot, text)
    monkeypatch.setattr(samples, "WINDOW_MS", 50)
    t_s = np.linspace(0.0, whole.duration_s, 1001)
    assert np.allclose(program_of(robot, text).positions(t_s), whole.positions(t_s), atol=1e-9)


def test_windows_change_no_complaint(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first instant outside of the limits is in one window, the farthest position in a later one."""
    far = Composer(TEACHING, np.array(TEACHING.home))
    far.go_some({"th1": TEACHING.joints[0].upper + 20.0})
    whole = complaint_of(lambda: plan(TEACHING, far.sequence()))
    monkeypatch.setattr(samples, "WINDOW_MS", 10)
    complaint_of(lambda: plan(TEACHING, far.sequence()))
    assert ", by up to 20 deg" in whole


@pytest.mark.slow
def test_an_hour_is_the_longest_motion() -> None:
    motion = Composer(TEACHING, np.array(TEACHING.home))
    motion.pause(3599.0)
    motion.pause(1.0)
    with refusing(TooLongError):
        motion.pause(0.001)
    assert plan(TEACHING, motion.sequence(), point_ms=255).times_ms[-1] == 3_600_000


def test_a_stretch_beyond_an_hour_is_refused_with_the_largest() -> None:
    carry = make_job(TEACHING, "carry", {})
    longest = largest_stretch(stretched(carry, 100.0))
    assert longest == pytest.approx(36.0 / carry.duration_s, abs=0.001)
    motion = stretched(carry, 100.0)
    assert stretched(motion, longest).duration_s <= 3600
    with refusing(TooLongError):
        stretched(motion, longest + 0.001)
