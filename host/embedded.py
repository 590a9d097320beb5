"""The default board: emulated in this process, in virtual time, with the client's network wired straight to it."""

from collections.abc import Iterable, Iterator, Sequence
from math import floor

import canopen
import numpy as np
from canopen.network import PeriodicMessageTask

from controller.backend import Kernel
from controller.kernel import TICK_COUNTS
from controller.motion import COUNTS_PER_SECOND
from controller.pins import Pin, PinChange
from emulator.board import AxisTrace, Board, BoardConfig
from emulator.bus import Bus
from emulator.bus_faults import FaultScript
from emulator.operations import Operation, Scheduled
from emulator.simulation import BusOverloadError, Simulation
from emulator.switches import Switch
from host.drivers import driver_profile, fitted_modules, phases_evidence, violations_evidence
from host.errors import BusError
from host.repeated_frames import RepeatedFrames
from host.robot import Joint, Robot
from host.verify import AxisEvidence, BusReport, Evidence, LevelEdges, Phases
from host.wiring import output_changes
from protocol.cia402 import DigitalInput
from protocol.frame import COB_SYNC, Frame
from protocol.objects import UNITS_PER_FULL_STEP

_BOOT_S = 0.01
"""The host comes after the nodes' boot-up messages."""


class EmbeddedNetwork(canopen.Network):
    """The canopen library's network on a simulated bus.

    `send_message` returns when the bus has fallen silent again, so that the library's blocking calls find their
    answers already there; nothing waits and no thread is needed. Periodic frames go out when simulated time has come
    to their turn: while the client waits, or before the next frame that it sends.
    """

    def __init__(self, simulation: Simulation) -> None:
        super().__init__()
        self._simulation = simulation
        self._repeated = RepeatedFrames(simulation)
        simulation.on_frame = self._frame_arrived

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a data frame; remote frames do not exist on this bus.

        Raises:
            BusError: the nodes' own frames leave the bus no pause.
        """
        if remote:
            raise ValueError("the simulated board answers no remote frames; CiA 301 advises against them")
        self._send_due()
        try:
            self._simulation.send(Frame(can_id, bytes(data)))
        except BusOverloadError as error:
            raise BusError(str(error)) from error

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        """Repeat a data frame every `period` seconds of simulated time, from now on."""
        task = PeriodicMessageTask(can_id, data, period, self._repeated, remote)
        self._send_due()
        return task

    def _send_due(self) -> None:
        for frame in self._repeated.take_due():
            self.send_message(frame.cob_id, frame.data)

    def run_until(self, until_counts: int) -> None:
        """Let simulated time pass to an instant, or to the end of the periodic frame that is on the bus then."""
        while (due_counts := self._repeated.due_counts) is not None and due_counts < until_counts:
            self._simulation.run_until(due_counts)
            self._send_due()
        self._simulation.run_until(until_counts)

    def _frame_arrived(self, frame: Frame, counts: int) -> None:
        self.notify(frame.cob_id, bytearray(frame.data), counts / COUNTS_PER_SECOND)


class EmbeddedBoard:
    """A robot's board on a bus of its own; fulfils the client's Link. The machine stands at the given joints.

    `schedule` says what will happen to the machine beside its motion, and when.
    """

    def __init__(
        self,
        robot: Robot,
        start_joints: list[float],
        kernel: Kernel,
        bus_faults: FaultScript | None = None,
        schedule: Iterable[Scheduled] = (),
        driver_profile_name: str | None = None,
    ) -> None:
        """By a name it has other drivers than the robot's file says.

        Raises:
            InputError: there are no such drivers, or they cannot be set as the robot needs them.
        """
        self._robot = robot
        self.driver_profile = driver_profile(robot.board, driver_profile_name)
        self._start_steps = [
            _steps_at(joint, position) for position, joint in zip(start_joints, robot.joints, strict=True)
        ]
        config = BoardConfig(
            axis_count=len(robot.joints),
            osc_pf=(self.driver_profile.osc_pf,) * len(robot.joints),
            switches=tuple(_switches(robot)),
            start_steps=tuple(self._start_steps),
            modules=fitted_modules(robot, self.driver_profile, as_filed=driver_profile_name is None),
        )
        self._board = Board(config, kernel)
        self._simulation = Simulation([self._board], Bus(robot.board.bitrate, bus_faults), schedule)
        self.network = EmbeddedNetwork(self._simulation)
        self.wait(_BOOT_S)

    def now_s(self) -> float:
        """Simulated seconds since the board was switched on."""
        return self._simulation.now_s

    def wait(self, dt_s: float) -> None:
        """Let simulated time pass; more than asked for if a frame is on the bus at its end."""
        self.network.run_until(self._simulation.now_counts + round(dt_s * COUNTS_PER_SECOND))

    def operate(self, operation: Operation) -> None:
        """Do something to the machine, now: press its e-stop, let its supply break down."""
        self._simulation.operate(operation)

    @property
    def bus_log(self) -> list[tuple[int, Frame]]:
        """Every frame with the instant, in counts, at which it became valid."""
        bus = self._simulation.bus
        return list(zip(bus.log_counts, bus.log_frames, strict=True))

    def bus_report(self) -> BusReport:
        """The traffic so far."""
        bus = self._simulation.bus
        load_percent = 100 * bus.busy_bits / (bus.bitrate * self._simulation.now_s)
        return BusReport(bus.bitrate, len(bus.log_frames), load_percent)

    def driver_positions(self) -> list[int]:
        """Where each driver's own counter says the motor is, in steps from the joint's zero."""
        traces = (self._board.trace(axis) for axis in range(len(self._start_steps)))
        return [start + trace.position_steps for start, trace in zip(self._start_steps, traces, strict=True)]

    @property
    def started(self) -> bool:
        """Whether a SYNC has set the axes going."""
        return any(frame.cob_id == COB_SYNC for frame in self._simulation.bus.log_frames)

    def evidence(self) -> Evidence:
        """What the drivers saw; the motion's t = 0 is the first servo tick after the last SYNC."""
        sync_counts = max(counts for counts, frame in self.bus_log if frame.cob_id == COB_SYNC)
        traces = [self._board.trace(axis) for axis in range(len(self._start_steps))]
        axes = tuple(
            _axis_evidence(
                joint.name,
                self._start_steps[i],
                traces[i],
                phases_evidence(self._board.outputs(i)),
                _level_edges(i, self._board.pin_changes),
            )
            for i, joint in enumerate(self._robot.joints)
        )
        return Evidence(-(-sync_counts // TICK_COUNTS) * TICK_COUNTS, axes, output_changes(self._robot, axes))


def _steps_at(joint: Joint, position: float) -> int:
    """The step at which a joint stands: rounded to a wire unit, then to a step, as the firmware's preset does it.

    Rounded at once, a position just below half a step could come out one step below the firmware's counter.
    """
    units = floor(position * joint.transmission.wire_units_per_unit + 0.5)
    return (units * joint.transmission.microsteps + UNITS_PER_FULL_STEP // 2) // UNITS_PER_FULL_STEP


def _switches(robot: Robot) -> Iterator[Switch]:
    """The switches of the robot's file; the limit switches are closed to the ends of travel."""
    for axis, joint in enumerate(robot.joints):
        places = joint.switches
        if places.negative_limit is not None:
            yield Switch(axis, DigitalInput.NEGATIVE_LIMIT, to_steps=_steps_at(joint, places.negative_limit))
        if places.positive_limit is not None:
            yield Switch(axis, DigitalInput.POSITIVE_LIMIT, from_steps=_steps_at(joint, places.positive_limit))
        first, last = (None if end is None else _steps_at(joint, end) for end in (places.home_from, places.home_to))
        if first is not None or last is not None:
            yield Switch(axis, DigitalInput.HOME, first, last)


def _level_edges(axis: int, changes: Sequence[PinChange]) -> dict[str, LevelEdges]:
    """One axis' pins that the firmware holds at a level, by name."""
    in_order = sorted(changes, key=lambda change: change.counts)
    edges = {pin: [change for change in in_order if (change.axis, change.pin) == (axis, pin)] for pin in Pin}
    return {
        pin.value.lower(): LevelEdges(
            np.array([change.counts for change in own], np.int64), np.array([change.level for change in own], np.int8)
        )
        for pin, own in edges.items()
    }


def _axis_evidence(
    name: str, start_steps: int, trace: AxisTrace, phases: Phases, pins: dict[str, LevelEdges]
) -> AxisEvidence:
    return AxisEvidence(
        name=name,
        start_steps=start_steps,
        clk_rise_counts=trace.clk_rise_counts,
        clk_fall_counts=trace.clk_fall_counts,
        dir_edge_counts=trace.dir_counts,
        dir_levels=trace.dir_levels,
        step_counts=trace.step_counts,
        step_signs=trace.step_signs,
        violations=violations_evidence(trace.violations),
        phases=phases,
        pins=pins,
    )
