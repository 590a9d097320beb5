"""Halt and resume by scaling trajectory time: the path, the end, the accelerations, and both kernels the same."""

import math
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.axis_motion import STOP_MAX_MS, TICKS_PER_SECOND, AxisEvent, Refusal
from steptwin.controller.motion.backend import Kernel, compiled_kernel, python_kernel
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.motion.group_time import RateRamp
from steptwin.controller.motion.step_config import StepConfig
from steptwin.protocol import od
from tests.controller.motion.kernel_rig import KernelRig, Timing, pin_timing_faults
from tests.controller.units import STEP
from tests.one_example import one_example

FULL = k.FULL_RATE_Q16
SLOWEST, FASTEST = od.RATE_MIN_Q16, od.RATE_MAX_Q16
KHZ = 64 * STEP
"""1000 steps/s as a record's velocity, in 1/64 unit per ms."""
CONFIG = StepConfig(16, 33_000, 33_666, 15_000, 15_000, velocity_max_units_per_s=15_000 * STEP)
DECELERATION = 40_000 * STEP

DECELERATIONS = pytest.mark.parametrize(
    "deceleration_hz_per_s", [pytest.param(20_000, marks=pytest.mark.slow), 40_000, 400_000]
)

Record = tuple[int, int, int]


def sampled(rate_hz: float, sine_hz: float, duration_ms: int, point_ms: int) -> list[Record]:
    """Return records of A (1 - cos wt) with this peak step rate; of a line with smooth ends for 0 Hz."""
    times_s = np.arange(duration_ms // point_ms + 1) * point_ms / 1000
    if sine_hz:
        omega = 2 * math.pi * sine_hz
        steps, speeds_hz = rate_hz / omega * (1 - np.cos(omega * times_s)), rate_hz * np.sin(omega * times_s)
    else:
        speeds_hz = rate_hz * np.clip(np.minimum(times_s, times_s[-1] - times_s) / 0.1, 0, 1)
        steps = np.concatenate(([0.0], np.cumsum((speeds_hz[1:] + speeds_hz[:-1]) / 2 * point_ms / 1000)))
    units = np.floor(steps * STEP + 0.5).astype(int)
    velocities = np.round(speeds_hz / 1000 * KHZ).astype(int)
    return [(int(d), int(v), point_ms) for d, v in zip(np.diff(units), velocities[1:], strict=True)]


class GroupRun:
    """Three axes of one group with points every 20, 10 and 40 ms: a fast line and two sines, 1.2 s."""

    PLAN = (sampled(9000, 0, 1200, 20), sampled(900, 2.5, 1200, 10), sampled(700, 1.25 / 1.5, 1200, 40))
    TICKS = 4800

    def __init__(self, kernel: Kernel, *, group: bool = True, deceleration: int = DECELERATION) -> None:
        self.motion = BoardMotion(kernel, len(self.PLAN))
        self.limits = [deceleration] * len(self.PLAN)
        self.demands: list[list[int]] = []
        self.clk: list[list[int]] = [[] for _ in self.PLAN]
        self.directions: list[list[int]] = [[] for _ in self.PLAN]
        self.events: list[tuple[int, int, AxisEvent]] = []
        self._unsent = [list(plan) for plan in self.PLAN]
        for axis in range(len(self.PLAN)):
            self.motion.axes[axis].configure(CONFIG)
        self._feed()
        for axis in range(len(self.PLAN)):
            assert self.motion.axes[axis].start(in_group=group)

    def _feed(self) -> None:
        for axis, records in enumerate(self._unsent):
            while records and self.motion.axes[axis].queued < k.QUEUE_DEPTH:
                assert self.motion.axes[axis].push(*records.pop(0)) is Refusal.ACCEPTED

    def want(self, rate_q16: int) -> None:
        self.motion.group.wanted_q16 = rate_q16
        self.motion.ramp_group(self.limits)

    def hold(self, *, hold: bool) -> None:
        self.motion.group.hold(1, hold=hold)
        self.motion.ramp_group(self.limits)

    def pass_ticks(self, ticks: int) -> None:
        for _ in range(ticks):
            self._pass_tick()

    def finish(self) -> "GroupRun":
        """Run to the end of the motion, and collect its edges."""
        while any(self.motion.axes[axis].running for axis in range(len(self.PLAN))):
            self._pass_tick()
        self._collect_edges()
        return self

    def _pass_tick(self) -> None:
        self.motion.advance(self.motion.tick + 1)
        self.events += [(self.motion.tick, *event) for event in self.motion.take_events()]
        self._feed()
        self.demands.append([self.motion.axes[axis].demand_units for axis in range(len(self.PLAN))])
        if self.motion.room_ticks < 2:
            self._collect_edges()

    def _collect_edges(self) -> None:
        for axis, edges in enumerate(self.motion.take_edges()):
            self.clk[axis] += edges.clk_counts.tolist()
            self.directions[axis] += edges.direction.tolist()

    def rises(self, axis: int) -> NDArray[np.int64]:
        return np.array(self.clk[axis][0::2])

    def signs(self, axis: int) -> list[int]:
        words = np.array(self.directions[axis])
        levels = np.concatenate(([0], words & 1))[np.searchsorted(words >> 1, self.rises(axis), side="right")]
        return [int(sign) for sign in 2 * levels - 1]


@pytest.fixture(scope="module")
def planned(fast_kernel: Kernel) -> GroupRun:
    return GroupRun(fast_kernel, group=False).finish()


@cache
def scripted(kernel: Kernel, script: tuple[tuple[int, bool], ...], deceleration: int = DECELERATION) -> GroupRun:
    """Let ticks pass, then halt or resume, for each pair of the script; then run to the end. Each runs once."""
    run = GroupRun(kernel, deceleration=deceleration)
    for ticks, hold in script:
        run.pass_ticks(ticks)
        run.hold(hold=hold)
    return run.finish()


SCRIPTS: dict[str, tuple[tuple[int, bool], ...]] = {
    "never": (),
    "once": ((1501, True), (3000, False)),
    "for long": ((1501, True), (12_000, False)),
    "again and again": tuple((157, hold) for hold in (True, False) * 12),
    "resumed while it slows down": ((1501, True), (300, False)),
    "halted while it speeds up": ((1501, True), (1500, False), (411, True), (2000, False)),
    "in the last segment": ((GroupRun.TICKS - 30, True), (2000, False)),
    "in the first segment": ((7, True), (2000, False)),
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_every_edge_lies_on_the_planned_path(fast_kernel: Kernel, planned: GroupRun, name: str) -> None:
    """The fast axis' edges show the machine's place on the path; there the other axes' edges are as planned.

    The k-th edge of an axis is at the same place on the path as the k-th edge of the motion without a halt. Axis 0's
    edges convert the real instant of another axis' edge to a planned instant. Its difference from the edge's own
    planned instant, times the axis' speed of at most 0.9 step per ms, is the distance from the path.
    """
    run = scripted(fast_kernel, SCRIPTS[name])
    for axis, rate_per_count in ((1, 900 / 72e6), (2, 700 / 72e6)):
        assert run.signs(axis) == planned.signs(axis)
        shown = np.interp(run.rises(axis), run.rises(0), planned.rises(0))
        seen = (run.rises(axis) > run.rises(0)[0]) & (run.rises(axis) < run.rises(0)[-1])
        assert np.abs(shown - planned.rises(axis))[seen].max() * rate_per_count < 0.1


@pytest.mark.parametrize("name", SCRIPTS)
def test_it_ends_where_planned_with_good_pulses(fast_kernel: Kernel, planned: GroupRun, name: str) -> None:
    run = scripted(fast_kernel, SCRIPTS[name])
    assert run.demands[-1] == planned.demands[-1] == [sum(d for d, _, _ in plan) for plan in GroupRun.PLAN]
    for axis in range(3):
        assert run.motion.axes[axis].counter_units == planned.motion.axes[axis].counter_units
        directions = [(word >> 1, word & 1) for word in run.directions[axis]]
        assert pin_timing_faults(run.clk[axis][0::2], run.clk[axis][1::2], directions, Timing()) == []
        assert run.motion.axes[axis].delayed_steps <= len(directions)  # the step that waits for DIR at a reversal
    ends = [(tick, event) for tick, _, event in run.events if event is not AxisEvent.HALTED]
    assert len(ends) == 3
    assert {event for _, event in ends} == {AxisEvent.FINISHED}
    assert len({tick for tick, _ in ends}) == 1  # the axes stay in step to the end


def test_it_takes_the_planned_time_and_the_pause(fast_kernel: Kernel, planned: GroupRun) -> None:
    """A ramp of T takes T/2 longer than the path it covers: 9 kHz at 40 000 steps/s^2 are 900 ticks, down and up."""
    run = scripted(fast_kernel, SCRIPTS["once"])
    assert next((tick, event) for tick, axis, event in run.events if axis == 0) == (1501 + 900, AxisEvent.HALTED)
    assert run.motion.tick == pytest.approx(planned.motion.tick + 3000 - 900 + 2 * 450, abs=1)
    still = run.demands[1501 + 900 : 4501]
    assert all(demands == still[0] for demands in still)
    assert not [t for t in run.rises(0) if (1501 + 900) * k.TICK_COUNTS + 4800 < t < 4501 * k.TICK_COUNTS]


@pytest.mark.slow
def test_whole_ramps_only_shift_the_rest_of_the_motion(fast_kernel: Kernel, planned: GroupRun) -> None:
    """Two ramps of 900 ticks cover exactly 900 ticks of the path: later edges are the same, only later."""
    run = GroupRun(fast_kernel)
    for ticks, hold in ((1501, True), (3000, False)):
        run.pass_ticks(ticks)
        run.motion.group.hold(1, hold=hold)
        run.motion.group.ramp(run.motion.tick, 900)
    run.finish()
    shift = (run.motion.tick - planned.motion.tick) * k.TICK_COUNTS
    for axis in range(3):
        after = run.rises(axis)[run.rises(axis) > (4501 + 901) * k.TICK_COUNTS]
        assert len(after) > 100
        assert list(after - shift) == list(planned.rises(axis)[-len(after) :])


@DECELERATIONS
@pytest.mark.parametrize("name", ["once", "resumed while it slows down", "halted while it speeds up"])
def test_no_axis_decelerates_harder_than_allowed(fast_kernel: Kernel, name: str, deceleration_hz_per_s: int) -> None:
    """Where the plan has constant speed, all acceleration is the ramp's; over 20 ticks, rounding hardly shows."""
    run = scripted(fast_kernel, SCRIPTS[name], deceleration_hz_per_s * STEP)
    fast = np.array(run.demands)[:, 0] / STEP
    on_the_line = (fast > 450 + 1) & (fast < fast[-1] - 450 - 1)
    over = 20
    speeds_hz = (fast[over:] - fast[:-over]) / over * TICKS_PER_SECOND
    accelerations = (speeds_hz[over:] - speeds_hz[:-over]) / over * TICKS_PER_SECOND
    accelerations = np.abs(accelerations[on_the_line[: -2 * over] & on_the_line[2 * over :]])
    blur = 4 / STEP / over**2 * TICKS_PER_SECOND**2
    assert 0.95 * deceleration_hz_per_s < accelerations.max() <= deceleration_hz_per_s + blur


def test_the_ramp_suits_the_faster_segments_that_follow(kernel: Kernel) -> None:
    """1 kHz now, 8 kHz from 10 ms on: the ramp lasts as long as 8 kHz needs, but only if it reaches that part."""
    for deceleration_hz_per_s, ticks in ((20_000, 1600), (200_000, 20)):
        motion = BoardMotion(kernel, 1)
        motion.axes[0].configure(CONFIG)
        for record in ((10 * STEP, KHZ, 20), (45 * STEP, 8 * KHZ, 10), (80 * STEP, 8 * KHZ, 10)):
            assert motion.axes[0].push(*record) is Refusal.ACCEPTED
        motion.axes[0].start(in_group=True)
        motion.advance(40)
        motion.group.hold(0, hold=True)
        motion.ramp_group([deceleration_hz_per_s * STEP])
        assert motion.group.halt_tick == 40 + ticks


def test_the_ramp_lasts_at_most_as_long_as_a_stop(kernel: Kernel) -> None:
    motion = BoardMotion(kernel, 1)
    motion.axes[0].configure(CONFIG)
    motion.axes[0].push(10 * STEP, KHZ, 20)
    motion.axes[0].start(in_group=True)
    motion.advance(40)
    motion.group.hold(0, hold=True)
    motion.ramp_group([1])
    assert motion.group.halt_tick == 40 + STOP_MAX_MS * k.TICKS_PER_MS


def test_a_queue_that_runs_out_while_slowing_down_is_an_underrun(kernel: Kernel) -> None:
    motion = BoardMotion(kernel, 1)
    motion.axes[0].configure(CONFIG)
    motion.axes[0].push(40 * STEP, 4 * KHZ, 20)
    motion.axes[0].start(in_group=True)
    motion.advance(60)
    motion.group.hold(0, hold=True)
    motion.ramp_group([DECELERATION])
    motion.advance(1000)
    assert motion.take_events() == [(0, AxisEvent.UNDERRUN)]
    assert 0 < motion.axes[0].velocity < 4 * KHZ  # the velocity from which a stop must start


def test_velocity_is_scaled(kernel: Kernel) -> None:
    """Half way down the ramp of 400 ticks from 4 kHz the axis runs at 2 kHz, and then rests."""
    motion = BoardMotion(kernel, 1)
    motion.axes[0].configure(CONFIG)
    for record in ((40 * STEP, 4 * KHZ, 20), (1000 * STEP, 4 * KHZ, 250)):
        motion.axes[0].push(*record)
    motion.axes[0].start(in_group=True)
    motion.advance(80)
    motion.group.hold(0, hold=True)
    motion.ramp_group([DECELERATION])
    motion.advance(280)
    assert motion.axes[0].velocity == pytest.approx(2 * KHZ, abs=2)
    motion.advance(10_000)
    assert motion.tick == 480
    assert motion.take_events() == [(0, AxisEvent.HALTED)]
    assert motion.axes[0].velocity == 0
    assert motion.axes[0].running
    assert motion.axes[0].halted


RATES: dict[str, tuple[tuple[int, int | None], ...]] = {
    "slower": ((1501, SLOWEST), (3000, FULL)),
    "faster": ((1501, FASTEST),),
    "up and down": ((700, FASTEST), (900, 40_000), (900, FASTEST), (300, FULL)),
    "at half rate from the first segment on": ((7, FULL // 2),),
    "halted from a rate and back to it": (
        (800, FASTEST),
        (900, 0),
        (4000, None),
        (500, SLOWEST),
        (700, 0),
        (900, None),
    ),
    "changed during a halt": ((1501, 0), (2000, FASTEST), (500, None)),
    "changed on the way to another": ((1200, FASTEST), (100, SLOWEST), (100, FASTEST), (100, 0), (100, None)),
}
"""Ticks to let pass, then the rate wanted; 0 halts and None releases the halt."""


@cache
def rated(kernel: Kernel, script: tuple[tuple[int, int | None], ...], deceleration: int = DECELERATION) -> GroupRun:
    """Let ticks pass, then change the rate, halt or resume, for each pair of the script; then run to the end."""
    run = GroupRun(kernel, deceleration=deceleration)
    for axis in run.motion.axes:
        axis.highest_rate_q16 = FASTEST
    for ticks, rate_q16 in script:
        run.pass_ticks(ticks)
        if rate_q16:
            run.want(rate_q16)
        else:
            run.hold(hold=rate_q16 == 0)
    return run.finish()


@pytest.mark.parametrize("name", RATES)
def test_at_any_rate_every_edge_lies_on_the_planned_path(fast_kernel: Kernel, planned: GroupRun, name: str) -> None:
    """As in a halt: axis 0's edges show the place on the path, and the bound allows for the higher speed."""
    run = rated(fast_kernel, RATES[name])
    for axis, rate_per_count in ((1, 900 / 72e6), (2, 700 / 72e6)):
        assert run.signs(axis) == planned.signs(axis)
        shown = np.interp(run.rises(axis), run.rises(0), planned.rises(0))
        seen = (run.rises(axis) > run.rises(0)[0]) & (run.rises(axis) < run.rises(0)[-1])
        assert np.abs(shown - planned.rises(axis))[seen].max() * rate_per_count < 0.1


@pytest.mark.parametrize("name", RATES)
def test_at_any_rate_it_ends_where_planned_with_good_pulses(fast_kernel: Kernel, planned: GroupRun, name: str) -> None:
    run = rated(fast_kernel, RATES[name])
    assert run.demands[-1] == planned.demands[-1]
    for axis in range(3):
        directions = [(word >> 1, word & 1) for word in run.directions[axis]]
        assert pin_timing_faults(run.clk[axis][0::2], run.clk[axis][1::2], directions, Timing()) == []
    ends = [(tick, event) for tick, _, event in run.events if event is not AxisEvent.HALTED]
    assert {event for _, event in ends} == {AxisEvent.FINISHED}
    assert len({tick for tick, _ in ends}) == 1


def test_a_rate_takes_its_part_of_the_time(fast_kernel: Kernel, planned: GroupRun) -> None:
    """At 150 % from the start on 4800 ticks take 3200; at half rate 9600."""
    for rate_q16, ticks in ((FASTEST, 3200), (FULL // 2, 9600)):
        run = GroupRun(fast_kernel)
        run.want(rate_q16)  # at rest: it changes at once
        assert run.finish().motion.tick == ticks
        assert planned.motion.tick == 4800


@DECELERATIONS
@pytest.mark.parametrize("name", ["slower", "faster", "up and down", "halted from a rate and back to it"])
def test_no_ramp_between_rates_is_steeper_than_allowed(
    fast_kernel: Kernel, name: str, deceleration_hz_per_s: int
) -> None:
    """Where the plan has constant speed, all acceleration is the ramp's; over 20 ticks, rounding hardly shows."""
    run = rated(fast_kernel, RATES[name], deceleration_hz_per_s * STEP)
    fast = np.array(run.demands)[:, 0] / STEP
    on_the_line = (fast > 450 + 1) & (fast < fast[-1] - 450 - 1)
    over = 20
    speeds_hz = (fast[over:] - fast[:-over]) / over * TICKS_PER_SECOND
    accelerations = (speeds_hz[over:] - speeds_hz[:-over]) / over * TICKS_PER_SECOND
    accelerations = np.abs(accelerations[on_the_line[: -2 * over] & on_the_line[2 * over :]])
    blur = 4 / STEP / over**2 * TICKS_PER_SECOND**2
    assert 0.9 * deceleration_hz_per_s < accelerations.max() <= deceleration_hz_per_s + blur


def test_a_ramp_from_a_high_rate_suits_the_farther_segments_that_it_covers(kernel: Kernel) -> None:
    """A full ramp of 800 ticks from 150 % covers 900 ticks of the path, not 400: there 8 kHz is planned, not 4."""
    lasts = {}
    for rate_q16 in (FULL, FASTEST):
        motion = BoardMotion(kernel, 1)
        motion.axes[0].configure(CONFIG)
        for record in ((100 * STEP, 4 * KHZ, 50), (640 * STEP, 4 * KHZ, 160), (480 * STEP, 8 * KHZ, 80)):
            assert motion.axes[0].push(*record) is Refusal.ACCEPTED
        motion.axes[0].start(in_group=True)
        motion.group.wanted_q16 = rate_q16
        motion.ramp_group([20_000 * STEP])
        motion.advance(210 * FULL // rate_q16)
        motion.group.hold(0, hold=True)
        motion.ramp_group([20_000 * STEP])
        assert motion.group.halt_tick is not None
        lasts[rate_q16] = motion.group.halt_tick - motion.tick
    assert lasts == {FULL: 800, FASTEST: 1600 * 3 // 2}


def test_every_ramp_is_told(kernel: Kernel) -> None:
    motion, told = BoardMotion(kernel, 1), list[RateRamp]()
    motion.group.on_ramp = told.append
    motion.axes[0].configure(CONFIG)
    motion.axes[0].push(1000 * STEP, 4 * KHZ, 250)
    motion.axes[0].start(in_group=True)
    motion.advance(40)
    motion.group.wanted_q16 = SLOWEST
    assert motion.group.must_ramp
    motion.ramp_group([DECELERATION])
    assert not motion.group.must_ramp
    motion.axes[0].flush()
    motion.advance(50)
    assert motion.group.must_ramp
    motion.ramp_group([DECELERATION])
    assert not motion.group.must_ramp
    assert motion.group.rate_q16(50) == FULL
    assert [(ramp.tick, ramp.from_q16, ramp.to_q16) for ramp in told] == [(40, FULL, SLOWEST)], "not of an empty group"
    assert told[0].ticks > 0


RAMPS = st.lists(
    st.tuples(st.integers(1, 300), st.sampled_from([0, 0, FULL, FULL, 30_000, SLOWEST, FASTEST]), st.integers(0, 200)),
    max_size=8,
)
SEGMENTS = st.lists(
    st.tuples(st.integers(-40_000, 40_000), st.integers(-900_000, 900_000), st.integers(1, 60)), min_size=1, max_size=12
)


def ramped(rig: KernelRig, ramps: list[tuple[int, int, int]], ticks_at_once: int) -> None:
    """Let ticks pass, then ramp to a rate, for each pair of the script; then run at full rate to the end."""
    for ticks, rate_q16, ramp_ticks in [*ramps, (1, FULL, 0), (4000, FULL, 0)]:
        end = rig.tick + ticks
        while rig.tick < end:
            rig.advance(min(ticks_at_once, end - rig.tick))
            for axis in range(rig.count):
                rig.set(k.EVENT, k.EVENT_NONE, axis)
        rig.ramp(rate_q16, ramp_ticks)


@pytest.mark.slow
@given(axes=st.lists(SEGMENTS, min_size=1, max_size=3), ramps=RAMPS, microsteps=st.sampled_from([1, 16]))
@settings(max_examples=150)
def test_both_kernels_and_any_cut_of_time_give_the_same_bits(
    axes: list[list[Record]], ramps: list[tuple[int, int, int]], microsteps: int
) -> None:
    pytest.importorskip("numba", reason="the extra `fast` (numba) is not installed")
    results = []
    for kernel, ticks_at_once in ((python_kernel(), 4000), (compiled_kernel(), 4000), (compiled_kernel(), 7)):
        rig = KernelRig(kernel, len(axes), microsteps, Timing(1, 1, 0, 0), rate_limit_q16_per_ms=100 * k.STEP_Q16)
        for axis, segments in enumerate(axes):
            for segment in segments:
                rig.push(*segment, axis)
            rig.start(axis)
            rig.set(k.IN_GROUP, 1, axis)
        ramped(rig, ramps, ticks_at_once)
        results.append(rig.snapshot())
    assert results[0] == results[1] == results[2]


@pytest.mark.slow
@given(segments=SEGMENTS, ramps=RAMPS)
@settings(max_examples=60)
def test_the_demand_is_the_plan_at_the_scaled_time(segments: list[Record], ramps: list[tuple[int, int, int]]) -> None:
    """Compare with exact sums of mean rates and exact cubics; the bound is that of an evaluation at full rate.

    Only the sums are rounded, down to a Q16 tick, each from the start of its ramp.
    """
    rig = KernelRig(python_kernel(), timing=Timing(1, 1, 0, 0), rate_limit_q16_per_ms=100 * k.STEP_Q16)
    accepted = [segment for segment in segments if rig.push(*segment) == k.ACCEPTED]
    if not rig.start():
        return
    rig.set(k.IN_GROUP, 1)
    begin_q16 = 0
    for ticks, target_q16, ramp_ticks in [(5, FULL, 0), *ramps, (5, FULL, 0)]:
        from_q16 = rig.time.rate_q16(rig.tick)
        rig.ramp(target_q16, ramp_ticks)
        since_q16 = Fraction(0)
        for j in range(ticks):
            rate = Fraction(target_q16)
            if j < ramp_ticks:
                rate = from_q16 + Fraction((target_q16 - from_q16) * (2 * j + 1), 2 * ramp_ticks)
            since_q16 += rate
            rig.advance(1)
            t_ms = Fraction(begin_q16 + math.floor(since_q16), FULL * k.TICKS_PER_MS)
            expected = planned_steps(accepted, t_ms)
            assert abs(Fraction(rig.get(k.POSITION_Q16), 1 << 16) - expected) <= Fraction(6, 1 << 16)
        begin_q16 += math.floor(since_q16)


def planned_steps(records: list[Record], t_ms: Fraction) -> Fraction:
    """Return the position, in steps at 16 microsteps, of a chain of cubics that starts at rest and stays at its end."""
    start, v0 = Fraction(0), Fraction(0)
    for displacement_units, end_velocity, dt_ms in records:
        d, v1 = Fraction(displacement_units, STEP), Fraction(end_velocity, KHZ)
        if t_ms < dt_ms:
            s = t_ms / dt_ms
            a, e = v0 * dt_ms, v1 * dt_ms
            return start + ((a + e - 2 * d) * s**3 + (3 * d - 2 * a - e) * s**2 + a * s)
        start, v0, t_ms = start + d, v1, t_ms - dt_ms
    return start


def test_the_demand_is_the_plan_in_some_ramps() -> None:
    segments = [(30_000, 900_000, 20), (20_000, -300_000, 20), (-40_000, 0, 60)]
    ramps = [(60, 30_000, 50), (80, FASTEST, 33), (90, 0, 80), (20, FULL, 7)]
    one_example(test_the_demand_is_the_plan_at_the_scaled_time, segments, ramps)
    one_example(test_both_kernels_and_any_cut_of_time_give_the_same_bits, [segments, segments[:1]], ramps, 16)
