"""The kernel in hand-computed cases, at its limits on both sides, and independent of how its calls are divided."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import Kernel, python_kernel
from tests.controller.motion.kernel_rig import KernelRig, Timing, timing_faults
from tests.controller.units import MS, STEP
from tests.kernel_forms import FORMS, kernel_form
from tests.one_example import one_example

ONE_STEP_PER_MS = 64 * STEP
"""1000 steps/s as a record's velocity, in 1/64 unit per ms."""


def test_constant_speed_by_hand(kernel: Kernel) -> None:
    """At 1 kHz from a counter at rest, step i is due when the demand reaches i + 9/16: at (i + 9/16) ms."""
    rig = KernelRig(kernel)
    rig.set(k.TAIL_VELOCITY, ONE_STEP_PER_MS)
    assert rig.push(10 * STEP, ONE_STEP_PER_MS, 10) == k.ACCEPTED
    assert rig.start()
    assert rig.advance(40) == 40
    assert rig.rises() == [MS * i + 40_500 for i in range(10)]
    assert rig.falls() == [rise + 2376 for rise in rig.rises()]
    assert rig.dir_edges() == [(2 * k.TICK_COUNTS, 1)]  # at the start of the tick of the first step
    assert rig.get(k.COUNTER) == 10
    assert rig.get(k.EVENT) == k.EVENT_UNDERRUN


def test_rest_to_rest_cubic_by_hand(kernel: Kernel) -> None:
    """p = 4 (3 s^2 - 2 s^3) steps in 8 ms passes 2 at half time; the four thresholds lie symmetrically about it."""
    rig = KernelRig(kernel)
    rig.push(4 * STEP, 0, 8)
    rig.start()
    assert rig.advance(32) == 32
    assert rig.get(k.EVENT) == k.EVENT_FINISHED
    assert rig.get(k.POSITION_Q16) == 4 << 16
    for rise, threshold in zip(rig.rises(), (0.5625, 1.5625, 2.5625, 3.5625), strict=True):
        s = rise / (8 * MS)
        assert 4 * (3 * s * s - 2 * s**3) == pytest.approx(threshold, abs=2e-3)


def test_a_reversal_within_the_hysteresis_makes_no_step(kernel: Kernel) -> None:
    """Move up over one threshold and back to just above the lower one, 9/16 - 1/8 step below: no step down."""
    rig = KernelRig(kernel)
    rig.push(600, 0, 10)  # 0.586 step: one step up at 0.5625
    rig.push(-130, 0, 10)  # down to 0.459 > 1 - 9/16
    rig.start()
    rig.advance(80)
    assert rig.signs() == [1]
    rig.push(-40, 0, 10)  # down to 0.420 < 0.4375
    rig.start()
    rig.advance(40)
    assert rig.signs() == [1, -1]


def test_every_unit_of_a_long_random_walk_is_accounted_for(kernel: Kernel) -> None:
    """Positions are absolute: after any number of segments the demand is exactly the sum of the displacements."""
    rng = np.random.default_rng(7)
    rig = KernelRig(kernel)
    total = 0
    for displacement in rng.integers(-3000, 3000, 200):
        assert rig.push(int(displacement), 0, 20) == k.ACCEPTED
        rig.start()
        rig.advance(80)
        total += int(displacement)
        assert rig.get(k.POSITION_Q16) == total * 64
        assert abs(rig.get(k.COUNTER) * 65_536 - total * 64) < k.THRESHOLD_Q16


class TestRefusals:
    def test_queue_takes_64_and_not_65(self, kernel: Kernel) -> None:
        rig = KernelRig(kernel)
        assert [rig.push(0, 0, 1) for _ in range(65)] == [k.ACCEPTED] * 64 + [k.REFUSED_QUEUE_FULL]

    @pytest.mark.parametrize(
        ("duration_ms", "answer"),
        [(0, k.REFUSED_DURATION), (1, k.ACCEPTED), (255, k.ACCEPTED), (256, k.REFUSED_DURATION)],
    )
    def test_duration(self, kernel: Kernel, duration_ms: int, answer: int) -> None:
        assert KernelRig(kernel).push(0, 0, duration_ms) == answer

    @pytest.mark.parametrize(
        ("duration_ticks", "answer"),
        [(0, k.REFUSED_DURATION), (1, k.ACCEPTED), (1020, k.ACCEPTED), (1021, k.REFUSED_DURATION)],
    )
    def test_duration_in_ticks(self, kernel: Kernel, duration_ticks: int, answer: int) -> None:
        assert KernelRig(kernel).push_ticks(0, 0, duration_ticks) == answer

    @pytest.mark.parametrize("duration_ticks", [1, 3, 5])
    def test_the_rate_limit_of_a_duration_in_ticks(self, kernel: Kernel, duration_ticks: int) -> None:
        """15 steps per ms are 3.75 a tick, 3840 units."""
        limit = 15 * ONE_STEP_PER_MS
        rig = KernelRig(kernel)
        rig.set(k.TAIL_VELOCITY, limit)
        assert rig.push_ticks(3840 * duration_ticks + 1, limit, duration_ticks) == k.REFUSED_TOO_FAST
        assert rig.push_ticks(3840 * duration_ticks, limit, duration_ticks) == k.ACCEPTED

    @pytest.mark.parametrize("sign", [1, -1])
    def test_end_velocity_at_the_rate_limit(self, kernel: Kernel, sign: int) -> None:
        """15 kHz may be reached exactly; one unit of velocity more is refused and changes nothing."""
        limit = 15 * ONE_STEP_PER_MS
        rig = KernelRig(kernel)
        rig.set(k.TAIL_VELOCITY, sign * limit)
        displacement = sign * 150 * STEP
        before = rig.snapshot()
        assert rig.push(displacement, sign * (limit + 1), 10) == k.REFUSED_TOO_FAST
        assert rig.snapshot() == before
        assert rig.push(displacement, sign * limit, 10) == k.ACCEPTED

    def test_speed_between_the_points_counts_too(self, kernel: Kernel) -> None:
        """From rest to rest the middle Bernstein coefficient is 3D/dt: 5 steps per ms of mean speed is the limit."""
        at_limit = 5 * STEP * 10
        assert KernelRig(kernel).push(at_limit, 0, 10) == k.ACCEPTED
        assert KernelRig(kernel).push(at_limit + 1, 0, 10) == k.REFUSED_TOO_FAST

    def test_coefficients_stay_inside_i32(self, kernel: Kernel) -> None:
        """At rest to rest the largest coefficient is b = 3D: D of 2^31 / 3 in Q16 steps is the end."""
        largest = ((1 << 31) - 1) // 3 // 64
        assert KernelRig(kernel, rate_limit_q16_per_ms=k.I32_MAX).push(largest, 0, 255) == k.ACCEPTED
        assert KernelRig(kernel, rate_limit_q16_per_ms=k.I32_MAX).push(largest + 1, 0, 255) == k.REFUSED_COEFFICIENT
        assert KernelRig(kernel, rate_limit_q16_per_ms=k.I32_MAX).push(-largest - 1, 0, 255) == k.REFUSED_COEFFICIENT

    def test_position_stays_inside_i32_units(self, kernel: Kernel) -> None:
        rig = KernelRig(kernel)
        rig.set(k.TAIL_Q16, (k.I32_MAX - 10) * 64)
        assert rig.push(11, 0, 100) == k.REFUSED_POSITION
        assert rig.push(10, 0, 100) == k.ACCEPTED


class TestPulseTiming:
    def test_steps_wait_for_stepspace_and_are_counted(self, kernel: Kernel) -> None:
        """20 kHz for a driver that makes 15 kHz: every rise except the first must wait."""
        rig = KernelRig(kernel, rate_limit_q16_per_ms=20 * k.STEP_Q16)
        rig.set(k.TAIL_VELOCITY, 20 * ONE_STEP_PER_MS)
        rig.push(20 * STEP, 20 * ONE_STEP_PER_MS, 1)
        rig.start()
        rig.advance(4)
        rises = rig.rises()
        assert np.diff(rises).tolist() == [4800] * 19
        assert rig.get(k.DELAYED_STEPS) == 19
        assert timing_faults(rig, Timing()) == []

    @pytest.mark.parametrize(("pulse_counts", "waits"), [(4799, []), (4800, []), (4801, [1, 2, 3])])
    def test_a_pulse_as_long_as_the_interval_need_not_wait(self, pulse_counts: int, waits: list[int]) -> None:
        """15 kHz is a step each 4800 counts; only longer pulses take the way of steps that wait, each a count more."""
        slow, placed = k.place_waiting_steps, list[bool]()

        def place(*arguments: Any) -> bool:
            placed.append(True)
            return slow(*arguments)

        rig = KernelRig(python_kernel(), timing=Timing(1000, pulse_counts - 1000, 0, 0))
        rig.set(k.TAIL_VELOCITY, 15 * ONE_STEP_PER_MS)
        rig.push_ticks(15 * STEP // 4, 15 * ONE_STEP_PER_MS, 1)
        rig.start()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(k, "place_waiting_steps", place)
            rig.advance(1)
        dues = [2700 + 4800 * i for i in range(4)]  # from a counter at rest 9/16 step to the first threshold
        late = [rise - due for rise, due in zip(rig.rises(), dues, strict=False)]
        assert [wait for wait in late if wait] == waits
        assert rig.get(k.DELAYED_STEPS) == len(waits)
        assert placed == [True] * bool(waits)

    def test_a_step_more_than_a_tick_late_asks_for_attention(self, kernel: Kernel) -> None:
        """20 kHz demanded at 15 kHz falls behind by a quarter of the time: a tick of lag after about four ticks."""
        rig = KernelRig(kernel, rate_limit_q16_per_ms=20 * k.STEP_Q16)
        rig.set(k.TAIL_VELOCITY, 20 * ONE_STEP_PER_MS)
        rig.push(2000 * STEP, 20 * ONE_STEP_PER_MS, 100)
        rig.start()
        reached = rig.advance(400)
        assert 3 <= reached <= 6
        assert rig.asking == 1
        assert rig.get(k.EVENT) == k.EVENT_LATE_STEP
        due = (len(rig.rises()) - 1 + 0.5625) / 20 * MS
        assert k.TICK_COUNTS < rig.rises()[-1] - due < 1.4 * k.TICK_COUNTS

    def test_a_late_step_is_seen_although_the_tick_catches_up(self, kernel: Kernel) -> None:
        """A reversal waits 400 us for dirhold; pulses of 8 us make up for it before the tick ends."""
        timing = Timing(steplen=288, stepspace=288, dirsetup=0, dirhold=28_800)
        rig = KernelRig(kernel, microsteps=1, timing=timing, rate_limit_q16_per_ms=200 * k.STEP_Q16)
        rig.push(9216, 0, 1)  # a step up at the very end of the first millisecond
        rig.push(-600_000, 0, 1)
        rig.start()
        assert rig.advance(8) == 5
        assert rig.get(k.EVENT) == k.EVENT_LATE_STEP
        assert rig.rises()[1] - rig.rises()[0] == timing.dirhold

    @pytest.mark.parametrize("successor", [False, True])
    def test_a_step_late_at_a_segments_very_end_does_not_stop_time(self, kernel: Kernel, *, successor: bool) -> None:
        """The reversal of the test above in a segment of one tick: called again, the kernel goes on from there."""
        timing = Timing(steplen=288, stepspace=288, dirsetup=0, dirhold=28_800)
        rig = KernelRig(kernel, microsteps=1, timing=timing, rate_limit_q16_per_ms=1000 * k.STEP_Q16)
        rig.push(9216, 0, 1)
        rig.push_ticks(-400_000, 0, 1)
        if successor:
            rig.push(0, 0, 2)
        rig.start()
        assert (rig.advance(8), rig.get(k.EVENT)) == (5, k.EVENT_LATE_STEP)
        assert rig.get(k.RUNNING) == successor
        rig.set(k.EVENT, k.EVENT_NONE)
        assert (rig.advance(8), rig.asking) == (13, int(successor))
        assert rig.get(k.EVENT) == (k.EVENT_FINISHED if successor else k.EVENT_NONE)

    def test_dir_never_changes_in_the_count_of_a_rise(self, kernel: Kernel) -> None:
        """Without dirhold, a step up at the end of a tick and one down in the next: the driver must count both."""
        timing = Timing(steplen=2160, stepspace=2640, dirsetup=0, dirhold=0)
        rig = KernelRig(kernel, microsteps=1, timing=timing, rate_limit_q16_per_ms=200 * k.STEP_Q16)
        rig.push(9216, 0, 1)
        rig.push(-60_000, -60_000 * 64, 1)
        rig.start()
        rig.advance(8)
        assert rig.dir_edges()[1] == (rig.rises()[0] + 1, 0)
        assert sum(rig.signs()) == rig.get(k.COUNTER) == -3

    def test_dir_waits_for_dirhold_and_the_step_for_dirsetup(self, kernel: Kernel) -> None:
        """A sharp reversal: DIR comes dirhold after the last rise up, the next rise dirsetup after DIR."""
        timing = Timing(steplen=500, stepspace=500, dirsetup=9_000, dirhold=12_000)
        rig = KernelRig(kernel, timing=timing, rate_limit_q16_per_ms=60 * k.STEP_Q16)
        rig.push(20 * STEP, 0, 1)
        rig.push(-20 * STEP, 0, 1)
        rig.start()
        rig.advance(8)
        assert timing_faults(rig, timing) == []
        (_, up), (down_counts, down) = rig.dir_edges()
        assert (up, down) == (1, 0)
        rises = np.array(rig.rises())
        last_up, first_down = rises[rises < down_counts][-1], rises[rises > down_counts][0]
        assert down_counts - last_up >= timing.dirhold
        assert first_down - down_counts == timing.dirsetup

    @pytest.mark.slow
    @given(
        points=st.lists(st.tuples(st.integers(-9000, 9000), st.integers(1, 20)), min_size=1, max_size=12),
        timing=st.builds(
            Timing,
            steplen=st.integers(300, 2500),
            stepspace=st.integers(300, 2500),
            dirsetup=st.integers(0, 9000),
            dirhold=st.integers(0, 9000),
        ),
    )
    def test_no_edge_ever_breaks_a_window(self, points: list[tuple[int, int]], timing: Timing) -> None:
        rig = KernelRig(python_kernel(), timing=timing, rate_limit_q16_per_ms=200 * k.STEP_Q16)
        for displacement, duration_ms in points:
            rig.push(displacement, 0, duration_ms)
        rig.start()
        rig.advance(sum(4 * ms for _, ms in points))
        assert timing_faults(rig, timing) == []
        assert sum(rig.signs()) == rig.get(k.COUNTER)

    @pytest.mark.slow
    @pytest.mark.parametrize("name", FORMS)
    @given(
        units_per_ms=st.integers(100, 60_000),
        sign=st.sampled_from([1, -1]),
        start_units=st.integers(-575, 575),
        wait_counts=st.sampled_from([-1, 0, 1, k.TICK_COUNTS, k.TICK_COUNTS + 1]),
        pulse_beyond_interval=st.integers(-1, 1),
    )
    def test_steps_wait_exactly_if_they_must(
        self, name: str, units_per_ms: int, sign: int, start_units: int, wait_counts: int, pulse_beyond_interval: int
    ) -> None:
        """In a tick of constant speed each rise is at its due time or a pulse after the last rise, whichever is later.

        The driver is ready just before or after the first step is due; pulses are just under or over an interval.
        """
        travel_q16 = 16 * units_per_ms  # a quarter of a millisecond, 64 Q16 a unit
        to_threshold_q16 = k.THRESHOLD_Q16 - sign * 64 * start_units
        interval_q16 = (k.TICK_COUNTS << 32) // travel_q16
        first_q16 = to_threshold_q16 * interval_q16 >> 16
        steps = max(0, (travel_q16 - to_threshold_q16) // k.STEP_Q16 + 1)
        tick = 7
        dues = [tick * k.TICK_COUNTS + (first_q16 + i * interval_q16 >> 16) for i in range(steps)]
        ready = tick * k.TICK_COUNTS + (first_q16 >> 16) + wait_counts
        pulse = (interval_q16 >> 16) + pulse_beyond_interval
        expected: list[int] = []
        for due in dues:
            expected.append(max(due, expected[-1] + pulse if expected else ready))

        rig = KernelRig(kernel_form(name), timing=Timing(pulse // 3, pulse - pulse // 3, 0, 0))
        rig.set(k.RATE_LIMIT_Q16_PER_MS, 60 * k.STEP_Q16)
        rig.set(k.POSITION_Q16, 64 * start_units)
        rig.set(k.TAIL_Q16, 64 * start_units)
        rig.set(k.TAIL_VELOCITY, 64 * sign * units_per_ms)
        rig.set(k.DIR_LEVEL, int(sign > 0))
        rig.set(k.EARLIEST_RISE_COUNTS, ready)
        assert rig.push(sign * units_per_ms, 64 * sign * units_per_ms, 1) == k.ACCEPTED
        rig.start()
        rig.tick = tick
        rig.advance(1)
        late = [rise - due for rise, due in zip(expected, dues, strict=True)]
        assert rig.rises() == expected
        assert rig.falls() == [rise + pulse // 3 for rise in expected]
        assert rig.get(k.COUNTER) == sign * steps
        assert rig.get(k.DELAYED_STEPS) == sum(wait > 0 for wait in late)
        assert rig.get(k.EVENT) == (k.EVENT_LATE_STEP if max(late, default=0) > k.TICK_COUNTS else k.EVENT_NONE)
        assert rig.get(k.EARLIEST_RISE_COUNTS) == (expected[-1] + pulse if expected else ready)


SEGMENTS = st.lists(
    st.tuples(st.integers(-400_000, 400_000), st.integers(-4_000_000, 4_000_000), st.integers(0, 256)),
    min_size=1,
    max_size=20,
)


TIMINGS = st.builds(
    Timing,
    steplen=st.integers(1, 2500),
    stepspace=st.integers(1, 2500),
    dirsetup=st.integers(0, 9000),
    dirhold=st.integers(0, 9000),
)


def half_a_second(
    kernel: Kernel, axes: tuple[tuple[tuple[int, int, int], ...], ...], microsteps: int, timing: Timing, inverted: int
) -> tuple[object, ...]:
    """Return what a kernel answers and places in 2000 ticks, whatever its axes need attention for."""
    rig = KernelRig(kernel, len(axes), microsteps, timing, rate_limit_q16_per_ms=100 * k.STEP_Q16)
    for axis in range(len(axes)):
        rig.set(k.DIR_INVERTED, inverted, axis)
    answers = [rig.push(*segment, axis) for axis, segments in enumerate(axes) for segment in segments]
    started = [rig.start(axis) for axis in range(len(axes))]
    while rig.tick < 2000 and rig.advance(2000 - rig.tick) < 2000:
        for axis in range(len(axes)):
            rig.set(k.EVENT, k.EVENT_NONE, axis)
    return answers, started, [kernel.demand_rate(rig.axes, axis) for axis in range(len(axes))], rig.snapshot()


@cache
def of_plain_python(*told: Any) -> tuple[object, ...]:
    """Return the reference, which is the same for each form: all are given the same examples."""
    return half_a_second(python_kernel(), *told)


class TestIndependence:
    @pytest.mark.slow
    @pytest.mark.parametrize("name", [name for name in FORMS if name != "python"])
    @given(
        axes=st.lists(SEGMENTS, min_size=1, max_size=3),
        microsteps=st.sampled_from([1, 2, 5, 8, 16, 125, 256]),
        timing=st.one_of(st.just(Timing(300, 300, 500, 500)), TIMINGS),
        inverted=st.integers(0, 1),
    )
    @settings(max_examples=150)
    def test_every_form_gives_the_bits_of_plain_python(
        self, name: str, axes: list[list[tuple[int, int, int]]], microsteps: int, timing: Timing, inverted: int
    ) -> None:
        told = tuple(map(tuple, axes)), microsteps, timing, inverted
        assert half_a_second(kernel_form(name), *told) == of_plain_python(*told)

    @pytest.mark.slow
    @given(
        segments=st.lists(
            st.tuples(st.integers(-1500, 1500), st.integers(-5000, 5000), st.integers(1, 20)), min_size=1, max_size=8
        ),
        rate_q16=st.sampled_from([k.FULL_RATE_Q16, 50_000]),
    )
    def test_a_segment_without_a_step_is_one_jump_with_the_same_bits(
        self, segments: list[tuple[int, int, int]], rate_q16: int
    ) -> None:
        def run() -> KernelRig:
            rig = KernelRig(python_kernel())
            rig.set(k.IN_GROUP, 1)
            rig.ramp(rate_q16, 0)
            for segment in segments:
                assert rig.push(*segment) == k.ACCEPTED
            rig.start()
            rig.advance(800)
            return rig

        with pytest.MonkeyPatch.context() as patch:
            jumping = run()
            patch.setattr(k, "makes_no_step", lambda *_: False)
            assert run().snapshot() == jumping.snapshot()

    @pytest.mark.slow
    @given(chunks=st.lists(st.integers(1, 50), min_size=1, max_size=40))
    def test_edges_do_not_depend_on_how_time_is_cut(self, chunks: list[int]) -> None:
        def run(steps: list[int]) -> KernelRig:
            rig = KernelRig(python_kernel(), axes=2)
            for axis, sign in enumerate((1, -1)):
                for displacement, ms in ((30_000, 30), (-20_000, 17), (40_000, 120), (-90_000, 83)):
                    assert rig.push(sign * displacement, 0, ms, axis) == k.ACCEPTED
                rig.start(axis)
            for ticks in steps:
                rig.advance(ticks)
            rig.advance(1000 - rig.tick)
            return rig

        total = 1000
        short = [c for c in chunks if c <= total]
        while sum(short) > total:
            short.pop()
        assert run(short).snapshot() == run([total]).snapshot()

    def test_axes_that_ran_too_far_come_back_to_the_common_tick(self, kernel: Kernel) -> None:
        """Axis 1 finishes first: axis 0, computed before it, must be at the same tick, as if run alone up to it."""
        both, alone = KernelRig(kernel, axes=2), KernelRig(kernel, axes=2)
        for rig in (both, alone):
            rig.push(30_000, 0, 50, 0)
            rig.start(0)
        both.push(3_000, 0, 20, 1)
        both.start(1)
        assert both.advance(200) == 80
        alone.advance(80)
        assert both.rises(0) == alone.rises(0)
        assert both.get(k.POSITION_Q16, 0) == alone.get(k.POSITION_Q16, 0)
        assert both.get(k.EVENT, 1) == k.EVENT_FINISHED


@pytest.mark.parametrize(("peak_hz", "sine_hz"), [(300, 1.0), (2_000, 1.0), (14_000, 0.25), (14_000, 0.5)])
def test_sine_edges_lie_within_a_thousandth_of_a_step(fast_kernel: Kernel, peak_hz: int, sine_hz: float) -> None:
    """PVT points every 10 ms of A (1 - cos wt): at every edge the ideal is at its threshold within 0.001 step."""
    edges = ideal_error_of_a_sine(fast_kernel, peak_hz, sine_hz)
    assert np.abs(edges).max() < 1e-3
    assert len(edges) == pytest.approx(2 * peak_hz / (math.pi * sine_hz), abs=4)


def test_edge_errors_come_from_the_wire_unit_and_the_chord(fast_kernel: Kernel) -> None:
    """At 88 000 steps/s^2 the bound is half a unit of rounding, the chord's sagitta a dt^2 / 8, a little arithmetic."""
    peak_hz, sine_hz = 14_000, 1.0
    acceleration = 2 * math.pi * sine_hz * peak_hz
    bound = 0.5 / STEP + acceleration * 250e-6**2 / 8 + 2e-4
    error = np.abs(ideal_error_of_a_sine(fast_kernel, peak_hz, sine_hz)).max()
    assert bound / 2 < error < bound


def ideal_error_of_a_sine(kernel: Kernel, peak_hz: int, sine_hz: float) -> NDArray[np.float64]:
    """Run one period from rest to rest; return demand - threshold in steps at every edge that did not wait for DIR."""
    omega = 2 * math.pi * sine_hz
    amplitude = peak_hz / omega
    seconds = np.arange(round(100 / sine_hz) + 1) / 100
    units = np.floor(amplitude * (1 - np.cos(omega * seconds)) * STEP + 0.5).astype(int)
    velocities = np.round(peak_hz * np.sin(omega * seconds) / 1000 * ONE_STEP_PER_MS).astype(int)
    rig = KernelRig(kernel, edges=1 << 17)
    for i, (displacement, velocity) in enumerate(zip(np.diff(units), velocities[1:], strict=True)):
        assert rig.push(int(displacement), int(velocity), 10) == k.ACCEPTED
        if i == 0:
            rig.start()
        elif i >= k.QUEUE_DEPTH - 1:
            rig.advance(40)
    rig.advance(40 * len(seconds) - rig.tick)

    signs = np.array(rig.signs())
    thresholds = np.cumsum(signs) - signs + signs * 0.5625
    ideal = amplitude * (1 - np.cos(omega * np.array(rig.rises()) / 72e6))
    assert rig.get(k.DELAYED_STEPS) == 0
    error: NDArray[np.float64] = ideal - thresholds
    return error


def test_waiting_and_jumps_in_some_cases() -> None:
    checks = TestPulseTiming()
    for wait_counts in (-1, 0, 1, k.TICK_COUNTS, k.TICK_COUNTS + 1):
        for pulse_beyond_interval in (-1, 0, 1):
            one_example(
                TestPulseTiming.test_steps_wait_exactly_if_they_must,
                checks, "python", 20_000, -1, 300, wait_counts, pulse_beyond_interval,
            )  # fmt: skip
    points = [(9000, 1), (-9000, 2), (4000, 20), (-1, 1)]
    one_example(TestPulseTiming.test_no_edge_ever_breaks_a_window, checks, points, Timing(2376, 2424, 9000, 5000))
    jumps = TestIndependence()
    for rate_q16 in (k.FULL_RATE_Q16, 50_000):
        one_example(
            TestIndependence.test_a_segment_without_a_step_is_one_jump_with_the_same_bits,
            jumps, [(400, 0, 20), (1500, -300, 7), (-900, 0, 20)], rate_q16,
        )  # fmt: skip
    one_example(TestIndependence.test_edges_do_not_depend_on_how_time_is_cut, jumps, [1, 50, 7, 33, 49])
