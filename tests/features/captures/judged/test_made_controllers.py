"""Controllers that step by rules of their own pass if no step is missing; lost and extra steps are counted."""

from collections.abc import Sequence

import numpy as np
import pytest

from steptwin.features.captures.capture import Capture, Channel
from steptwin.features.captures.judging import CapturedRun, CaptureJudge, judge_capture
from steptwin.host.robots import load_robot
from steptwin.host.verify.gates import SEGMENTS_TOLERANCE_STEPS, TOLERANCE_STEPS
from tests.features.captures.controllers import RULES, Clock, Moves, Steps, made_steps, wires

ROBOT = load_robot("teaching-scara")
AXES = ROBOT.axis_names
MAPS = [f"{name}=D{2 * i},D{2 * i + 1}" for i, name in enumerate(AXES)]
SEGMENTS = "segments"


def captured(steps: Sequence[Steps], rate_hz: float) -> Capture:
    """Return a capture of STEP and DIR of each axis."""
    channels: list[Channel] = []
    for each in steps:
        for times_s in wires(each, 2.0 / rate_hz):
            edges = np.ceil(times_s * rate_hz).astype(np.int64)
            channels.append(Channel(f"D{len(channels)}", 0, edges))
    end = max(int(channel.edges[-1]) for channel in channels if channel.edges.size)
    return Capture("test", tuple(channels), 1.0 / rate_hz, end + round(0.01 * rate_hz), rate_hz, sampled=True)


def judged(
    seed: int, rule: str, fault: int = 0, moves: int = 2, *, slower: float = 1.0
) -> tuple[CapturedRun, list[int]]:
    """Return the verdict on a made capture, and the steps missing or too many; `fault` is how many are too many."""
    random = np.random.default_rng(seed)
    start = np.where(random.random(len(AXES)) < 0.5, 0.0, random.uniform(-20.0, 20.0, len(AXES)))
    top = 4000.0 / float(np.abs(ROBOT.steps_per_unit).max())
    law = Moves.random(random, AXES, moves, start, top, 4.0 * top, reach=5.0 * moves)
    made = law if slower == 1.0 else law.at_other_rates(slower)
    steps = made_steps(made, ROBOT.steps_per_unit, rule, random)
    axis = int(np.argmax([each.time_s.size for each in steps]))
    wrong = [0] * len(AXES)
    if fault:
        steps[axis] = faulty(steps[axis], fault)
        wrong[axis] = abs(fault)
    clock = Clock(0.3, 50.0, 8e6, 1e-6)
    capture = captured([clock.sees(each, random) for each in steps], clock.rate_hz)
    tolerance = SEGMENTS_TOLERANCE_STEPS if rule == SEGMENTS else TOLERANCE_STEPS
    judge = CaptureJudge(maps=MAPS, driver_profile="tmc2209", tolerance_steps=tolerance)
    return judge_capture(capture, ROBOT, "made", law.motion, judge), wrong


def faulty(steps: Steps, fault: int) -> Steps:
    """Return steps without some in a row, or with more, in the middle of the longest run."""
    turns = np.concatenate(([0], np.flatnonzero(np.diff(steps.signs)) + 1, [steps.signs.size]))
    longest = int(np.argmax(np.diff(turns)))
    at = int(turns[longest] + turns[longest + 1]) // 2
    if fault < 0:
        lost = slice(at, at - fault)
        return Steps(np.delete(steps.time_s, lost), np.delete(steps.signs, lost))
    between = steps.time_s[at] + (steps.time_s[at + 1] - steps.time_s[at]) * np.arange(1, fault + 1) / (fault + 1)
    return Steps(np.insert(steps.time_s, at + 1, between), np.insert(steps.signs, at + 1, [steps.signs[at]] * fault))


def check(seed: int, rule: str, fault: int, moves: int = 2) -> None:
    """A capture passes without a fault, and with one the steps missing or too many are counted."""
    run, wrong = judged(seed, rule, fault, moves)
    assert run.passed == (fault == 0), (seed, rule, fault, run.reasons)
    if rule not in (SEGMENTS, "int", "int on a timer"):  # a step more or less may be their rule's, not the verdict
        assert [axis.unmatched_steps for axis in run.report.axes] == wrong, (seed, rule, fault)


@pytest.mark.parametrize("rule", RULES)
def test_what_was_planned_passes(rule: str) -> None:
    check(3, rule, 0)


@pytest.mark.slow
@pytest.mark.parametrize(("rule", "fault"), [("floor", -1), ("int", -3), ("accumulator", 1), (SEGMENTS, -3)])
def test_what_was_lost_or_too_many_is_counted(rule: str, fault: int) -> None:
    check(4, rule, fault)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 104))
@pytest.mark.parametrize("rule", RULES)
def test_many_captures(seed: int, rule: str) -> None:
    for fault in (0, -1, -3, 1):
        check(seed, rule, fault, moves=6)


def test_a_refusal_says_how_far_off_other_controllers_are() -> None:
    """Steps in segments are up to 2 off; of one step more the refusal names both tolerances."""
    run, _ = judged(4, "floor", -3)
    assert any(
        "(limit 1.5, usual; of controllers that move in segments, such as grbl, 2 is)" in each for each in run.reasons
    )


@pytest.mark.slow
def test_another_speed_law_is_named_before_loss_and_clock() -> None:
    run, _ = judged(6, "round", slower=0.7)
    assert run.other_law
    assert run.reasons[0].startswith("another speed law than planned: each axis counts as planned between its turning")
    assert not any("clocks differ" in reason or "not in the capture" in reason for reason in run.reasons)


@pytest.mark.slow
def test_a_lost_step_is_no_other_speed_law() -> None:
    assert not judged(6, "round", -1)[0].other_law
