"""Report on a machine without a known plan: a live board, a board under test, a replay.

The folder is that of a live board (docs/run-folder.md): its plan consists of the received records, and it has no
verdict. It also has a waveform.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor
from pathlib import Path
from typing import Any

import numpy as np

from steptwin.emulator.bus.can_bus import Bus
from steptwin.host.common.whole_file import files_together
from steptwin.host.record.bus_log import log_line
from steptwin.host.record.folder import (
    REPORT,
    AxisTotals,
    Header,
    Mark,
    Piece,
    PlanRows,
    Recording,
    keep_recording,
    older_files,
    prepare_folder,
    stop_document,
)
from steptwin.host.record.waveforms import Format, whole_record, wires, write_waveform
from steptwin.host.twin.live.live_plan import FollowedMotion, LivePlan, RecordedMotion
from steptwin.host.twin.machine.boards import crystals_document
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine
from steptwin.host.twin.machine.evidence import axes_evidence
from steptwin.host.verify import Evidence, speeds_document
from steptwin.host.verify.figures import judged_document
from steptwin.host.verify.switching import output_edges
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class JointFigures:
    """Figures of a joint's driver since power-up.

    Attributes:
        start_steps: position at power-up, in steps of the robot's file from the joint's zero.
        end_steps: present position; a whole number of steps if the driver makes those of the file.
        pulses: number of rising CLK edges.
        violations: number of violations of the driver's limits.
    """

    start_steps: int
    end_steps: float
    pulses: int
    violations: int


def recording_report(
    machine: EmulatedMachine,
    joints: Sequence[JointFigures],
    shown: RecordedMotion,
    *,
    job: str,
    wall_s: float,
    happened: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the figures under the keys of a live board's report.json (docs/live.md).

    Args:
        machine: the machine.
        joints: figures of each joint's driver.
        shown: motion of the recording.
        job: name in the report in place of a job's.
        wall_s: time on the wall clock since power-up.
        happened: further entries about events since power-up.
    """
    robot, boards, now_s = machine.robot, machine.simulation.boards, round(machine.simulation.now_s, 6)
    return {
        "robot": robot.name,
        "job": job,
        "driver_profile": machine.parts.driver_profile.name,
        "duration_s": now_s,
        "simulated": True,
        "passed": None,
        "commissioned": machine.parts.commissioned,
        "started_s": None if shown.start_counts is None else shown.start_counts / COUNTS_PER_SECOND,
        "next_motion_s": shown.next_counts / COUNTS_PER_SECOND if shown.next_counts else None,
        "no_plan": shown.no_plan,
        "stopped": stop_document(shown.stop),
        "outputs": [],
        "boards": [board.config.axis_count for board in boards],
        **crystals_document([board.config.crystal_ppm for board in boards]),
        "mismatches": [str(each) for each in machine.mismatches()],
        "axes": [
            {
                "name": name,
                "steps_start": joint.start_steps,
                "steps_end": floor(joint.end_steps),
                "pulses": joint.pulses,
                "violations": joint.violations,
            }
            for name, joint in zip(robot.axis_names, joints, strict=True)
        ],
        "joints": {
            "names": list(robot.joint_names),
            "start": robot.from_steps(np.array([joint.start_steps for joint in joints])).tolist(),
            "end": robot.from_steps(np.array([joint.end_steps for joint in joints])).tolist(),
        },
        "bus": bus_figures(machine.bus, machine.simulation.now_s),
        **happened,
        "simulated_s": now_s,
        "wall_s": round(wall_s, 6),
    }


def bus_figures(bus: Bus, now_s: float) -> dict[str, Any]:
    """Return the bit rate of a bus, its number of frames and its load since power-up, `now_s` seconds ago."""
    return {
        "bitrate": bus.bitrate,
        "frames": bus.frames,
        "load_percent": round(load_percent(bus, now_s), 3),
    }


def load_percent(bus: Bus, now_s: float) -> float:
    """Return the load of a bus since power-up, in percent."""
    return 100 * bus.busy_bits / (bus.bitrate * max(now_s, 1e-3))


class UnplannedRun:
    """Follows an emulated machine from now on; may be saved at any time, repeatedly."""

    def __init__(self, machine: EmulatedMachine, job: str) -> None:
        """Follow a machine with a bus that keeps its frames; reports have `job` as the name of the job."""
        self._machine = machine
        self._job = job
        self._began_s = time.perf_counter()
        self._plan = LivePlan(machine)
        self._motion = FollowedMotion(machine, self._plan)
        self._rows: list[PlanRows] = []
        """Rows of the plan that have been saved."""
        machine.bus.listen(self._motion.frame)

    def evidence(self) -> Evidence:
        """Return every edge at the drivers; t = 0 is the start of the last motion by a SYNC, else power-up."""
        machine = self._machine
        self._motion.follow(machine.simulation.now_counts)
        axes = axes_evidence(machine)
        outputs = output_edges(machine.robot, axes)
        return Evidence(self._motion.start_counts or 0, axes, outputs, machine.features_evidence())

    def save(self, folder: Path | str) -> None:
        """Write the folder; another run's files are replaced, those of a live board's recording are not.

        Raises:
            InputError: the folder has the recording of a live board, cannot be created, or is not writable.
            OSError: a file cannot be written.
        """
        keep_recording(folder)
        path, robot = prepare_folder(folder), self._machine.robot
        evidence = self.evidence()
        shown = self._motion.recorded(ended=True)
        self._rows = [
            rows for rows in [*self._rows, *self._plan.take()] if rows.number in (shown.plan_number, self._plan.number)
        ]
        with files_together(path, REPORT, older_files()) as new:
            recording = Recording(new, self._header(evidence), robot.toml)
            recording.append(self._all(evidence, shown))
            recording.finish(self._report(evidence, shown))
            if recording.failure:
                raise recording.failure.__cause__ or recording.failure
            record = whole_record(evidence)
            if record.from_counts < record.to_counts:
                write_waveform(new / Format.VCD.file_name, wires(evidence), record, Format.VCD, robot.name)

    def _header(self, evidence: Evidence) -> Header:
        machine = self._machine
        axes = tuple(map(AxisTotals.of, evidence.axes))
        return Header(machine.robot.name, machine.parts.driver_profile.name, machine.bus.bitrate, axes)

    def _all(self, evidence: Evidence, shown: RecordedMotion) -> Piece:
        lines = [log_line(counts, frame) for counts, frame in self._machine.bus_log]
        mark = Mark(
            until_counts=self._machine.simulation.now_counts,
            start_counts=shown.start_counts or 0,
            no_plan=shown.no_plan,
            next_counts=shown.next_counts,
        ).with_stop(shown.stop)
        return Piece(evidence.axes, lines, self._rows, mark, shown.plan_number)

    def _report(self, evidence: Evidence, shown: RecordedMotion) -> dict[str, Any]:
        return recording_report(
            self._machine,
            [
                JointFigures(axis.start_steps, end, int(axis.clk_rise_counts.size), int(axis.violations.counts.size))
                for axis, end in zip(evidence.axes, self._machine.steps(), strict=True)
            ],
            shown,
            job=self._job,
            wall_s=time.perf_counter() - self._began_s,
            happened={
                "operations": self._machine.operations.requests(),
                **speeds_document(evidence.axes[0].rates.speeds(shown.start_counts or 0)),
                **{
                    name: judged_document(name, seen, 0, self._machine.robot.axis_names)
                    for name, seen in evidence.features.items()
                },
            },
        )
