"""Report on a machine that moves without a known plan: a live board, a board under test, a replay.

The folder is the one that a live board leaves (docs/run-folder.md): the plan is that of the records which the axes have
received, and there is no verdict. It has a waveform besides.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.simulation import Simulation
from steptwin.host.faults.target import axes_of, counted_steps
from steptwin.host.record.bus_log import log_line
from steptwin.host.record.folder import (
    AxisTotals,
    Header,
    Mark,
    Piece,
    PlanRows,
    Recording,
    keep_recording,
    prepare_folder,
)
from steptwin.host.record.waveforms import Format, whole_record, wires, write_waveform
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.live.live_plan import FollowedMotion, LivePlan
from steptwin.host.twin.live.operation_log import OperationLog
from steptwin.host.twin.machine.boards import crystals_document, microsteps_of
from steptwin.host.twin.machine.evidence import axes_evidence
from steptwin.host.twin.machine.machine_parts import MachineParts
from steptwin.host.twin.machine.shelf import shelf_evidence
from steptwin.host.verify import Evidence, shelf_document
from steptwin.host.verify.switching import output_changes
from steptwin.protocol.frame import Frame
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
        motion: the motions that SYNCs have started, and their plans.
        job: what the report has in place of a job's name.
        wall_s: time on the wall clock since power-up.
        happened: further entries on what has happened since power-up.
        at_power_up: further entries on how the machine was then.
    """
    robot, boards, now_s = parts.robot, simulation.boards, round(simulation.now_s, 6)
    shown = motion.recorded(ended=True)
    return {
        "robot": robot.name,
        "job": job,
        "driver_profile": parts.driver_profile.name,
        "duration_s": now_s,
        "simulated": True,
        "passed": None,
        **at_power_up,
        "started_s": None if shown.start_counts is None else shown.start_counts / COUNTS_PER_SECOND,
        "next_motion_s": shown.next_counts / COUNTS_PER_SECOND if shown.next_counts else None,
        "no_plan": shown.no_plan,
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
    """Return the part of the time since power-up when a bus was busy, in percent."""
    return 100 * bus.busy_bits / (bus.bitrate * max(now_s, 1e-3))


class UnplannedRun:
    """Follows a simulated machine from now on; may be saved at any time, and again later."""

    def __init__(self, parts: MachineParts, simulation: Simulation, operations: OperationLog, job: str) -> None:
        """Follow a machine whose bus keeps its frames.

        Args:
            parts: the machine.
            simulation: its boards and their bus.
            operations: what is done to the machine.
            job: what the report has in place of a job's name.
        """
        self._parts = parts
        self._robot = parts.robot
        self._simulation = simulation
        self._axes = axes_of(simulation.boards)
        self._start_steps = parts.start_steps
        self._job = job
        self._began_s = time.perf_counter()
        self._plan = LivePlan(self._robot, self._axes, self._start_steps)
        self._motion = FollowedMotion(self._axes, self._plan)
        self._rows: list[PlanRows] = []
        """Rows of the plan up to the last time that it was saved."""
        self._operations = operations
        simulation.bus.also_log(self._motion.frame)

    @property
    def bus_log(self) -> list[tuple[int, Frame]]:
        """Every frame with the instant, in counts, when it became valid."""
        bus = self._simulation.bus
        return list(zip(bus.log_counts, bus.log_frames, strict=True))

    def evidence(self) -> Evidence:
        """Return every edge at the drivers; t = 0 is the start of the last motion by a SYNC, else power-up."""
        self._motion.follow(self._simulation.now_counts)
        axes = axes_evidence(self._robot, self._start_steps, self._axes)
        outputs = output_changes(self._robot, axes)
        watch = self._simulation.shelf_watch
        if watch is None:
            return Evidence(self._motion.start_counts or 0, axes, outputs)
        watch.look_now(self._simulation.now_counts)
        return Evidence(self._motion.start_counts or 0, axes, outputs, shelf_evidence(watch.shelf, self._parts.stock))

    def save(self, folder: Path | str) -> None:
        """Write the folder; another run's files are replaced, those of a live board's recording are not.

        Raises:
            InputError: the folder holds the recording of a live board, cannot be made, or is not writable.
            RecordingError, OSError: a file cannot be written.
        """
        keep_recording(folder)
        path = prepare_folder(folder)
        evidence = self.evidence()
        shown = self._motion.recorded(ended=True)
        self._rows = [
            rows for rows in [*self._rows, *self._plan.take()] if rows.number in (shown.plan_number, self._plan.number)
        ]
        document = self._report(evidence)
        recording = Recording(path, self._header(evidence), self._robot.toml)
        recording.append(self._all(evidence))
        recording.finish(document)
        if recording.failure:
            raise recording.failure
        record = whole_record(evidence)
        if record.from_counts < record.to_counts:
            write_waveform(path / Format.VCD.file_name, wires(evidence), record, Format.VCD, self._robot.name)

    def _header(self, evidence: Evidence) -> Header:
        axes = tuple(
            AxisTotals(axis.name, axis.start_steps, axis.active_edge, axis.violations.limits) for axis in evidence.axes
        )
        return Header(self._robot.name, self._parts.driver_profile.name, self._simulation.bus.bitrate, axes)

    def _all(self, evidence: Evidence) -> Piece:
        lines = [log_line(counts, frame) for counts, frame in self.bus_log]
        shown = self._motion.recorded(ended=True)
        mark = Mark(
            until_counts=self._simulation.now_counts,
            start_counts=shown.start_counts or 0,
            no_plan=shown.no_plan,
            next_counts=shown.next_counts,
        )
        return Piece(evidence.axes, lines, self._rows, mark, shown.plan_number)

    def _report(self, evidence: Evidence) -> dict[str, Any]:
        """Return the figures under the keys of a live board's report.json (docs/live.md)."""
        ends = counted_steps(self._robot, self._start_steps, self._axes)
        shelf = {} if evidence.shelf is None else {"shelf": shelf_document(evidence.shelf, 0)}
        return recording_report(
            self._parts,
            self._simulation,
            [
                JointFigures(axis.start_steps, end, int(axis.clk_rise_counts.size), int(axis.violations.counts.size))
                for axis, end in zip(evidence.axes, ends, strict=True)
            ],
            self._motion,
            job=self._job,
            wall_s=time.perf_counter() - self._began_s,
            at_power_up={"commissioned": self._parts.commissioned},
            happened={"operations": self._operations.requests(), **shelf},
        )
