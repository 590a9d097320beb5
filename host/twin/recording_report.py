"""Report on a machine that moves without a known plan: a live board, a board under test, a replay."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor
from types import MappingProxyType
from typing import Any

import numpy as np

from steptwin.emulator.bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.robots.microsteps import Microsteps
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.boards import axes_of, microsteps_of
from steptwin.host.twin.crystals import crystals_document
from steptwin.host.twin.followed_motion import FollowedMotion
from steptwin.host.twin.machine_parts import MachineParts
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class JointFigures:
    """What a joint's driver has done since power-up.

    Attributes:
        start_steps: position at power-up, in steps of the robot's file from the joint's zero.
        end_steps: position now: a whole number of steps unless the driver makes others than the file's.
        pulses: number of rising CLK edges.
        violations: number of times that a limit of the driver was broken.
    """

    start_steps: int
    end_steps: float
    pulses: int
    violations: int


def recording_report(
    parts: MachineParts,
    simulation: Simulation,
    joints: Sequence[JointFigures],
    motion: FollowedMotion,
    *,
    job: str,
    wall_s: float,
    happened: Mapping[str, Any],
    at_power_up: Mapping[str, Any] = MappingProxyType({}),
) -> dict[str, Any]:
    """Return the figures under the keys of a live board's report.json (docs/live.md).

    Args:
        parts: the machine.
        simulation: its boards and their bus.
        joints: what each joint's driver has done.
        motion: the last motion that a SYNC has started, and its plan.
        job: what the report has in place of a job's name.
        wall_s: time on the wall clock since power-up.
        happened: further entries on what has happened since power-up.
        at_power_up: further entries on how the machine was then.
    """
    robot, boards, now_s = parts.robot, simulation.boards, round(simulation.now_s, 6)
    started_counts = motion.start_counts
    return {
        "robot": robot.name,
        "job": job,
        "driver_profile": parts.driver_profile.name,
        "duration_s": now_s,
        "simulated": True,
        "passed": None,
        **at_power_up,
        "started_s": None if started_counts is None else started_counts / COUNTS_PER_SECOND,
        "no_plan": motion.plan.lacking if motion.plan else None,
        "outputs": [],
        "boards": [board.config.axis_count for board in boards],
        **crystals_document([board.config.crystal_ppm for board in boards]),
        "mismatches": [str(each) for each in mismatches(robot, simulation)],
        "axes": [
            {
                "name": name,
                "steps_start": joint.start_steps,
                "steps_end": floor(joint.end_steps),
                "pulses": joint.pulses,
                "violations": joint.violations,
            }
            for name, joint in zip(robot.joint_names, joints, strict=True)
        ],
        "joints": {
            "names": list(robot.joint_names),
            "start": robot.from_steps(np.array([joint.start_steps for joint in joints])).tolist(),
            "end": robot.from_steps(np.array([joint.end_steps for joint in joints])).tolist(),
        },
        "bus": bus_figures(simulation.bus, simulation.now_s),
        **happened,
        "simulated_s": now_s,
        "wall_s": round(wall_s, 6),
    }


def mismatches(robot: Robot, simulation: Simulation) -> list[Microsteps]:
    """Return the axes whose driver, board and robot file do not agree on the microsteps per full step."""
    return [each for each in microsteps_of(robot, axes_of(simulation.boards)) if not each.agree]


def bus_figures(bus: Bus, now_s: float) -> dict[str, Any]:
    """Return the bit rate of a bus, its number of frames and its load since power-up, `now_s` seconds ago."""
    return {
        "bitrate": bus.bitrate,
        "frames": bus.frames,
        "load_percent": round(load_percent(bus, now_s), 3),
    }


def load_percent(bus: Bus, now_s: float) -> float:
    """Return the part of the time since power-up in which a bus was busy, in percent."""
    return 100 * bus.busy_bits / (bus.bitrate * max(now_s, 1e-3))
