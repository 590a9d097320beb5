"""Compare the oracle with crossings computed by hand, with closed forms, and with a loop over very small time steps."""

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.motion import Motion
from steptwin.host.verify import oracle
from steptwin.host.verify.oracle import IdealSteps, ideal_steps
from tests.host.verify.motions import Scalar, line, motion, sines, still, trapezoid
from tests.work import counting, function_calls

H = 9 / 16


def steps_of(joint: tuple[Scalar, Scalar], start: int, duration_s: float = 1.0, spu: float = 1.0) -> IdealSteps:
    """Return the ideal steps of one joint alone."""
    return ideal_steps(motion(duration_s, joint), np.array([spu]), (start,))[0]


@pytest.mark.parametrize(("start", "counter"), [(0.0, 0), (10.3, 10), (10.5, 11), (-7.25, -7), (1e6 + 0.125, 10**6)])
@pytest.mark.parametrize("rate_hz", [1.0, 99.5, -312.5, 14_000.0])
def test_constant_speed_steps_at_evenly_spaced_times(start: float, counter: int, rate_hz: float) -> None:
    steps = steps_of(line(start, rate_hz), counter)
    sign = np.sign(rate_hz)
    ahead = sign * (start - counter)
    expected_s = (np.arange(20_000) + H - ahead) / abs(rate_hz)
    expected_s = expected_s[expected_s <= 1.0]
    np.testing.assert_allclose(steps.time_s, expected_s, rtol=0.0, atol=1e-10)
    assert (steps.signs == sign).all()
    np.testing.assert_allclose(steps.speeds_hz, abs(rate_hz))
    assert steps.end_steps == counter + sign * len(expected_s)


def test_a_sine_steps_at_the_arcsines_and_back_an_eighth_of_a_step_lower() -> None:
    amplitude, omega = 5.3, 2.0 * np.pi
    steps = steps_of(sines([(amplitude, omega, 0.0)]), 0, 1.0)
    rising = np.arcsin((np.arange(5) + H) / amplitude) / omega  # 0 to 5 in the first quarter
    falling = 0.5 - np.arcsin((np.arange(5, -5, -1) - H) / amplitude) / omega  # 5 to -5 in the middle half
    returning = 1.0 + np.arcsin((np.arange(-5, 0) + H) / amplitude) / omega  # -5 to 0 at the end
    expected_s = np.concatenate([rising, falling, returning])
    np.testing.assert_allclose(steps.time_s, expected_s, rtol=0.0, atol=1e-10)
    assert steps.signs.tolist() == [1] * 5 + [-1] * 10 + [1] * 5
    np.testing.assert_allclose(steps.speeds_hz, np.abs(amplitude * omega * np.cos(omega * expected_s)), rtol=1e-8)


@pytest.mark.parametrize(("dip", "signs"), [(0.45, [1]), (0.4376, [1]), (0.4374, [1, -1, 1]), (0.3, [1, -1, 1])])
def test_a_reversal_must_leave_the_hysteresis_to_step_back(dip: float, signs: list[int]) -> None:
    """The motion goes from 0 over a peak of 0.6 to a dip and to the same peak again, with cosines between."""
    knots = np.array([0.0, 0.6, dip, 0.6])

    def position(t: FloatArray) -> FloatArray:
        k = np.minimum(t.astype(int), 2)
        return np.asarray(knots[k] + (knots[k + 1] - knots[k]) * (1.0 - np.cos(np.pi * (t - k))) / 2.0)

    def velocity(t: FloatArray) -> FloatArray:
        k = np.minimum(t.astype(int), 2)
        return np.asarray((knots[k + 1] - knots[k]) * np.pi * np.sin(np.pi * (t - k)) / 2.0)

    assert steps_of((position, velocity), 0, 3.0).signs.tolist() == signs


def test_a_joint_that_does_not_move_makes_no_steps() -> None:
    steps = steps_of(still(12.34), 12)
    assert len(steps.time_s) == len(steps.signs) == len(steps.speeds_hz) == 0
    assert steps.end_steps == 12


def test_rounding_noise_at_rest_makes_no_steps_and_solves_nothing() -> None:
    """Ten seconds have 10 001 samples, each of a position and a velocity; a solved turning point would need more."""
    noise = np.random.default_rng(5).normal(scale=1e-13, size=(2, 10_001))

    def row(n: int) -> Scalar:
        return lambda t: 1.0 + noise[n][np.rint(t * 1000.0).astype(int)]

    noisy, law = counting(motion(10.0, (row(0), lambda t: row(1)(t) - 1.0)))
    (steps,) = ideal_steps(noisy, np.array([80.0]), (80,))
    assert len(steps.time_s) == 0
    assert law.instants <= 2 * 10_001 + 2


@pytest.mark.parametrize("turn_s", [0.5, 0.50037, 1.0 / 3.0])
def test_a_motion_that_touches_a_threshold_steps_up_and_back_or_not_at_all(turn_s: float) -> None:
    """The top of a parabola lies on the threshold except for rounding."""
    steps = steps_of((lambda t: H - (t - turn_s) ** 2, lambda t: -2.0 * (t - turn_s)), 0)
    assert steps.signs.tolist() in ([], [1, -1])
    assert np.abs(steps.time_s[:1] - turn_s).max(initial=0.0) < 1e-5


@pytest.mark.parametrize(("margin", "signs"), [(1e-6, [1, -1]), (-1e-6, [])])
def test_a_peak_between_samples_is_found(margin: float, signs: list[int]) -> None:
    """The nearest sample lies 2.5e-4 steps below the peak, far more than the margin."""
    omega = 2.0 * np.pi * 5.0
    phase = np.pi / 2.0 - omega * 0.2505
    steps = steps_of(sines([(H + margin, omega, phase)]), 0, 0.3)
    assert [s for s, t in zip(steps.signs.tolist(), steps.time_s, strict=True) if t > 0.2][: len(signs)] == signs
    assert any(abs(t - 0.2505) < 1e-9 for t in steps.turning_s)


def test_a_start_beyond_a_threshold_steps_at_once() -> None:
    steps = steps_of(line(3.0, 1.0), 0)
    assert steps.time_s[:3].tolist() == [0.0, 0.0, 0.0]
    assert steps.time_s[3] == pytest.approx(H, abs=1e-10)
    assert steps_of(line(3.0, -1.0), 0).signs.tolist() == [1, 1, 1, -1]


def test_a_negative_conversion_reverses_the_count() -> None:
    joint = sines([(7.7, 4.0, 0.3)])
    up, down = steps_of(joint, 23, spu=10.0), steps_of(joint, -23, spu=-10.0)
    np.testing.assert_array_equal(up.signs, -down.signs)
    np.testing.assert_allclose(up.time_s, down.time_s, rtol=0.0, atol=1e-10)


def test_axes_do_not_influence_each_other() -> None:
    joints = [sines([(30.0, 3.0, 0.0)]), still(4.2), trapezoid(5.0, -80.0, 2.0, 0.5)]
    spu = np.array([44.4, 80.0, 26.7])
    starts = tuple(round(s) for s in motion(2.0, *joints).positions(np.zeros(1))[0] * spu)
    together = ideal_steps(motion(2.0, *joints), spu, starts)
    for joint, axis, start, one in zip(joints, together, starts, spu, strict=True):
        alone = steps_of(joint, start, 2.0, one)
        np.testing.assert_array_equal(axis.signs, alone.signs)
        np.testing.assert_allclose(axis.time_s, alone.time_s, rtol=0.0, atol=1e-10)


def test_small_chunks_give_the_same_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    joint = random_joint(3)
    whole = steps_of(joint, start_of(joint))
    monkeypatch.setattr(oracle, "SAMPLES_PER_CHUNK", 7)
    monkeypatch.setattr(oracle, "CROSSINGS_PER_CHUNK", 5)
    parts = steps_of(joint, start_of(joint))
    np.testing.assert_array_equal(parts.signs, whole.signs)
    np.testing.assert_allclose(parts.time_s, whole.time_s, rtol=0.0, atol=1e-10)


def random_joint(seed: int) -> tuple[Scalar, Scalar]:
    """Return a sum of five sines: up to some hundred steps per second, with many reversals of all sizes."""
    rng = np.random.default_rng(seed)
    terms = [(rng.uniform(0.2, 12.0) / omega, omega, rng.uniform(0.0, 6.3)) for omega in rng.uniform(2.0, 60.0, 5)]
    return sines(terms, offset=rng.uniform(-100.0, 100.0))


def start_of(joint: tuple[Scalar, Scalar], spu: float = 1.0) -> int:
    return int(np.floor(joint[0](np.zeros(1))[0] * spu + 0.5))


def steps_by_loop(position_steps: FloatArray, counter: int) -> list[tuple[int, int]]:
    """Return sample index and sign of every step by the step rule, one sample after the other."""
    steps = []
    for i, p in enumerate(position_steps.tolist()):
        while abs(p - counter) >= H:
            sign = 1 if p > counter else -1
            counter += sign
            steps.append((i, sign))
    return steps


@pytest.mark.parametrize("seed", range(25))
def test_random_motions_against_a_loop_in_very_small_steps(seed: int) -> None:
    spu, dt_s = 10.0 ** (seed % 3), 1e-5
    joint = random_joint(seed)
    fine_s = np.arange(0.0, 1.0 + dt_s / 2.0, dt_s)
    expected = steps_by_loop(joint[0](fine_s) * spu, start_of(joint, spu))
    steps = steps_of(joint, start_of(joint, spu), spu=spu)
    assert len(expected) > 3
    assert steps.signs.tolist() == [sign for _, sign in expected]
    late_s = np.array([fine_s[i] for i, _ in expected]) - steps.time_s
    assert late_s.min() > -1e-9
    assert late_s.max() < dt_s + 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_every_crossing_lies_on_its_threshold(seed: int) -> None:
    joint = random_joint(seed)
    steps = steps_of(joint, start_of(joint, 300.0), spu=300.0)
    before = steps.start_steps + np.cumsum(steps.signs, dtype=np.int64) - steps.signs
    beyond = steps.signs * (joint[0](steps.time_s) * 300.0 - before) - H
    assert len(beyond) > 100
    assert np.abs(beyond / steps.speeds_hz).max() < 1e-10
    assert (np.diff(steps.time_s) > 0.0).all()


def six_axes(duration_s: float) -> Motion:
    """Return a motion as large as a drawer pull: three axes move, three stand still."""
    return motion(
        duration_s,
        trapezoid(0.0, -42.0, duration_s, 2.0),
        sines([(20.0, 0.16, 0.0)], 60.0),
        trapezoid(30.0, 27.0, duration_s, 2.0),
        still(500.0),
        still(300.0),
        still(100.0),
    )


def test_a_drawer_pull_takes_little_work() -> None:
    """Two evaluations for each of 10 001 samples, four at most for each step, and no loop over samples or steps."""
    (pull, law), spu = counting(six_axes(10.0)), np.array([44.4, 44.4, 26.7, 40.0, 160.0, 320.0])
    starts = (0, 2664, 801, 20_000, 48_000, 32_000)
    steps = sum(len(axis.time_s) for axis in ideal_steps(pull, spu, starts))
    assert steps > 3000
    assert law.instants <= 2 * 10_001 + 4 * steps
    assert function_calls(lambda: ideal_steps(pull, spu, starts)) < steps


def test_a_hundred_thousand_steps_are_counted() -> None:
    steps = steps_of(trapezoid(0.0, 1000.0, 20.0, 1.0), 0, 20.0, spu=100.0)
    assert steps.end_steps == len(steps.time_s) == 100_000
