"""Two runs side by side: joints and tools apart, at an instant and over time."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.features.view.model import Replay, RunPair
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.stretched import stretched
from steptwin.host.verify import Expectation, compare
from tests.host.record.machines import perfect_run
from tests.host.verify.motions import perfect_evidence
from tests.messages import refusing

RUN = perfect_run("teaching-scara", "carry")


@pytest.fixture(scope="module")
def difference() -> RunPair:
    """The usual run, and one whose first joint loses every fiftieth step."""
    axis = RUN.comparison.evidence.axes[0]
    kept = np.arange(axis.step_counts.size) % 50 > 0
    lossy = replace(axis, step_counts=axis.step_counts[kept], step_signs=axis.step_signs[kept])
    evidence = replace(RUN.comparison.evidence, axes=(lossy, *RUN.comparison.evidence.axes[1:]))
    other = replace(RUN, comparison=compare(RUN.comparison.expected, evidence))
    return RunPair(Replay(RUN, ()), Replay(other, ()))


def test_the_lost_steps_are_the_difference(difference: RunPair) -> None:
    axis = RUN.comparison.evidence.axes[0]
    lost = -(-axis.step_counts.size // 50)
    apart = difference.at(5.0)
    expected_deg = lost / RUN.robot.joints[0].transmission.steps_per_unit
    assert apart.joints == pytest.approx({"th1": expected_deg, "th2": 0.0, "d3": 0.0, "th4": 0.0})
    assert apart.attitude_deg == pytest.approx(expected_deg)
    x_mm, y_mm, *_ = difference.first.machine.counted_poses(np.array([5.0]))[0]
    assert apart.tool_mm == pytest.approx(2 * np.hypot(x_mm, y_mm) * np.sin(np.deg2rad(expected_deg / 2)))


def test_the_course_has_the_same_distances(difference: RunPair) -> None:
    course = difference.course
    assert (course.t_s[0], course.t_s[-1]) == (0.0, 1.0)
    for i in (0, 1000, 2500, 4000):
        assert course.tool_mm[i] == pytest.approx(difference.at(float(course.t_s[i])).tool_mm, abs=1e-9)


def test_a_run_is_like_itself() -> None:
    replay = Replay(RUN, ())
    assert not RunPair(replay, replay).course.tool_mm.any()


def test_the_shorter_motion_stands_still_after_its_end() -> None:
    motion = RUN.comparison.expected.motion
    expected = Expectation.of(RUN.robot, stretched(motion, 2.0 / motion.duration_s))
    slow = replace(RUN, comparison=compare(expected, perfect_evidence(expected)))
    difference = RunPair(Replay(RUN, ()), Replay(slow, ()))
    assert difference.course.t_s[-1] == 2.0
    assert difference.at(2.0).tool_mm < 0.1
    assert difference.at(0.5).tool_mm > 10.0


def test_runs_of_different_machines_are_not_compared() -> None:
    other = perfect_run("calibration-scara", "demo")
    with refusing(InputError):
        RunPair(Replay(RUN, ()), Replay(other, ()))
