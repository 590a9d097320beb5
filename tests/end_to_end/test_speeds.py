"""Jobs made slower and faster on the way, with pauses between: right by the verdict, which knows of it."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client.pausing import change_speed, pause_trajectory, resume_trajectory
from steptwin.host.operate.inputs_outputs import streamed_motion
from steptwin.host.operate.session import Session
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.planning.plan import Plan, highest_speed
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.host.verify import AS_PLANNED, Evidence, Expectation, Report, RunInfo, verify
from tests.end_to_end.marks import slow_but

ROBOT = load_robot("warehouse-scara")
Change = tuple[float, int]
"""Time of the trajectory, and the percentage from then on; 0 pauses for a second."""


def executed(kernel: Kernel, made: Plan, changes: list[Change]) -> tuple[EmbeddedBoard, float]:
    """Execute a plan; return the board, and the time that the motion took."""
    board = EmbeddedBoard(made.robot, kernel, MachineOptions(stand_at=made.start_joints))
    session = Session(board, made.robot)
    with session.charge("preset", needs=()) as charge:
        charge.enable().preset(session.units(made.start_joints))
    with session.charge("run") as charge:
        machine = charge.enable()
        run = machine.start(streamed_motion(made)._replace(highest_percent=highest_speed(made).percent))
        begun_s = board.now_s()
        for at_s, percent in changes:
            _until(lambda at_s=at_s: run.trajectory_s >= at_s, machine.wait)  # type: ignore[misc]
            if percent:
                change_speed(machine, percent)
            elif pause_trajectory(machine):
                machine.wait(1.0)
                resume_trajectory(machine)
        _until(lambda run=run: run.ended, machine.wait)  # type: ignore[misc]
        return board, board.now_s() - begun_s


def _until(come: Callable[[], bool], wait: Callable[[float], None]) -> None:
    while not come():
        wait(0.01)


def judged(board: EmbeddedBoard, made: Plan, evidence: Evidence | None = None) -> Report:
    facts = RunInfo(made.robot.name, "job", made.motion.duration_s, board.bus_report(), board.now_s(), 1.0)
    return verify(Expectation.of(made.robot, made.motion), evidence or board.evidence(), facts)


@cache
def pulled(duration_s: float) -> Plan:
    return plan(ROBOT, make_job(ROBOT, "pull-line", {"duration_s": str(duration_s), "ramp_s": str(duration_s / 5)}))


@pytest.mark.parametrize(
    ("duration_s", "changes"),
    [
        pytest.param(1.4, [(0.5, 50)], id="a short one"),
        pytest.param(10.0, [(2.0, 50)], id="slower", marks=pytest.mark.slow),
        pytest.param(10.0, [(2.0, 150)], id="faster", marks=pytest.mark.slow),
        pytest.param(
            10.0,
            [(0.0, 10), (0.4, 150), (4.0, 40), (5.0, 0), (5.5, 120), (8.0, 0), (9.0, 10), (9.3, 100)],
            id="with pauses",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            10.0,
            [(3.0, 20), (3.0, 150), (3.01, 0), (3.02, 90)],
            id="at once one after the other",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_verdict_is_by_the_motions_own_time(fast_kernel: Kernel, duration_s: float, changes: list[Change]) -> None:
    pull = pulled(duration_s)
    board, took_s = executed(fast_kernel, pull, changes)
    report = judged(board, pull)
    assert report.passed, report.reasons
    assert all(axis.position_error_steps_max <= 0.57 for axis in report.axes)
    percents = [part for _, percent in changes for part in ([percent] if percent else [0, None])]
    shown = [speed.percent for speed in report.speeds]
    assert [each for each, wanted in zip(shown, percents, strict=False) if wanted is not None] == [
        pytest.approx(each, abs=0.01) for each in percents if each is not None
    ]
    assert report.to_dict()["speeds"][0].keys() == {"percent", "after_s", "at_s", "ramp_s"}
    blind = board.evidence()
    blind = replace(blind, axes=tuple(replace(axis, rates=AS_PLANNED) for axis in blind.axes))
    assert not judged(board, pull, blind).passed, "by the clock it is another motion"
    if len(changes) == 1:
        rest_s = pull.motion.duration_s - changes[0][0]
        assert took_s == pytest.approx(changes[0][0] + rest_s * 100 / changes[0][1], abs=0.5)


@pytest.mark.slow
def test_a_speed_that_is_not_the_recorded_one_fails(fast_kernel: Kernel) -> None:
    """One percent off is seen: the verdict takes the record's word for the rates, not for the positions."""
    pull = pulled(2.0)
    board, _ = executed(fast_kernel, pull, [(0.8, 50)])
    evidence = board.evidence()
    axes = tuple(
        replace(
            axis, rates=replace(axis.rates, to_q16=np.where(axis.rates.to_q16 == 32_768, 33_100, axis.rates.to_q16))
        )
        for axis in evidence.axes
    )
    assert not judged(board, pull, replace(evidence, axes=axes)).passed


@pytest.mark.slow
def test_outputs_go_by_the_trajectory_at_any_speed(fast_kernel: Kernel) -> None:
    """The pauses of `store` for the magnet and the lock last 0.3 s of the motion's own time."""
    made = plan(ROBOT, make_job(ROBOT, "store", {"pull_s": "2"}), 40)
    board, _ = executed(fast_kernel, made, [(0.5, 40), (1.3, 111), (8.5, 10), (9.0, 111), (13.0, 0), (13.2, 60)])
    report = judged(board, made)
    assert report.passed, report.reasons
    assert [round(output.from_s, 3) for output in report.outputs] == [1.238, 8.589, 10.889, 13.189]
    for output in report.outputs:
        assert output.changed_s is not None
        assert 0 <= output.changed_s - output.from_s < 0.06


@pytest.mark.slow
def test_without_a_change_nothing_is_said(fast_kernel: Kernel) -> None:
    pull = pulled(2.0)
    board, _ = executed(fast_kernel, pull, [])
    report = judged(board, pull)
    assert report.passed
    assert (report.speeds, "speeds" in report.to_dict()) == ((), False)


@pytest.mark.slow
@pytest.mark.parametrize("percent", slow_but([150], [101, 110, 123, 137, 150]))
def test_at_the_highest_speed_the_driver_is_at_its_limit_and_not_beyond(fast_kernel: Kernel, percent: int) -> None:
    """Motors that could do anything: the driver's step rate alone limits a lift that leaves so many percent to it.

    The board takes every record at the speed that the host states, the verdict passes, and no two pulses are nearer
    than the limit allows, but for the count to which each is rounded and the chord in which a tick makes them.
    """
    joints = tuple(
        replace(joint, speed_max=1e6, acceleration_max=200_000 / joint.transmission.steps_per_unit)
        for joint in ROBOT.joints
    )
    robot = replace(ROBOT, joints=joints)
    sz, limit_hz = 1, robot.board.driver_rate_max_hz
    way = 40_000 / robot.joints[sz].transmission.steps_per_unit
    goal = (*robot.home[:sz], robot.home[sz] + way, *robot.home[sz + 1 :])
    made = plan(robot, joint_move(robot.joint_names, robot.home, goal, _law(40_000, limit_hz * 100 / percent)))
    assert highest_speed(made).percent in (percent - 1, percent)
    board, _ = executed(fast_kernel, made, [(0.2, highest_speed(made).percent)])
    report = judged(board, made)
    assert report.passed, report.reasons
    fastest_s = np.diff(board.evidence().axes[sz].clk_rise_counts).min() / 72e6
    assert 0.97 / limit_hz < fastest_s
    assert fastest_s < 1.03 / limit_hz


def _law(steps: float, rate_hz: float) -> Trapezoid:
    """Return a trapezoid with ramps of 0.5 s that makes its steps at this rate, to the millisecond above."""
    return Trapezoid(1.0, np.ceil(1000 * (steps / rate_hz + 0.5)) / 1000, 0.5)
