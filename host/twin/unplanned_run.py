"""Keep, in memory, what a machine does without a known plan, and make the folder of a run of it.

The folder is the one that a live board leaves (docs/run-folder.md): the plan is that of the records which the axes have
received, and there is no verdict. It has a waveform besides.
"""

import time
from pathlib import Path
from typing import Any

from steptwin.emulator.simulation import Simulation
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
from steptwin.host.twin.boards import axes_of, counted_steps
from steptwin.host.twin.evidence import axes_evidence
from steptwin.host.twin.followed_motion import FollowedMotion
from steptwin.host.twin.live_plan import LivePlan
from steptwin.host.twin.machine_parts import MachineParts
from steptwin.host.twin.operation_log import OperationLog
from steptwin.host.twin.recording_report import JointFigures, recording_report
from steptwin.host.twin.shelf import shelf_evidence
from steptwin.host.verify import Evidence, shelf_document
from steptwin.host.verify.wiring import output_changes
from steptwin.protocol.frame import Frame


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
        self._rows: list[str] = []
        """Rows of the plan up to the last time that it was saved."""
        self._operations = operations
        simulation.bus.also_log(self._motion.frame)

    @property
    def bus_log(self) -> list[tuple[int, Frame]]:
        """Every frame with the instant, in counts, at which it became valid."""
        bus = self._simulation.bus
        return list(zip(bus.log_counts, bus.log_frames, strict=True))

    def evidence(self) -> Evidence:
        """Return every edge at the drivers; t = 0 is the start of the last motion by a SYNC, else power-up."""
        self._motion.follow()
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
        taken = self._plan.take()
        self._rows = list(taken.rows) if taken.begin else [*self._rows, *taken.rows]
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
        mark = Mark(
            until_counts=self._simulation.now_counts,
            start_counts=evidence.start_counts,
            no_plan=self._plan.lacking,
        )
        return Piece(evidence.axes, lines, PlanRows(begin=True, rows=self._rows), mark)

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
