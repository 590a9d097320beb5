"""Turn a robot's rotors by a motion before anybody runs it: do they keep step, also if it were somewhat faster?

The emulated board runs the motion, and the edges of its own drivers turn the rotors, as `run --motors` does. So what is
promised here is what a run finds, with the drivers' currents, decay and reduced currents.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.fastest.drives import DriveAnswer, DriveTrial, PathLoad
from steptwin.host.planning.motions.sampled import Sampled
from steptwin.host.planning.planner import plan
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.machine.kernels import fastest_kernel
from steptwin.host.twin.motors.after_run import first_of, first_slip, rotors_after_run
from steptwin.host.twin.motors.driving import Driving, PayloadTimes
from steptwin.host.twin.motors.torques import torques_of_plan
from steptwin.protocol.timer import COUNTS_PER_SECOND

LOAD_MAX_DEG: Final = 85.0
"""Greatest load angle: 90 degrees is the greatest torque, beyond which a rotor that is pulled further slips."""
FASTER: Final = 0.87
"""Part of its time in which the rotors must still manage a motion."""


def rotor_trial(robot: Robot, motion: Sampled, s: FloatArray, load: PathLoad, average_s: float) -> DriveTrial:
    """Turn the rotors by a motion whose cubics begin and end at places `s`, with a load by place."""
    comparison = execute(plan(robot, motion), "", fastest_kernel()).comparison
    driving = Driving.of(robot, comparison.evidence)
    if robot.dynamics and robot.dynamics.payload_held_by:
        driving = replace(driving, payload=_payload(driving, motion, s, load))
    trace = rotors_after_run(driving)
    torques = torques_of_plan(driving, comparison, trace.supply_span_v[0])
    least, axis = np.unravel_index(int(np.argmin(torques.margins)), torques.margins.shape)
    moving = trace.counts >= driving.start_counts
    loads = np.abs(trace.load_deg[moving])
    answer = DriveAnswer(
        left_percent=100.0 * float(torques.margins[least, axis]),
        joint=robot.axis_names[int(axis)],
        at_s=float(torques.t_s[least]),
        load_deg=float(loads.max()),
        average_s=average_s,
    )
    if slip := first_of(driving, trace.first_slip_counts):
        return DriveTrial(f"{slip.joint}'s rotor slips at {slip.at_s:.3f} s", answer)
    if answer.load_deg > LOAD_MAX_DEG:
        name = robot.axis_names[int(loads.max(axis=0).argmax())]
        return DriveTrial(
            f"{name}'s rotor comes {answer.load_deg:.0f} degrees behind its field, more than {LOAD_MAX_DEG:g}", answer
        )
    if slip := first_slip(driving.stretched(FASTER)):
        return DriveTrial(f"{slip.joint}'s rotor would slip at {slip.at_s:.3f} s in {FASTER:g} of the time", answer)
    return DriveTrial("", replace(answer, slips_at=_slips_at(driving)))


_SLOWEST, _BISECTIONS = 0.5, 6
"""Least part of its time in which a motion is tried, and how often the interval up to FASTER is halved."""


def _slips_at(driving: Driving) -> float | None:
    """Return the part of its time in which a rotor begins to slip, to 0.006; None if none does in half of it."""
    slips, keeps = _SLOWEST, FASTER
    if first_slip(driving.stretched(slips)) is None:
        return None
    for _ in range(_BISECTIONS):
        middle = (slips + keeps) / 2.0
        slips, keeps = (slips, middle) if first_slip(driving.stretched(middle)) is None else (middle, keeps)
    return slips


def _payload(driving: Driving, motion: Sampled, s: FloatArray, load: PathLoad) -> PayloadTimes:
    """Return when the payload hangs, of where it does: a change counts from the place on where it may have come."""
    at = np.minimum(np.searchsorted(s, [change.from_s for change in load.changes]), len(s) - 1)
    times_s = np.asarray(motion.curve.x)[at]
    counts = driving.start_counts + np.rint(times_s * COUNTS_PER_SECOND).astype(np.int64)
    return PayloadTimes(counts, np.array([load.at_start, *(change.held for change in load.changes)]))
