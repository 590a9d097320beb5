"""What the motors of a run have done: the pose really reached, torques, heat and supply, each against its meaning."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.features.motors.turning import MotorRun
from steptwin.features.motors.turning.after_run import first_slip, rotors_after_run
from steptwin.features.motors.turning.driving import PayloadTimes
from steptwin.features.motors.turning.torques import needs_of_plan, torques_of_plan
from steptwin.features.motors.turning.verdict import MARGIN_MIN, MotorVerdict, ToolPaths, ToolReached, motor_verdict
from steptwin.host.verify import Comparison
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND


def reached(ran: MotorRun, comparison: Comparison, off_deg: float) -> ToolReached:
    """Return how far the tool is off if the shoulder's rotor were off by an angle of the joint, all the time."""
    counts = ran.trace.counts
    t_s = (counts - ran.driving.start_counts) / COUNTS_PER_SECOND
    steps = np.column_stack([axis.around(t_s)[1] for axis in comparison.counted])
    positions = comparison.expected.joints(steps)
    positions[:, 0] += off_deg
    return ToolReached.of(ToolPaths.of(ran.driving, comparison, replace(ran.trace, positions=positions)))


def test_a_shoulder_that_is_off_takes_the_tool_along_a_chord(ran: MotorRun, comparison: Comparison) -> None:
    """Stretched, 195 mm from the shoulder's axis: 2 r sin(angle / 2)."""
    found = reached(ran, comparison, -1.5)
    chord_mm = 2.0 * 195.0 * np.sin(np.deg2rad(0.75))
    assert (found.position_mm_max, found.position_mm_end) == pytest.approx((chord_mm, chord_mm))
    assert (found.attitude_deg_max, found.attitude_deg_end) == pytest.approx((1.5, -1.5))
    nothing = reached(ran, comparison, 0.0)
    assert (nothing.position_mm_max, nothing.attitude_deg_end) == pytest.approx((0.0, 0.0))


def test_the_tool_lags_as_far_as_the_rotors_do(ran: MotorRun) -> None:
    """The load angle of one motor is 7.2 degrees at its shaft for a whole electrical turn."""
    tool, ratio = ran.verdict.tool, ran.driving.robot.joints[0].transmission.ratio
    assert ratio is not None
    by_joint_deg = np.abs(ran.trace.load_deg).max(axis=0) / 360.0 * 7.2
    assert 0.3 * by_joint_deg[0] / ratio < tool.attitude_deg_max < 2.0 * by_joint_deg.sum()
    assert tool.position_mm_end < tool.position_mm_max


def test_a_verdict_warns_below_the_margin_and_fails_with_a_slip(ran: MotorRun, comparison: Comparison) -> None:
    """At the lowest current that has 30 % left there is no warning, just below it there is one; a slip is a reason."""

    def verdict(current_a: float) -> MotorVerdict:
        driving = ran.driving.at_current(current_a)
        torques = torques_of_plan(driving, comparison)
        return motor_verdict(driving, comparison, torques, ran.trace, ran.verdict.tool)

    least = min(joint.margin for joint in ran.verdict.joints)
    # At low speed the torque there is grows in proportion to the current.
    border_a = ran.driving.phase_current_a * (1.0 - least) / (1.0 - MARGIN_MIN)
    enough, short = verdict(1.1 * border_a), verdict(0.9 * border_a)
    assert enough.kept_step
    assert enough.warnings == ()
    assert short.kept_step
    assert any("less than 30 %" in line for line in short.warnings)
    slipped = replace(ran.trace, first_slip_counts=(ran.driving.start_counts + COUNTS_PER_SECOND, None, None, None))
    lost = motor_verdict(ran.driving, comparison, ran.torques, slipped, ran.verdict.tool)
    assert not lost.kept_step
    assert lost.reasons == ("th1: its rotor slips at 1.000 s and ends 0 full steps away",)


def test_the_answer_says_where_and_why_the_first_rotor_slips(ran: MotorRun, comparison: Comparison) -> None:
    """Of two slips the earlier one: short of torque, or with enough of it, or before the motion."""

    def answer(needed_nm: float, *slips_s: float | None) -> str:
        counts = tuple(
            None if at_s is None else ran.driving.start_counts + round(at_s * COUNTS_PER_SECOND) for at_s in slips_s
        )
        needed = np.full_like(ran.torques.needed_nm, needed_nm)
        given = replace(
            ran.torques, needed_nm=needed, available_nm=np.full_like(needed, 0.3), rpm=np.full_like(needed, -120.0)
        )
        lost = np.tile([8.0, 0.0, -4.0, 0.0], (len(ran.trace.counts), 1))
        slipped = replace(ran.trace, first_slip_counts=counts, lost_full_steps=lost)
        return motor_verdict(ran.driving, comparison, given, slipped, ran.verdict.tool).answer

    motion = comparison.expected.motion
    at_rest = zip(motion.joint_names, motion.positions(np.array([0.25]))[0], strict=True)
    place = ", ".join(f"{name} {position:.3f}" for name, position in at_rest)
    first = f"LOSES STEPS, in the end 8 full steps of th1, 4 full steps of d3: d3 slips first, at 0.250 s and {place}, "
    assert answer(-0.45, 0.5, None, 0.25, None) == (
        f"{first}because the motion needs 0.450 Nm at 120 turns a minute, and the motor has 0.300 Nm"
    )
    assert answer(0.1, 0.5, None, 0.25, None) == (
        f"{first}because its rotor swings: the motion alone needs only 0.100 Nm of 0.300 Nm"
    )
    assert answer(0.1, -0.04, None, None, None) == (
        "LOSES STEPS, in the end 8 full steps of th1: th1 slips first, 0.040 s before the motion, while the drivers"
        " switch on, against a load of 0.100 Nm"
    )
    nowhere = 4 * [None]
    assert answer(-0.03, *nowhere) == "keeps step, with 90 % of th1's torque left at 0.000 s and 120 turns a minute"
    assert answer(0.45, *nowhere) == (
        "keeps step: th1 needs 150 % of its torque at 0.000 s and 120 turns a minute, but not for long"
    )


def test_the_payload_hangs_only_while_it_is_held(ran: MotorRun, comparison: Comparison) -> None:
    """Left before the motion it costs nothing; taken amid it, the torques change there."""
    heavy = ran.driving.with_payload(2.0)
    empty = ran.driving.with_payload(0.0)
    amid = heavy.start_counts + 200 * COUNTS_PER_MS
    taken = replace(heavy, payload=PayloadTimes(np.array([amid]), np.array([False, True])))
    always, never, later = (needs_of_plan(each, comparison).torque_nm for each in (heavy, empty, taken))
    np.testing.assert_array_equal(later[:200], never[:200])
    np.testing.assert_array_equal(later[200:], always[200:])
    assert np.abs(always - never).max() > 1e-3
    traces = [rotors_after_run(each).load_deg for each in (heavy, empty, taken)]
    at = int(amid // COUNTS_PER_MS) - 1
    np.testing.assert_array_equal(traces[2][:at], traces[1][:at])
    assert np.abs(traces[2][at:] - traces[1][at:]).max() > 0.5


def test_the_supply_sags_in_a_run_and_the_windings_warm(ran: MotorRun) -> None:
    """Four motors draw some ten watts of 24 V through 0.1 ohm."""
    verdict = ran.verdict
    assert 23.5 < verdict.supply_v_min < 24.0 - 0.02
    assert verdict.supply_v_max >= 24.0
    stiff = replace(
        ran.driving, robot=replace(ran.driving.robot, dynamics=replace(ran.driving.dynamics, supply_ohm=0.0))
    )
    assert rotors_after_run(stiff).supply_span_v == (24.0, 24.0)
    for joint in verdict.joints:
        assert 25.0 < joint.winding_celsius < joint.winding_celsius_steady < 100.0


def test_a_trial_ends_with_the_first_slip(ran: MotorRun) -> None:
    weak = ran.driving.at_current(0.05 * ran.driving.phase_current_a)
    told: list[float] = []
    slip = first_slip(weak, told.append)
    assert slip is not None
    assert 1.0 not in told
    whole = rotors_after_run(weak)
    firsts = [counts for counts in whole.first_slip_counts if counts is not None]
    assert slip.at_s == pytest.approx((min(firsts) - weak.start_counts) / COUNTS_PER_SECOND, abs=1e-9)
