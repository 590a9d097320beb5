"""Standstills put into a motion: every other instant keeps its place on the way, later by what stood before it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.planning.motion import Motion, Wait
from steptwin.host.planning.motions.composer import WAIT_MAX_S, Composer, Sequence
from steptwin.host.planning.motions.held import Hold, held
from steptwin.host.planning.motions.stretched import stretched
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of
from tests.laws import law_of
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")


def motion() -> Motion:
    """Return a motion that waits at its start, on its way and at its end."""
    composer = Composer(ROBOT, np.array(ROBOT.home))
    composer.wait("part_ready", on=True, timeout_s=2.0)
    composer.go_some({"th1": 20.0})
    composer.wait("part_ready", on=False, timeout_s=3.0, place="step 3")
    composer.switch("gripper", on=True)
    composer.go_some({"th1": 40.0})
    composer.wait("part_ready", on=True, timeout_s=4.0)
    return composer.sequence()


MOTION = motion()
WAITS_MS = [round(1000 * wait.at_s) for wait in MOTION.waits]


@pytest.mark.slow
@settings(max_examples=50)
@given(st.lists(st.integers(0, 500), min_size=3, max_size=3))
def test_each_instant_comes_later_by_what_stood_before_it(stood_ms: list[int]) -> None:
    changed = held(MOTION, tuple(map(Hold, WAITS_MS, stood_ms)))
    end_ms = round(1000 * MOTION.duration_s)
    assert changed.duration_s == (end_ms + sum(stood_ms)) / 1000
    own_ms: list[int] = []  # an instant of the motion for each millisecond, written out
    for ms in range(end_ms + 1):
        own_ms += [ms] * (1 + sum(stood for at, stood in zip(WAITS_MS, stood_ms, strict=True) if at == ms))
    t_s = np.arange(len(own_ms)) / 1000
    assert np.allclose(changed.positions(t_s), MOTION.positions(np.array(own_ms) / 1000), atol=1e-9)
    assert np.allclose(changed.velocities(t_s), MOTION.velocities(np.array(own_ms) / 1000), atol=1e-6)
    later_s = (sum(stood_ms[:2])) / 1000
    (old,), (new,) = MOTION.output_changes, changed.output_changes
    assert (new.from_s, new.until_s) == pytest.approx((old.from_s + later_s, old.until_s + later_s))
    assert all(0 < t_s < changed.duration_s for t_s in changed.breakpoints_s)
    assert sorted(changed.breakpoints_s) == list(changed.breakpoints_s)


def test_the_executed_plan_has_the_records_of_the_plan_and_those_of_the_standstill() -> None:
    planned = plan(ROBOT, MOTION)
    executed = planned.held([Hold(WAITS_MS[0], 30), Hold(WAITS_MS[1], 20)], 10)
    for own, old in zip(executed.records(), planned.records(), strict=True):
        at = int(np.sum(planned.times_ms < WAITS_MS[1]))
        assert own.durations_ms == [10] * 3 + old.durations_ms[:at] + [10] * 2 + old.durations_ms[at:]
        assert (
            own.displacements_units == [0] * 3 + old.displacements_units[:at] + [0] * 2 + old.displacements_units[at:]
        )
        assert own.end_velocities == [0] * 3 + old.end_velocities[:at] + [0] * 2 + old.end_velocities[at:]
    at_points = executed.motion.positions(executed.times_ms / 1000)
    assert np.array_equal(ROBOT.to_units(at_points), executed.points_units)
    with refusing(ValueError):
        planned.held([Hold(0, 25)], 10)


@pytest.mark.parametrize("factor", [0.37, 1.111, 3.0])
def test_a_stretched_motion_waits_at_rest(factor: float) -> None:
    slower = stretched(MOTION, factor)
    for old, new in zip(MOTION.waits, slower.waits, strict=True):
        assert new.at_s == pytest.approx(slower.duration_s / MOTION.duration_s * old.at_s, abs=0.001)
        assert (round(1000 * new.at_s) / 1000, new.timeout_s, new.place) == (new.at_s, old.timeout_s, old.place)
        assert not slower.velocities(np.array([new.at_s])).any()


def test_a_wait_is_said_and_counted_as_next_to_no_time() -> None:
    assert MOTION.waits[1] == Wait("part_ready", False, MOTION.waits[1].at_s, 3.0, "step 3")
    assert [str(wait) for wait in MOTION.waits] == ["part_ready on", "part_ready off", "part_ready on"]
    assert MOTION.duration_s - MOTION.waits[-1].at_s == pytest.approx(0.01)
    assert law_of(MOTION, Sequence).parts[0].waits == ()


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, WAIT_MAX_S + 1e-3, float("nan")])
def test_a_time_out_is_above_0_and_up_to_an_hour(timeout_s: float) -> None:
    composer = Composer(ROBOT, np.array(ROBOT.home))
    composer.wait("part_ready", on=True, timeout_s=WAIT_MAX_S)
    with refusing(InputError):
        composer.wait("part_ready", on=True, timeout_s=timeout_s)
    said = complaint_of(lambda: composer.wait("part", on=True, timeout_s=1.0))
    assert said == "inputs: 'part' is unknown: did you mean part_ready?"
