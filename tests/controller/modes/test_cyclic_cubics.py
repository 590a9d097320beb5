"""The arithmetic of cyclic synchronous position, checked with exact fractions and with the kernel."""

from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from steptwin.controller.modes.cyclic_position import CyclicCubic, highest_velocity, parabola, slowed
from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import python_kernel
from steptwin.controller.node.soft_limits import hull
from tests.controller.motion.kernel_rig import KernelRig
from tests.one_example import one_example

points = st.integers(-(2**31), 2**31)
RATES_Q16 = st.integers(4, 125 << 16).map(lambda rate: rate & -4)


@pytest.mark.slow
@given(units=st.tuples(points, points, points), after_us=st.integers(-249, 249), period_us=st.integers(1000, 10_020))
def test_the_parabola_goes_through_all_three(units: tuple[int, int, int], after_us: int, period_us: int) -> None:
    """Compare with Lagrange's formula and its derivative, each rounded once."""
    t = Fraction(after_us, period_us)
    p0, p1, p2 = units
    position = p0 * (t + 1) * (t + 2) / 2 - p1 * t * (t + 2) + p2 * t * (t + 1) / 2
    slope = p0 * (2 * t + 3) / 2 - p1 * (2 * t + 2) + p2 * (2 * t + 1) / 2
    knot = parabola(units, after_us, period_us)
    assert abs(knot.position_units - position) <= Fraction(1, 2)
    assert abs(knot.velocity - slope * 64_000 / period_us) <= Fraction(1, 2)
    assert parabola(units, 0, period_us).position_units == p0


@pytest.mark.slow
@example(159_700, 2, 16, Fraction(0), Fraction(-1), Fraction(0), 2751)  # half a Q16 step, which is rounded up
@given(
    rate_q16=RATES_Q16,
    microsteps=st.sampled_from([1, 2, 8, 16]),
    ticks=st.integers(3, 41),
    start=st.fractions(-1, 1, max_denominator=1000),
    way=st.fractions(-3, 3, max_denominator=1000),
    end=st.fractions(-3, 3, max_denominator=1000),
    room=st.one_of(st.integers(0, 10**5), st.just(10**12)),
)
def test_the_kernel_takes_every_slowed_cubic_and_none_that_is_better(
    rate_q16: int, microsteps: int, ticks: int, start: Fraction, way: Fraction, end: Fraction, room: int
) -> None:
    limit = rate_q16 * 64 // (4 * microsteps)
    rig = KernelRig(python_kernel(), microsteps=microsteps, rate_limit_q16_per_ms=rate_q16)
    start_velocity = int(start * limit)
    rig.set(k.TAIL_VELOCITY, start_velocity)
    wanted = CyclicCubic(int(way * limit * ticks / 256), int(end * limit))
    cubic = slowed(wanted, start_velocity, limit, room, ticks, microsteps)
    sign = 1 if wanted.displacement_units > cubic.displacement_units else -1
    assert abs(cubic.end_velocity) <= min(limit, room)
    if abs(wanted.end_velocity) <= room and rig.push_ticks(*wanted, ticks) == k.ACCEPTED:
        assert cubic == wanted
        return
    if cubic.displacement_units != wanted.displacement_units:
        fastest = sign * min(limit, room)
        assert rig.push_ticks(cubic.displacement_units + sign, fastest, ticks) == k.REFUSED_TOO_FAST
    assert rig.push_ticks(*cubic, ticks) == k.ACCEPTED


@pytest.mark.slow
@given(
    room_units=st.integers(0, 10**6),
    displacement=st.integers(0, 10**6),
    duration_ms=st.integers(1, 10),
    share=st.fractions(-1, 1, max_denominator=100),
)
def test_the_room_before_a_limit_is_kept(room_units: int, displacement: int, duration_ms: int, share: Fraction) -> None:
    """Two cubics from rest to a knot and back: the hulls of both stay within the limit."""
    velocity = int(share * highest_velocity(room_units, 1000 * duration_ms))
    _, most = hull(0, 0, displacement, velocity, duration_ms)
    assert most <= displacement + room_units + 1
    _, most = hull(displacement, velocity, -displacement, 0, duration_ms)
    assert most <= displacement + room_units + 1


@pytest.mark.parametrize(("way", "end"), [(Fraction(1, 2), Fraction(1, 2)), (Fraction(2), Fraction(-3))])
def test_some_cubics(way: Fraction, end: Fraction) -> None:
    one_example(test_the_parabola_goes_through_all_three, (1000, -70_001, 12), -200, 3001)
    for start, room in ((Fraction(-1), 10**12), (Fraction(1, 3), 900)):
        one_example(
            test_the_kernel_takes_every_slowed_cubic_and_none_that_is_better, 983_040, 16, 20, start, way, end, room
        )
    one_example(test_the_room_before_a_limit_is_kept, 5000, 70_000, 5, Fraction(-1))
