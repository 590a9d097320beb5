"""Run a plan on a live board: check the start position, stream, compare the axes' end positions with the plan."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from steptwin.host.client import Machine, Progress
from steptwin.host.client.reports import check_enabled, check_faults
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.operate.inputs_outputs import plan_made, streamed_motion, waits_document, waits_made
from steptwin.host.operate.moving import move_within
from steptwin.host.operate.session import MachineCharge, Session
from steptwin.host.planning.motion import Wait
from steptwin.host.planning.plan import PLANNED_PERCENT, Plan, highest_speed
from steptwin.protocol.od import UNITS_PER_FULL_STEP

END_ERROR_STEPS_MAX: Final = 0.5 + 1 / 16
"""Largest distance between step counter and demanded position, by the firmware's hysteresis."""


@dataclass(frozen=True, slots=True)
class AxisEnd:
    """End of a run on one axis: planned end and step counter in wire units, and their difference."""

    name: str
    planned_units: int
    end_units: int
    error_steps: float

    @property
    def passed(self) -> bool:
        """True if the axis has reached the planned step."""
        return abs(self.error_steps) <= END_ERROR_STEPS_MAX


@dataclass(frozen=True, slots=True)
class LiveOutcome:
    """Result of a run on a live board; axes, plan and waits are those of the last repetition."""

    plan: Plan
    job: str
    repetitions: int
    axes: tuple[AxisEnd, ...]
    start: list[float]
    end: list[float]
    wall_s: float
    waits: tuple[Wait, ...] = ()
    """The waits for inputs; the plan is what was executed, with the standstills in it."""

    @property
    def passed(self) -> bool:
        """True if every axis has reached the planned step in every repetition."""
        return all(axis.passed for axis in self.axes)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document of the run."""
        names = self.plan.robot.joint_names
        return {
            "robot": self.plan.robot.name,
            "job": self.job,
            "duration_s": self.plan.motion.duration_s,
            "passed": self.passed,
            "repetitions": self.repetitions,
            "axes": [asdict(axis) for axis in self.axes],
            "joints": {"names": list(names), "start": self.start, "end": self.end},
            "wall_s": self.wall_s,
            **waits_document(self.waits),
        }


def check_repeatable(plan: Plan, repeat: int) -> None:
    """Raise InputError if a plan cannot be run `repeat` times, one after the other."""
    if repeat < 1:
        raise InputError(f"repeat={repeat}: is not at least 1")
    ends_units = plan.points_units[[0, -1]]
    apart = np.flatnonzero(ends_units[0] != ends_units[1])
    if repeat > 1 and apart.size:
        joint, (start, end) = plan.robot.joints[apart[0]], plan.robot.to_positions(ends_units)[:, apart[0]]
        raise InputError(
            f"repeat={repeat}: {joint.name} starts at {start:.4f} {joint.unit} and ends at {end:.4f} {joint.unit};"
            " repeat=1 passes"
        )


def execute_live(
    session: Session,
    plan: Plan,
    job: str,
    *,
    repeat: int = 1,
    approach: bool = False,
    progress: Progress = lambda _: None,
    begun: Callable[[], None] = lambda: None,
) -> LiveOutcome:
    """Run a plan `repeat` times on a live board; stop after a repetition that ends at another step than planned.

    Args:
        session: the machine.
        plan: the plan.
        job: name of the motion in reports.
        repeat: number of repetitions.
        approach: True to move to the plan's start first, straight in joint space, unless a feature blocks that move.
        progress: called with the sent fraction of the stream, in each repetition from 0 to 1.
        begun: called in each repetition when the axes have started.

    Raises:
        InputError: the machine is not at the plan's start or cannot move there, the plan cannot be repeated, or a
            program that has not claimed the machine moves it.
        DeviceFaultError: a drive is in fault or was stopped, or has no position reference.
        BusError: another program is in charge, or a node does not answer.
    """
    check_repeatable(plan, repeat)
    highest_percent = highest_speed(plan).percent  # first, because the simulation of motors takes time
    with session.charge("run") as charge:
        try:
            if approach:
                for _, check in giving("check_travel"):
                    check(plan.robot, charge.start.joints, plan.start_joints)
            else:
                plan.check_start(charge.start.joints)
        except InputError as error:
            says = f"approach=True: {error}" if approach else f"{error}; approach=True moves it there first"
            raise InputError(says).plainly(str(error) if approach else says) from error
        return run_plan(
            charge, plan, job, repeat=repeat, progress=progress, begun=begun, highest_percent=highest_percent
        )


def run_plan(
    charge: MachineCharge,
    plan: Plan,
    job: str,
    *,
    repeat: int = 1,
    progress: Progress = lambda _: None,
    begun: Callable[[], None] = lambda: None,
    highest_percent: int = PLANNED_PERCENT,
) -> LiveOutcome:
    """Run a plan with a machine in charge; arguments and errors as for `execute_live`.

    Other programs may speed the motion up, to at most `highest_percent` of the planned speed.
    """
    session = charge.session
    started_s = time.perf_counter()
    motion = streamed_motion(plan)._replace(highest_percent=highest_percent)
    machine = charge.enable()
    move_within(session, charge.start.units, plan.start_units)
    repetitions, axes = 0, tuple[AxisEnd, ...]()
    while repetitions < repeat and all(axis.passed for axis in axes):
        machine.run(motion, progress, begun)
        session.link.wait(SETTLED_S)
        check_faults(session.link, machine.axes)
        check_enabled(machine.axes)
        axes = axis_ends(machine, plan)
        repetitions += 1
    end = session.positions([axis.end_units for axis in axes])
    holds_ms, wall_s = machine.holds_ms, time.perf_counter() - started_s
    waits, made = waits_made(plan, holds_ms), plan_made(plan, holds_ms)
    return LiveOutcome(made, job, repetitions, axes, plan.start_joints, end, wall_s, waits)


SETTLED_S: Final = 0.02
"""Time after the end of a stream for the last step and the last status report."""


def axis_ends(machine: Machine, plan: Plan) -> tuple[AxisEnd, ...]:
    """Read the position of each axis after a plan; raise BusError if a node does not answer."""
    ends = zip(plan.robot.axes, plan.points_units[-1].tolist(), machine.positions_units(), strict=True)
    return tuple(
        AxisEnd(joint.name, planned, end, (end - planned) * joint.transmission.microsteps / UNITS_PER_FULL_STEP)
        for joint, planned, end in ends
    )
