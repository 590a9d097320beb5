"""The kernel against an oracle in exact rational arithmetic, which shares only the statement of the rules with it."""

from fractions import Fraction

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import python_kernel
from tests.controller.motion.exact_hermite import ExactHermite
from tests.controller.motion.kernel_rig import KernelRig, Timing
from tests.controller.units import MS
from tests.one_example import one_example

TICKS_PER_MS = 4
H = Fraction(9, 16)
Q16 = Fraction(1, 1 << 16)
FAST_PINS = Timing(steplen=1, stepspace=1, dirsetup=0, dirhold=0)
"""Pulse timing so fast that no step waits: these tests check when steps are due."""


@pytest.mark.slow
@given(
    microsteps=st.sampled_from([1, 2, 5, 8, 16, 125, 256]),
    start_velocity=st.integers(-3_000_000, 3_000_000),
    displacement=st.integers(-500_000, 500_000),
    end_velocity=st.integers(-3_000_000, 3_000_000),
    duration_ticks=st.one_of(st.integers(1, 60), st.integers(1, 255).map(lambda ms: TICKS_PER_MS * ms)),
)
@settings(max_examples=120)
def test_positions_and_edges_against_exact_arithmetic(
    microsteps: int, start_velocity: int, displacement: int, end_velocity: int, duration_ticks: int
) -> None:
    """Positions are within 3 roundings of half a Q16 unit and 2 of the coefficients.

    For edges the bound adds the chord's sagitta a dt^2 / 8, one count of time at full speed and the interval's
    truncation."""
    rig = KernelRig(python_kernel(), microsteps=microsteps, timing=FAST_PINS, rate_limit_q16_per_ms=60 << 16)
    rig.set(k.TAIL_VELOCITY, start_velocity)
    assume(rig.push_ticks(displacement, end_velocity, duration_ticks) == k.ACCEPTED)
    per_unit = Fraction(microsteps, 16_384)
    exact = ExactHermite(
        Fraction(0),
        start_velocity * per_unit / 64,
        displacement * per_unit,
        end_velocity * per_unit / 64,
        Fraction(duration_ticks, TICKS_PER_MS),
    )
    position_bound = 5 * Q16
    sagitta = exact.acceleration_max() * Fraction(1, TICKS_PER_MS) ** 2 / 8
    edge_bound = position_bound + sagitta + 4 * exact.speed_max() / MS + 4 * Q16

    rig.start()
    counter, seen = 0, 0
    for tick in range(duration_ticks):
        rig.advance(1)
        p = rig.get(k.POSITION_Q16) * Q16
        assert abs(p - exact.position(Fraction(tick + 1, TICKS_PER_MS))) <= position_bound
        assert abs(p - rig.get(k.COUNTER)) < H  # every step due has been made
        for rise, sign in list(zip(rig.rises(), rig.signs(), strict=True))[seen:]:
            due = exact.position(Fraction(rise, MS))
            assert abs(due - (counter + sign * H)) <= edge_bound
            counter += sign
            seen += 1
    assert rig.get(k.POSITION_Q16) == displacement * microsteps * 4  # the last tick lands exactly
    assert counter == rig.get(k.COUNTER)


@pytest.mark.slow
@given(
    start_velocity=st.integers(-(1 << 23), (1 << 23) - 1),
    displacement=st.integers(-(1 << 23), (1 << 23) - 1),
    end_velocity=st.integers(-(1 << 23), (1 << 23) - 1),
    duration_ticks=st.integers(1, 255 * TICKS_PER_MS),
    microsteps=st.sampled_from([1, 2, 5, 8, 16, 125, 256]),
)
@settings(max_examples=500)
def test_every_intermediate_of_an_accepted_segment_fits_a_cortex_m3(
    start_velocity: int, displacement: int, end_velocity: int, duration_ticks: int, microsteps: int
) -> None:
    """The operands of each multiplication fit i32 (one SMULL) and products fit i64, for every value on the wire."""
    rig = KernelRig(python_kernel(), microsteps=microsteps, rate_limit_q16_per_ms=k.I32_MAX)
    rig.set(k.TAIL_VELOCITY, start_velocity)
    assume(rig.push_ticks(displacement, end_velocity, duration_ticks) == k.ACCEPTED)
    a, b, c = (int(rig.queue[field]) for field in (k.SEGMENT_A, k.SEGMENT_B, k.SEGMENT_C))
    n = int(rig.queue[k.SEGMENT_TICKS])
    for i in range(n + 1):
        s = (i << 30) // n
        value = c
        for following in (b, a):
            value = ((value * s + (1 << 29)) >> 30) + following
            assert abs(value) <= k.I32_MAX + 1
            assert abs(value * s) < 1 << 63


@pytest.mark.parametrize(("microsteps", "duration_ticks"), [(1, 400), (16, 100), (256, 9)])
def test_a_segment_against_exact_arithmetic(microsteps: int, duration_ticks: int) -> None:
    """There and back within the segment, or over its end."""
    for way, end in ((300, -600), (-77, 5)):
        one_example(
            test_positions_and_edges_against_exact_arithmetic,
            microsteps, 64 * way, way * duration_ticks // 8, 64 * end, duration_ticks,
        )  # fmt: skip


def test_the_intermediates_of_the_steepest_segments_fit() -> None:
    for velocity in (1 << 21, -(1 << 21)):
        one_example(test_every_intermediate_of_an_accepted_segment_fits_a_cortex_m3, velocity, 0, -velocity, 100, 256)
