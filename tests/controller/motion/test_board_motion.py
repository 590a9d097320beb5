"""Motion around the kernel: places, stops, and the room for edges."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from steptwin.controller.motion.axis_motion import STOP_MAX_MS, AxisEvent, Refusal, stop_segments
from steptwin.controller.motion.backend import Kernel, python_kernel
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.motion.kernel import FULL_RATE_Q16, HIGHEST_RATE_Q16, TICK_COUNTS, TICKS_PER_MS
from steptwin.controller.motion.step_config import StepConfig
from tests.controller.units import STEP
from tests.one_example import one_example

CONFIG = StepConfig(16, 33_000, 33_666, 15_000, 15_000, velocity_max_units_per_s=20_000 * STEP)


def moving(kernel: Kernel, axes: int = 1, config: StepConfig = CONFIG) -> BoardMotion:
    motion = BoardMotion(kernel, axes)
    for axis in range(axes):
        motion.axes[axis].configure(config)
    return motion


@pytest.mark.slow
def test_an_unconfigured_axis_refuses_motion(kernel: Kernel) -> None:
    assert BoardMotion(kernel, 1).axes[0].push(1, 0, 1) is Refusal.TOO_FAST


def test_preset_keeps_the_fraction_of_a_step(kernel: Kernel) -> None:
    """The demand may lie between two steps; the counter is the nearest whole one."""
    motion = moving(kernel)
    for units, steps in ((511, 0), (512, 1), (-512, 0), (-513, -1), (1_000_000, 977)):
        motion.axes[0].preset(units)
        assert motion.axes[0].demand_units == units
        assert motion.axes[0].counter_units == steps * STEP


def test_reconfiguring_moves_no_counter(kernel: Kernel) -> None:
    """After a motion the demand may be 9/16 step from the counter; the motor is at the counter."""
    motion = moving(kernel)
    motion.axes[0].push(570, 0, 10)  # 0.557 step: no step yet
    motion.axes[0].start()
    motion.advance(40)
    motion.take_events()
    assert (motion.axes[0].demand_units, motion.axes[0].counter_units) == (570, 0)
    motion.axes[0].configure(StepConfig(16, 40_000, 40_000, 0, 0, STEP))
    assert (motion.axes[0].demand_units, motion.axes[0].counter_units) == (570, 0)


@pytest.mark.parametrize(("steplen_ns", "later_counts"), [(33_000, 0), (1_000_000, 0), (1_000_014, 2)])
def test_a_pulse_that_is_placed_keeps_its_length(kernel: Kernel, steplen_ns: int, later_counts: int) -> None:
    """A pulse of 1 ms ends when it would have, or later by what a longer one takes more."""
    motion = moving(kernel, config=StepConfig(16, 1_000_000, 1_000_000, 0, 0, 400 * STEP))
    (axis,) = motion.axes
    axis.push(STEP, 0, 20)
    axis.start()
    motion.advance(80)
    motion.take_events()
    fall_counts = int(motion.take_edges()[0].clk_counts[-1])
    assert axis.last_fall_counts == fall_counts
    axis.configure(StepConfig(16, steplen_ns, 33_666, 0, 0, 400 * STEP))
    assert axis.last_fall_counts == fall_counts + later_counts


@pytest.mark.parametrize(("microsteps", "counter_units"), [(1, 16_384), (2, 24_576), (8, 20_480)])
def test_a_new_microstep_setting_keeps_the_place(kernel: Kernel, microsteps: int, counter_units: int) -> None:
    motion = moving(kernel)
    motion.axes[0].preset(20 * STEP + 100)
    motion.axes[0].configure(StepConfig(microsteps, 33_000, 33_666, 0, 0, STEP))
    assert (motion.axes[0].demand_units, motion.axes[0].counter_units) == (20 * STEP, counter_units)


def test_stop_lasts_as_asked_and_ends_at_rest(kernel: Kernel) -> None:
    """From 8 kHz in 100 ms: 400 steps of stopping distance, the motor at most half a step from the demand."""
    motion = moving(kernel)
    assert motion.axes[0].push(400 * STEP, 8 * 65_536, 100) is Refusal.ACCEPTED
    assert motion.axes[0].push(2040 * STEP, 8 * 65_536, 255) is Refusal.ACCEPTED
    motion.axes[0].start()
    motion.advance(500)
    before = motion.axes[0].demand_units
    velocity = motion.axes[0].velocity
    assert velocity == pytest.approx(8 * 65_536, abs=64)
    motion.axes[0].stop(100)
    assert motion.advance(2000) == 900
    assert motion.take_events() == [(0, AxisEvent.FINISHED)]
    assert not motion.axes[0].running
    expected = velocity * 100 / 2 / 64
    assert motion.axes[0].demand_units - before == pytest.approx(expected, abs=1)
    assert abs(motion.axes[0].demand_units - motion.axes[0].counter_units) <= 0.5626 * STEP


@pytest.mark.parametrize("answer", [lambda motion: motion.axes[0].flush(), lambda motion: motion.axes[0].stop(10)])
def test_flush_and_stop_cancel_an_event_that_waits_for_its_tick(
    kernel: Kernel, answer: Callable[[BoardMotion], None]
) -> None:
    """The kernel is up to a tick ahead of the board's clock; until the event is taken the axis counts as running."""
    motion = moving(kernel)
    motion.axes[0].push(4096, 800 * 64, 10)
    motion.axes[0].start()
    assert motion.advance(100) == 40
    assert motion.events
    assert motion.axes[0].running
    answer(motion)
    assert not motion.events
    assert motion.take_events() == []


def test_a_stop_without_room_for_its_ramp_is_dead(kernel: Kernel) -> None:
    motion = moving(kernel)
    motion.axes[0].preset(2**31 - 1 - 5000)
    motion.axes[0].push(4000, 800 * 64, 10)
    motion.axes[0].start()
    motion.advance(40)
    motion.axes[0].stop(100)
    assert not motion.axes[0].running
    assert motion.axes[0].velocity == 0


def test_the_longest_stop_still_fits_the_queue(kernel: Kernel) -> None:
    motion = moving(kernel)
    motion.axes[0].push(40 * STEP, 65_536, 80)
    motion.axes[0].push(80 * STEP, 65_536, 80)
    motion.axes[0].start()
    motion.advance(320)
    motion.axes[0].stop(STOP_MAX_MS)
    while motion.axes[0].running:
        motion.advance(10**6)
        motion.take_edges()
        events = motion.take_events()
    assert events == [(0, AxisEvent.FINISHED)]
    assert motion.tick == 320 + 4 * STOP_MAX_MS


@given(velocity=st.integers(-983_040, 983_040), duration_ms=st.integers(1, 4000))
def test_stop_ramps_are_straight_lines_to_zero(velocity: int, duration_ms: int) -> None:
    """Velocities never exceed the first one, never change sign, fall by the same rate; the distance is v T / 2."""
    segments = stop_segments(velocity, duration_ms)
    assert sum(dt for _, _, dt in segments) == duration_ms
    assert segments[-1][1] == 0
    elapsed = 0
    for _, end_velocity, dt in segments:
        elapsed += dt
        exact = velocity * (duration_ms - elapsed) / duration_ms
        assert abs(end_velocity - exact) < 1
        assert abs(end_velocity) <= abs(exact) + 1e-9
    distance = sum(displacement for displacement, _, _ in segments)
    assert abs(distance - velocity * duration_ms / 128) < 1


@pytest.mark.slow
@given(
    displacement=st.integers(-300_000, 300_000),
    end_velocity=st.integers(-900_000, 900_000),
    duration_ms=st.integers(2, 255),
    at_tick=st.integers(1, 1000),
    stop_ms=st.integers(1, 600),
)
def test_a_stop_from_anywhere_keeps_position_and_ends(
    displacement: int, end_velocity: int, duration_ms: int, at_tick: int, stop_ms: int
) -> None:
    """For any segment stopped at any time: no jump, no speed above that at the stop, then rest."""
    motion = moving(python_kernel())
    assume(motion.axes[0].push(displacement, end_velocity, duration_ms) is Refusal.ACCEPTED)
    motion.axes[0].start()
    motion.advance(min(at_tick, 4 * duration_ms - 1))
    velocity, position = motion.axes[0].velocity, motion.axes[0].demand_units
    motion.axes[0].stop(stop_ms)
    end = motion.tick + 4 * stop_ms
    previous = position
    while motion.tick < end:
        motion.advance(min(motion.tick + 4, end))
        here = motion.axes[0].demand_units
        assert abs(here - previous) <= abs(velocity) / 64 + 2
        previous = here
    assert motion.take_events() == [(0, AxisEvent.FINISHED)]
    assert abs(motion.axes[0].demand_units - position - velocity * stop_ms / 128) <= 1.5


def test_advance_stops_for_draining_before_edges_can_overflow(kernel: Kernel) -> None:
    motion = moving(kernel)
    room = motion.room_ticks
    for i in range(40):
        motion.axes[0].push((-1) ** i * 1_000_000, 0, 255)
    motion.axes[0].start()
    reached = motion.advance(10**6)
    assert reached == room
    assert motion.room_ticks == 0
    assert motion.advance(10**6) == reached
    first = motion.take_edges()[0].clk_counts
    motion.advance(2 * room)
    second = motion.take_edges()[0].clk_counts
    assert first[-2] < reached * TICK_COUNTS + 4800 < second[-2]
    assert np.all(np.diff(np.concatenate((first, second))) > 0)


def test_faster_pulses_leave_room_for_fewer_ticks(kernel: Kernel) -> None:
    motion = moving(kernel)
    slow = motion.room_ticks
    motion.axes[0].configure(StepConfig(16, 4_000, 4_000, 0, 0, 125_000 * STEP))
    assert motion.room_ticks == pytest.approx(slow * (15 // 4 + 2) / (125 // 4 + 2), rel=0.01)


def test_time_passes_over_resting_axes_without_limit(kernel: Kernel) -> None:
    motion = moving(kernel)
    assert motion.advance(10**9) == 10**9
    assert motion.room_ticks > 0


@pytest.mark.slow
@given(
    displacement=st.integers(-60 * STEP, 60 * STEP),
    end_velocity=st.integers(-40_000, 40_000),
    duration_ms=st.integers(1, 40),
    begun_ticks=st.integers(0, 100),
    steps=st.integers(1, 30),
    rate_q16=st.sampled_from([FULL_RATE_Q16, 70_000, HIGHEST_RATE_Q16]),
)
def test_quiet_ticks_promise_fewer_steps(
    displacement: int, end_velocity: int, duration_ms: int, begun_ticks: int, steps: int, rate_q16: int
) -> None:
    """Also for the records of a group whose time runs as fast as it may."""
    motion = moving(python_kernel())
    motion.axes[0].highest_rate_q16 = rate_q16
    assume(motion.axes[0].push(displacement, end_velocity, duration_ms) is Refusal.ACCEPTED)
    lasts_ticks = duration_ms * TICKS_PER_MS * FULL_RATE_Q16 // rate_q16
    assume(begun_ticks < lasts_ticks)
    motion.axes[0].start(in_group=True)
    motion.group.wanted_q16 = rate_q16
    motion.group.ramp(motion.tick, 0)
    motion.advance(begun_ticks)
    before, quiet_ticks = motion.axes[0].counter_steps, motion.axes[0].quiet_ticks(steps)
    assert motion.tick + quiet_ticks <= lasts_ticks
    while quiet_ticks:
        quiet_ticks -= 1
        motion.advance(motion.tick + 1)
        assert abs(motion.axes[0].counter_steps - before) < steps


def test_quiet_ticks_are_all_but_one_at_constant_speed() -> None:
    """One step takes 16 ms: the promise ends with the very tick that makes it, or one before, or with the segment."""
    motion = moving(python_kernel())
    for _ in range(2):
        assert motion.axes[0].push(STEP, STEP * 64 // 16, 16) is Refusal.ACCEPTED
    motion.axes[0].start()
    motion.advance(16 * TICKS_PER_MS)
    assert motion.axes[0].quiet_ticks(2) == 16 * TICKS_PER_MS  # the segment's end
    counter, ticks = motion.axes[0].counter_steps, motion.axes[0].quiet_ticks(1)
    motion.advance(motion.tick + ticks)
    assert motion.axes[0].counter_steps == counter
    motion.advance(motion.tick + 2)
    assert motion.axes[0].counter_steps == counter + 1


def test_some_stops_and_promises() -> None:
    for at_tick, stop_ms in ((1, 600), (77, 1), (200, 50)):
        one_example(test_a_stop_from_anywhere_keeps_position_and_ends, 100_000, -50_000, 60, at_tick, stop_ms)
    for rate_q16 in (FULL_RATE_Q16, HIGHEST_RATE_Q16):
        one_example(test_quiet_ticks_promise_fewer_steps, 40 * STEP, -10_000, 30, 20, 3, rate_q16)
