"""Run a robot's boards in real time, record what happens on the bus and at the drivers, and report on it."""

import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.group_time import RateRamp
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board
from steptwin.emulator.board.environment import BoardEnvironment
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.drivers.driver_bank import AxisTrace
from steptwin.emulator.live.live_simulation import Lateness, LiveSimulation, Pacer, warm_up
from steptwin.emulator.operations import Operation
from steptwin.host.common.errors import RecordingError
from steptwin.host.common.features import MachinePart
from steptwin.host.record.bus_log import BusLog, log_line
from steptwin.host.record.folder import LIVE_JOB, AxisTotals, Header, Mark, Piece, Recording
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.joint import Joint
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.live.live_plan import FollowedMotion, LivePlan
from steptwin.host.twin.live.recording_report import JointFigures, bus_figures, load_percent, recording_report
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine, MachineParts
from steptwin.host.twin.machine.evidence import (
    axis_evidence,
    driver_violations,
    in_bus_time,
    level_edges,
    rate_ramps,
)
from steptwin.host.twin.machine.machine_options import AS_FILED, MachineOptions
from steptwin.host.verify import AxisEvidence, RateRamps, speeds_document
from steptwin.host.verify.figures import judged_document
from steptwin.protocol.drivers import ActiveEdge, DriverProfile
from steptwin.protocol.frame import FIRST_NODE_ID, Frame


@dataclass(slots=True)
class JointTotals:
    """Totals of a joint's driver since power-up.

    Attributes:
        joint: the joint.
        start_steps: position at power-up, in steps of the robot's file from the joint's zero.
        active_edge: edge of CLK that the driver counts.
        moved_full_steps: travel of the motor from power-up to the last trace.
        pulses: number of rising CLK edges.
        violations: number of violations of the driver's limits.
    """

    joint: Joint
    start_steps: int
    active_edge: ActiveEdge
    moved_full_steps: float = 0.0
    pulses: int = 0
    violations: int = 0

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.joint.name

    def add(self, trace: AxisTrace) -> None:
        """Add a trace of the driver."""
        self.moved_full_steps = trace.position_full_steps
        self.pulses += trace.clk_rise_counts.size
        self.violations += trace.violations.counts.size

    @property
    def figures(self) -> JointFigures:
        """Figures up to the last trace."""
        end_steps = self.start_steps + self.moved_full_steps * self.joint.transmission.microsteps
        return JointFigures(self.start_steps, end_steps, self.pulses, self.violations)


RECORD_EVERY_S: Final = 0.5
"""Longest time for which the drivers' history stays in memory."""

OPERATIONS_MAX: Final = 1000
"""Number of operations that are kept; bounds the memory."""

_STRETCH_TICKS: Final = 80
"""Largest delay in ticks (20 ms) of the rotors during a motion. Beyond it they turn at once, which makes the next ticks
late; before that they follow in pieces, in the board's spare time.
"""

_OPEN_TICKS: Final = 4
"""Servo ticks before now when a driver's count may be incomplete: 1 ms, several times a driver's longest limit."""


class LiveBoard:
    """A robot's board, or several on one bus, run by a `LiveLoop`; it records until it is closed.

    All files go into the folder `out`, or only the bus log into the file `log`. Memory stays bounded. An error of
    writing ends that recording, never the board: `failures` has it.
    """

    def __init__(
        self,
        robot: Robot,
        kernel: Kernel,
        options: MachineOptions = AS_FILED,
        *,
        speed: float = 1.0,
        out: Path | None = None,
        log: Path | None = None,
    ) -> None:
        """Set up the board.

        Args:
            robot: the machine.
            kernel: form of the firmware's kernel.
            options: differences from the robot's file, and operations on the machine.
            speed: simulated seconds per second.
            out: folder for all files.
            log: file for the bus log.

        Raises:
            InputError: as `MachineParts.of`, or a feature's part works only in virtual time.
            OSError: a file cannot be written.
        """
        parts = MachineParts.of(robot, kernel, options)
        for part in parts.features.values():
            part.check_live()
        self.robot = robot
        self.driver_profile: DriverProfile = parts.driver_profile
        self._machine = machine = EmulatedMachine(parts, log=self._log, operations_max=OPERATIONS_MAX)
        self._boards = machine.simulation.boards
        self.bus: Bus = machine.bus
        self._ramps: deque[RateRamp] = deque(maxlen=OPERATIONS_MAX)
        """Speed changes of motions by the first board, up to the last `record`."""
        self._lines: list[str] = []
        """Lines of the bus log since the last `record`."""
        modules = [module for board in self._boards for module in board.config.modules]
        self._joints = [
            JointTotals(joint, steps, module.active_edge)
            for joint, steps, module in zip(robot.axes, parts.start_steps, modules, strict=True)
        ]
        self.recent_bus_load_percent: float = 0.0
        """Load of the bus between the last two calls of `record`, in percent."""
        self._busy_bits, self._busy_until_s = 0, 0.0
        """Bits on the bus up to the last `record`, and its instant."""
        warm_up(kernel)
        self._next_axis = 0
        """Next axis of `record_next`."""
        self._bus_log = None if log is None else BusLog(log)
        self._plan = None if out is None else LivePlan(machine)
        self._motion = FollowedMotion(machine, self._plan)
        self._recording = None if out is None else Recording(out, self._header(), robot.toml)
        if watch := machine.simulation.rotor_watch:
            watch.stretch_ticks = _STRETCH_TICKS
        self.live: LiveSimulation = LiveSimulation(machine.simulation, Pacer(time.perf_counter_ns(), speed))

    def _header(self) -> Header:
        axes = tuple(
            AxisTotals(
                joint.name,
                joint.start_steps,
                joint.active_edge,
                driver_violations(board.trace(axis).violations).limits,
                self.driver_profile.chip.substeps,
            )
            for joint, (board, axis) in zip(self._joints, self._machine.axes, strict=True)
        )
        return Header(self.robot.name, self.driver_profile.name, self.bus.bitrate, axes)

    def operate(self, operation: Operation) -> None:
        """Execute an operation on the machine now, in the loop only.

        An operation on an axis has its number over all boards; any other is executed on every board.

        Raises:
            InputError: the machine lacks its target, such as motors that turn with the board.
        """
        self._machine.operate(operation)

    @property
    def environment(self) -> BoardEnvironment:
        """Present environment of the machine; values common to all axes of a board are those of all boards."""
        return self._machine.environment

    @property
    def axes_per_board(self) -> tuple[int, ...]:
        """Number of axes on each board, in the order of the joints."""
        return tuple(board.config.axis_count for board in self._boards)

    # --- recording

    def _log(self, frame: Frame, counts: int) -> None:
        """Log a frame; called for every frame on the bus before its receivers get it."""
        self._motion.frame(frame, counts)
        if self._bus_log or self._recording:
            self._lines.append(log_line(counts, frame))

    @property
    def record_every_s(self) -> float:
        """Period of calls of `record_next`: each axis' history stays in memory for RECORD_EVERY_S."""
        return RECORD_EVERY_S if self._recording else RECORD_EVERY_S / len(self._machine.axes)

    def record_next(self) -> None:
        """Do the next part of `record`: all axes with a folder, since its pieces hold all axes; one axis without.

        Six axes at once delay a board in real time by 2 to 5 ms, which makes one tick in a hundred late.
        """
        if self._recording:
            self.record()
            return
        number = self._next_axis
        self._next_axis = (number + 1) % len(self._machine.axes)
        board, axis = self._machine.axes[number]
        self._joints[number].add(board.take_trace(axis))
        if self._next_axis == 0:
            self._end_round()
            for each in self._boards:
                each.take_pin_changes()
                self._take_ramps(each)

    def record(self) -> None:
        """Write the drivers' history since the last call to the files, and drop it."""
        lines = self._end_round()
        pieces: list[AxisEvidence] = []
        for board in self._boards:
            traces = [board.take_trace(axis) for axis in range(board.config.axis_count)]
            changes, rates = board.take_pin_changes(), self._take_ramps(board)
            for axis, trace in enumerate(traces):
                joint = self._joints[board.config.first_node_id - FIRST_NODE_ID + axis]
                joint.add(trace)
                if self._recording and not self._recording.failure:
                    pins = level_edges(axis, changes)
                    evidence = axis_evidence(joint.name, joint.start_steps, trace, pins, rates)
                    pieces.append(in_bus_time(evidence, board.own_clock))
        if self._recording and self._plan:
            self._recording.append(self._piece(pieces, lines, self._plan))

    def _take_ramps(self, board: Board) -> RateRamps:
        """Take a board's ramps of the rate; keep those of the first board."""
        ramps = board.take_rate_ramps()
        if board is self._boards[0]:
            self._ramps.extend(ramps)
        return rate_ramps(ramps)

    def _end_round(self) -> list[str]:
        """End the bus log's round of all axes; return its new lines."""
        self._motion.follow(max(board.computed_counts for board in self._boards))
        self._measure_load()
        self.bus.filters.struck.clear()
        for part in self.parts.values():
            part.end_round()
        lines, self._lines = self._lines, []
        if self._bus_log:
            self._bus_log.append(lines, self.simulated_s)
        return lines

    def _measure_load(self) -> None:
        """Measure the load of the bus since the last call, unless the board's clock has stopped since."""
        busy_bits, now_s = self.bus.busy_bits, self.simulated_s
        if now_s > self._busy_until_s:
            bits = self.bus.bitrate * (now_s - self._busy_until_s)
            self.recent_bus_load_percent = 100 * (busy_bits - self._busy_bits) / bits
            self._busy_bits, self._busy_until_s = busy_bits, now_s

    def _piece(
        self, axes: Sequence[AxisEvidence], lines: Sequence[str], plan: LivePlan, *, ended: bool = False
    ) -> Piece:
        computed_counts = min(board.computed_counts for board in self._boards)
        motion = self._motion.recorded(ended=ended)
        mark = Mark(
            until_counts=max(computed_counts - _OPEN_TICKS * TICK_COUNTS, 0),
            start_counts=motion.start_counts or 0,
            no_plan=motion.no_plan,
            in_motion=motion.in_motion,
            next_counts=motion.next_counts,
            load_percent=round(self.bus_load_percent, 3),
            wall_s=round(self.wall_s, 3),
        ).with_stop(motion.stop)
        return Piece(axes, lines, plan.take(), mark, motion.plan_number)

    def close(self, document: dict[str, Any]) -> None:
        """Complete the files after the last `record`; `document` becomes report.json."""
        for part in self.parts.values():
            part.close()
        if self._bus_log:
            self._bus_log.close()
        if self._recording and self._plan:
            self._recording.append(self._piece((), (), self._plan, ended=True))
            self._recording.finish(document)

    @property
    def failures(self) -> tuple[RecordingError, ...]:
        """Error of each recording that has ended early."""
        recordings = (self._recording, self._bus_log)
        return tuple(each.failure for each in recordings if each is not None and each.failure is not None)

    # --- figures

    @property
    def simulated_s(self) -> float:
        """Seconds on the board's clock since power-up."""
        return self._machine.simulation.now_s

    @property
    def wall_s(self) -> float:
        """Seconds on the wall clock since power-up."""
        return (time.perf_counter_ns() - self.live.pacer.start_ns) / 1e9

    @property
    def bus_load_percent(self) -> float:
        """Load of the bus since power-up, in percent."""
        return load_percent(self.bus, self.simulated_s)

    def bus_figures(self) -> dict[str, Any]:
        """Return the bus' bit rate, its number of frames and its load since power-up."""
        return bus_figures(self.bus, self.simulated_s)

    def real_time(self) -> dict[str, Any]:
        """Return the speed, and the board's lateness and stalls."""
        return {"speed": self.live.pacer.speed, **self.lateness(), "stalls": self.stalls()}

    @property
    def parts(self) -> Mapping[str, MachinePart]:
        """Parts of features in the machine, by name."""
        return self._machine.parts.features

    def features(self) -> dict[str, Any]:
        """Return the evidence of features up to their last look, by name."""
        looked = {name: part.seen() for name, part in self.parts.items()}
        axes = self.robot.axis_names
        return {name: judged_document(name, seen, 0, axes) for name, seen in looked.items() if seen is not None}

    def lateness(self) -> dict[str, dict[str, float]]:
        """Return the lateness of motions' servo ticks and of the board's frames, in us of the wall clock."""
        return {"ticks": _figures(self.live.ticks), "frames": _figures(self.live.frames)}

    def stalls(self) -> dict[str, float]:
        """Return number and total duration in ms of stops of the board's clock on a slow computer."""
        stalls = self.live.stalls
        return {"count": stalls.count, "total_ms": stalls.total_ns / 1e6, "longest_ms": stalls.longest_ns / 1e6}

    def mismatches(self) -> list[Microsteps]:
        """Return the axes with different microsteps per full step in driver, board and robot file."""
        return self._machine.mismatches()

    def report(self) -> dict[str, Any]:
        """Return the figures as of the last `record`, under the keys of report.json (docs/live.md)."""
        shown = self._motion.recorded(ended=True)
        speeds = rate_ramps(list(self._ramps)).speeds(shown.start_counts or 0)
        return recording_report(
            self._machine,
            [joint.figures for joint in self._joints],
            shown,
            job=LIVE_JOB,
            wall_s=self.wall_s,
            happened={
                "real_time": self.real_time(),
                "operations": self._machine.operations.requests(),
                **speeds_document(speeds),
                **self.features(),
                **self._machine.parts_document(),
            },
        )


def _figures(lateness: Lateness) -> dict[str, float]:
    return {
        "count": lateness.count,
        "late_us_p50": lateness.percentile_ns(50) / 1000,
        "late_us_p99": lateness.percentile_ns(99) / 1000,
        "late_us_max": lateness.max_ns / 1000,
    }
