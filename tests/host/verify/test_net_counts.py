"""Judge counters of any step rule: what is missing or too many is counted exactly, and rules alone fail nobody."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin.host.common.arrays import FloatArray
from steptwin.host.verify import Evidence, Report, any_step_rule, compare, verify, verify_comparison
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.host.verify.motions import (
    CLK_HIGH_COUNTS,
    RUN,
    START_COUNTS,
    altered,
    expect,
    motion,
    perfect_evidence,
    sines,
    trapezoid,
)

EXPECTED = expect(
    motion(3.0, sines([(20.0, 2.0, 0.0)]), trapezoid(3.0, -50.3, 3.0, 1.0), sines([(9.7, 3.0, 1.0)])), 80.0, 40.0, 44.4
)
"""Swings, and a way from rest to rest that ends between two steps."""

Rule = Callable[[FloatArray, int], int]
"""Returns the next counter, of the present one and a position in steps."""


def steps_at(threshold: float) -> Rule:
    """A rule with hysteresis: the counter follows as soon as the position is so far away."""
    return lambda p, n: n + 1 if p >= n + threshold else n - 1 if p < n - threshold else n


def floor_rule(p: FloatArray, _n: int) -> int:
    """The counter is the whole part, as in a firmware that casts to an integer."""
    return int(np.floor(p))


RULES = {
    "ours": steps_at(0.5625),
    "half a step": steps_at(0.5),
    "wide": steps_at(0.98),
    "whole part": floor_rule,
}


@cache
def made_by(name: str, grid_us: int = 2) -> Evidence:
    """Return the evidence of a controller that looks at the motion on a grid of time, and makes steps by a rule."""
    rule, evidence = RULES[name], perfect_evidence(EXPECTED)
    t_s = np.arange(0.0, EXPECTED.motion.duration_s + grid_us / 1e6, grid_us / 1e6)
    planned = EXPECTED.motion.positions(np.minimum(t_s, EXPECTED.motion.duration_s)) * EXPECTED.steps_per_unit
    for axis, start in enumerate(evidence.axes):
        near = np.flatnonzero(np.diff(np.floor(16 * planned[:, axis]), prepend=np.nan))  # where a rule may act
        counter, times, signs = start.start_steps, [], []
        for index, position in zip(near.tolist(), planned[near, axis].tolist(), strict=True):
            while (after := rule(position, counter)) != counter:
                sign = 1 if after > counter else -1
                counter += sign
                times.append(t_s[index])
                signs.append(sign)
        counts = START_COUNTS + np.rint(np.array(times) * COUNTS_PER_SECOND).astype(np.int64)
        evidence = _with(evidence, axis, counts, np.array(signs, np.int8))
    return evidence


def _with(evidence: Evidence, axis: int, counts: NDArray[Any], signs: NDArray[Any]) -> Evidence:
    rises = {"step_counts": counts, "clk_rise_counts": counts, "clk_fall_counts": counts + CLK_HIGH_COUNTS}
    return altered(evidence, axis, step_signs=signs, **rises)


def judged(evidence: Evidence, tolerance_steps: float = 1.01) -> Report:
    return verify_comparison(compare(EXPECTED, evidence, any_step_rule(tolerance_steps)), RUN)


@pytest.mark.slow
@pytest.mark.parametrize("name", RULES)
def test_a_rule_alone_passes_with_another_controller_and_only_ours_does_with_our_firmware(name: str) -> None:
    evidence = made_by(name)
    report = judged(evidence)
    assert report.reasons == ()
    assert [axis.unmatched_steps for axis in report.axes] == [0, 0, 0]
    assert verify(EXPECTED, evidence, RUN).passed == (name == "ours")


@pytest.mark.parametrize(("name", "grid_us"), [*((name, 25) for name in RULES), ("ours", 100), ("whole part", 100)])
def test_a_timers_grid_passes_with_a_tolerance_for_it(name: str, grid_us: int) -> None:
    """At 3.2 kHz a grid of 100 us delays a step by up to a third of one."""
    evidence = made_by(name, grid_us)
    assert judged(evidence, 1.5).reasons == ()


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3, 40])
@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("axis", [0, 1])
def test_lost_steps_are_counted_exactly(axis: int, name: str, count: int) -> None:
    evidence = made_by(name)
    own = evidence.axes[axis]
    lost = slice(400, 400 + count)
    counts, signs = (np.delete(values, lost) for values in (own.step_counts, own.step_signs))
    report = judged(_with(evidence, axis, counts, signs))
    assert report.axes[axis].unmatched_steps == count
    lost_s = (own.step_counts[400] - evidence.start_counts) / COUNTS_PER_SECOND
    (told,) = (
        reason for reason in report.reasons if reason.startswith(f"{own.name}: unmatched steps {count} (limit 0)")
    )
    assert float(told.split()[-2]) == pytest.approx(lost_s, abs=0.01)


@pytest.mark.parametrize("count", [1, 3, 40])
@pytest.mark.parametrize("name", RULES)
def test_extra_steps_are_counted_exactly(name: str, count: int) -> None:
    """They come between steps of a stretch in one direction."""
    evidence = made_by(name)
    own = evidence.axes[1]
    between = (own.step_counts[400 : 400 + count] + own.step_counts[401 : 401 + count]) // 2
    counts = np.insert(own.step_counts, np.arange(401, 401 + count), between)
    signs = np.insert(own.step_signs, 401, own.step_signs[400:401].repeat(count))
    report = judged(_with(evidence, 1, counts, signs))
    assert report.axes[1].unmatched_steps == count


def test_a_step_the_wrong_way_is_one_missing_and_one_too_many() -> None:
    evidence = made_by("ours")
    signs = evidence.axes[0].step_signs.copy()
    signs[500] *= -1
    report = judged(altered(evidence, step_signs=signs))
    assert report.axes[0].unmatched_steps == 2


def test_a_last_step_that_is_missing_fails_where_the_rule_does_not_explain_it() -> None:
    """Ours ends 0.5 step away from -1892.0 at most: without its last step the count is wrong."""
    evidence = made_by("ours")
    own = evidence.axes[1]
    report = judged(_with(evidence, 1, own.step_counts[:-1], own.step_signs[:-1]))
    assert not report.passed
    assert any("end count" in reason for reason in report.reasons)


def test_the_tolerance_is_a_limit_of_its_own() -> None:
    evidence = made_by("wide")
    assert judged(evidence, 1.01).passed
    assert not judged(evidence, 0.9).passed
    assert judged(evidence, 0.9).reasons[-1].endswith("steps (limit 0.9)")
