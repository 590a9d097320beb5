"""A robot's board, or its boards, in real time, with everything that is recorded and said about them."""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, TextIO

from steptwin.controller.backend import Kernel
from steptwin.controller.kernel import TICK_COUNTS
from steptwin.controller.pins import PinChange
from steptwin.emulator.board import AxisTrace, Board
from steptwin.emulator.bus import Bus
from steptwin.emulator.lateness import Lateness
from steptwin.emulator.live import LiveSimulation, warm_up
from steptwin.emulator.pacer import Pacer
from steptwin.emulator.simulation import Simulation
from steptwin.host.record.bus_log import log_line
from steptwin.host.record.folder import (
    BUS_LOG,
    EDGES,
    FOLDER_VERSION,
    REPORT,
    ROBOT,
    VERSION_KEY,
    AxisTotals,
    EdgeSpool,
    write_report,
)
from steptwin.host.robots.board_settings import ActiveEdge
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.board_config import board_configs
from steptwin.host.twin.drivers import driver_profile
from steptwin.host.twin.evidence import axis_evidence
from steptwin.host.twin.live_plan import LivePlan
from steptwin.host.twin.standing import standing_steps
from steptwin.host.verify import DriverLimit
from steptwin.protocol.frame import COB_SYNC, FIRST_NODE_ID, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

RECORD_EVERY_S: Final = 0.5
"""How often `record` is to be called: the drivers' history is held in memory until then."""


class LiveBoard:
    """A robot's board, or several, on a bus of its own, for a `LiveLoop` to run. It records until it is closed.

    With all its files in `out`, or the bus log alone in `log`, or none: memory stays bounded either way.
    """

    def __init__(
        self,
        robot: Robot,
        stand_at: list[float],
        kernel: Kernel,
        *,
        bitrate: int,
        speed: float,
        axes_per_board: Sequence[int] | None = None,
        out: Path | None = None,
        log: Path | None = None,
        driver_profile_name: str | None = None,
    ) -> None:
        """Set the board up.

        Args:
            robot: the machine.
            stand_at: where it stands, mm and degrees.
            kernel: which form of the firmware's kernel runs.
            bitrate: of the bus.
            speed: simulated seconds per second.
            axes_per_board: in the order of the joints; None: all on one board.
            out: the folder for everything.
            log: the file for the bus log.
            driver_profile_name: drivers that the board has instead of those in the robot's file.

        Raises:
            InputError: there are no such drivers, or they cannot be set as the robot needs them.
            OSError: a file cannot be written.
        """
        self.robot = robot
        self.axes_per_board = tuple(axes_per_board or [len(robot.joints)])
        configs = board_configs(robot, stand_at, self.axes_per_board, driver_profile_name)
        self.driver_profile = driver_profile(robot.board, driver_profile_name)
        self._out = out
        self._files = ExitStack()
        self._logs: list[TextIO] = []
        if log is not None:
            self._logs.append(self._file(log))
        if out is not None:
            self._logs.append(self._file(out / BUS_LOG))
        self._spool = None if out is None else EdgeSpool(out / EDGES)
        self._start_steps = standing_steps(robot, stand_at)
        self._end_steps = list(self._start_steps)
        self._pulses = [0] * len(robot.joints)
        self._violations = [0] * len(robot.joints)
        self._limits: list[tuple[DriverLimit, ...]] = [()] * len(robot.joints)
        """What each driver asks for."""
        self._sync_counts: int | None = None
        """A SYNC at rest, of which it is not known yet whether it starts a motion."""
        self._motion_start_counts: int | None = None
        """t = 0 of the last motion that a SYNC has started."""
        warm_up(kernel)
        self._active_edges = [ActiveEdge(module.active_edge) for config in configs for module in config.modules]
        self._boards = [Board(config, kernel) for config in configs]
        self._axes = [(board, axis) for board in self._boards for axis in range(board.config.axis_count)]
        """Of each joint: its board, and its number there."""
        self._plan = None if out is None else LivePlan(out, robot, self._axes, self._start_steps)
        self.bus = Bus(bitrate, log=self._log)
        simulation = Simulation(self._boards, self.bus)
        self.live = LiveSimulation(simulation, Pacer(time.monotonic_ns(), speed))

    def _file(self, path: Path) -> TextIO:
        return self._files.enter_context(path.open("w", encoding="ascii"))

    # --- what is recorded

    def _log(self, frame: Frame, counts: int) -> None:
        """Every frame on the bus comes here, before its receivers have it."""
        self._judge_motion()
        if frame.cob_id == COB_SYNC and not self._in_motion:
            self._sync_counts = counts
            if self._plan:
                self._plan.sync()
        for log in self._logs:
            log.write(log_line(counts, frame))

    def _judge_motion(self) -> None:
        """What moves before any other frame has been received was set going by the SYNC; and it may be over by now."""
        if self._sync_counts is not None and self._in_motion:
            self._motion_start_counts = -(-self._sync_counts // TICK_COUNTS) * TICK_COUNTS
            if self._plan:
                self._plan.begin()
        self._sync_counts = None
        if self._plan:
            self._plan.follow(in_motion=self._in_motion)

    @property
    def _in_motion(self) -> bool:
        return any(board.firmware.motion.running(axis) for board, axis in self._axes)

    def record(self) -> None:
        """Take what has happened at the drivers since the last call, write it away and forget it."""
        self._judge_motion()
        for board in self._boards:
            traces = [board.take_trace(axis) for axis in range(board.config.axis_count)]
            changes = board.take_pin_changes()
            for axis, trace in enumerate(traces):
                self._record_axis(board.config.first_node_id - FIRST_NODE_ID + axis, trace, axis, changes)
        for log in self._logs:
            log.flush()

    def _record_axis(self, joint: int, trace: AxisTrace, axis: int, changes: Sequence[PinChange]) -> None:
        """The joint's axis on its board, whose pin changes these are."""
        self._end_steps[joint] = self._start_steps[joint] + trace.position_steps
        self._pulses[joint] += trace.clk_rise_counts.size
        self._violations[joint] += trace.violations.counts.size
        if self._spool:
            evidence = axis_evidence(self.robot.joint_names[joint], self._start_steps[joint], trace, axis, changes)
            self._limits[joint] = evidence.violations.limits
            self._spool.append(evidence)

    def close(self, document: dict[str, Any]) -> None:
        """Complete the files, after the last `record`; `document` becomes report.json."""
        self._files.close()
        if self._plan:
            self._plan.finish()
        if self._spool and self._out:
            totals = zip(self.robot.joint_names, self._start_steps, self._active_edges, self._limits, strict=True)
            axes = [AxisTotals(*axis) for axis in totals]
            self._spool.finish(self._motion_start_counts or 0, axes)
            (self._out / ROBOT).write_text(self.robot.toml, encoding="utf-8")
            write_report(self._out / REPORT, document | {VERSION_KEY: FOLDER_VERSION})

    # --- what is said

    @property
    def simulated_s(self) -> float:
        """Seconds on the board's clock."""
        return self.live.simulation.now_s

    @property
    def wall_s(self) -> float:
        """Seconds since the board was switched on."""
        return (time.monotonic_ns() - self.live.pacer.start_ns) / 1e9

    @property
    def bus_load_percent(self) -> float:
        """The bus' load since the beginning."""
        return 100 * self.bus.busy_bits / (self.bus.bitrate * max(self.simulated_s, 1e-3))

    def lateness(self) -> dict[str, dict[str, float]]:
        """How late the servo ticks of motions and the board's frames were."""
        return {"ticks": _figures(self.live.ticks), "frames": _figures(self.live.frames)}

    def report(self) -> dict[str, Any]:
        """The report under the keys of report.json, as of the last `record`; docs/live.md says what they are."""
        steps_per_unit = self.robot.steps_per_unit.tolist()
        started_counts = self._motion_start_counts
        return {
            "robot": self.robot.name,
            "job": "live",
            "driver_profile": self.driver_profile.name,
            "duration_s": round(self.simulated_s, 6),
            "simulated": True,
            "passed": None,
            "started_s": None if started_counts is None else started_counts / COUNTS_PER_SECOND,
            "no_plan": self._plan.lacking if self._plan else None,
            "outputs": [],
            "boards": list(self.axes_per_board),
            "axes": [
                {
                    "name": name,
                    "steps_start": self._start_steps[axis],
                    "steps_end": self._end_steps[axis],
                    "pulses": self._pulses[axis],
                    "violations": self._violations[axis],
                }
                for axis, name in enumerate(self.robot.joint_names)
            ],
            "joints": {
                "names": list(self.robot.joint_names),
                "start": [steps / spu for steps, spu in zip(self._start_steps, steps_per_unit, strict=True)],
                "end": [steps / spu for steps, spu in zip(self._end_steps, steps_per_unit, strict=True)],
            },
            "bus": {
                "bitrate": self.bus.bitrate,
                "frames": self.bus.frames,
                "load_percent": round(self.bus_load_percent, 3),
            },
            "real_time": {"speed": self.live.pacer.speed, **self.lateness()},
            "simulated_s": round(self.simulated_s, 6),
            "wall_s": round(self.wall_s, 6),
        }


def _figures(lateness: Lateness) -> dict[str, float]:
    """How late they were, in us of the wall clock."""
    return {
        "count": lateness.count,
        "late_us_p50": lateness.percentile_ns(50) / 1000,
        "late_us_p99": lateness.percentile_ns(99) / 1000,
        "late_us_max": lateness.max_ns / 1000,
    }
