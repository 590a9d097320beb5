"""A job or a file on a live board: check where it stands, stream, compare where the axes end with the plan."""

import time
from dataclasses import dataclass
from typing import Any, Final

from steptwin.host.client import Machine, Progress
from steptwin.host.client.faults import check_enabled, check_faults
from steptwin.host.common.errors import InputError
from steptwin.host.operate.moving import move_within
from steptwin.host.operate.output_commands import output_commands
from steptwin.host.operate.session import Session
from steptwin.host.planning.plan import Plan
from steptwin.protocol.objects import UNITS_PER_FULL_STEP

END_ERROR_STEPS_MAX: Final = 0.5 + 1 / 16
"""The firmware's hysteresis: how far the step counter may be from the position demanded."""


@dataclass(frozen=True, slots=True)
class AxisEnd:
    """Where one axis stands after a run, by its step counter, and where the plan ends, in wire units."""

    name: str
    planned_units: int
    end_units: int
    error_steps: float

    @property
    def passed(self) -> bool:
        """Whether it is at the step where it should be."""
        return abs(self.error_steps) <= END_ERROR_STEPS_MAX


@dataclass(frozen=True, slots=True)
class LiveOutcome:
    """What a run on a live board leaves behind; the axes as after the last repetition."""

    plan: Plan
    job: str
    repetitions: int
    axes: tuple[AxisEnd, ...]
    start: list[float]
    end: list[float]
    wall_s: float

    @property
    def passed(self) -> bool:
        """Whether every axis ended where it should, each time."""
        return all(axis.passed for axis in self.axes)

    def to_dict(self) -> dict[str, Any]:
        """As the JSON document says it."""
        names = self.plan.robot.joint_names
        return {
            "robot": self.plan.robot.name,
            "job": self.job,
            "duration_s": self.plan.trajectory.duration_s,
            "passed": self.passed,
            "repetitions": self.repetitions,
            "axes": [
                {
                    "name": axis.name,
                    "planned_units": axis.planned_units,
                    "end_units": axis.end_units,
                    "error_steps": axis.error_steps,
                }
                for axis in self.axes
            ],
            "joints": {"names": list(names), "start": self.start, "end": self.end},
            "wall_s": self.wall_s,
        }


def check_repeatable(plan: Plan, repeat: int) -> None:
    """InputError unless a plan may be run so often, one time after the other."""
    if repeat < 1:
        raise InputError(f"repeat={repeat}: is not at least 1")
    for joint, start, end in zip(plan.robot.joints, plan.points_units[0], plan.points_units[-1], strict=True):
        if repeat > 1 and start != end:
            raise InputError(
                f"repeat={repeat}: {joint.name} starts at {joint.to_position(start):.4f} {joint.unit}"
                f" and ends at {joint.to_position(end):.4f} {joint.unit}"
            )


def execute_live(
    session: Session,
    plan: Plan,
    job: str,
    *,
    repeat: int = 1,
    approach: bool = False,
    progress: Progress = lambda _: None,
) -> LiveOutcome:
    """Run a plan on a live board; repetitions end at the first that does not end where it should.

    Args:
        session: the machine.
        plan: what to do.
        job: how reports call it.
        repeat: how many times.
        approach: whether the machine moves to the start first, straight in joint space, from wherever it stands.
        progress: told which part of the stream has been sent, for each repetition anew.

    Raises:
        InputError: the machine stands elsewhere, or cannot repeat this, or somebody else moves it.
        DeviceFaultError: a drive is in fault, was stopped or does not know where it is.
        BusError: no answer.
    """
    check_repeatable(plan, repeat)
    session.require_ready("run")
    if not approach:
        plan.check_start(session.positions(session.demanded_units()))
    started_s = time.perf_counter()
    with session.in_charge("run") as machine:
        repetitions, axes = 0, tuple[AxisEnd, ...]()
        while repetitions < repeat and all(axis.passed for axis in axes):
            move_within(session, session.demanded_units(), plan.start_units)
            _stream(machine, plan, progress)
            session.link.wait(_SETTLED_S)
            check_faults(session.link, machine.axes)
            check_enabled(machine.axes)
            axes = _ends(machine, plan)
            repetitions += 1
        end = session.positions([axis.end_units for axis in axes])
    return LiveOutcome(plan, job, repetitions, axes, plan.start_joints, end, time.perf_counter() - started_s)


_SETTLED_S: Final = 0.02
"""Longer than the last step and the last status report take."""


def _stream(machine: Machine, plan: Plan, progress: Progress) -> None:
    machine.run(plan.records(), plan.start_units, progress, output_commands(plan.robot, plan.trajectory))


def _ends(machine: Machine, plan: Plan) -> tuple[AxisEnd, ...]:
    ends = []
    for joint, planned, end in zip(
        plan.robot.joints, plan.points_units[-1].tolist(), machine.positions_units(), strict=True
    ):
        error_steps = (end - planned) * joint.transmission.microsteps / UNITS_PER_FULL_STEP
        ends.append(AxisEnd(joint.name, planned, end, error_steps))
    return tuple(ends)
