"""Emulate a robot's board in this process, in virtual time, with the client's network connected to its bus."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from math import floor
from typing import Any

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.drivers.excitation import CYCLE_FULL_STEPS
from steptwin.emulator.operations import InputOperation, Operation, Scheduled
from steptwin.host.common.features import MachinePart
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.embedded_network import EmbeddedNetwork, whole_us_counts
from steptwin.host.twin.embedded.outcome import RunEnd, RunVerdict
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine, MachineParts, OperationLog
from steptwin.host.twin.machine.evidence import axes_by_own_clocks, axes_evidence, tick_after
from steptwin.host.twin.machine.input_changes import InputChange, set_input
from steptwin.host.twin.machine.machine_options import AS_FILED, MachineOptions
from steptwin.host.verify import AxisEvidence, BusReport, Evidence
from steptwin.host.verify.switching import output_edges
from steptwin.protocol.drivers import DriverProfile
from steptwin.protocol.frame import COB_SYNC, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

_BOOT_S = 0.01
"""Time from power-up to the host's arrival; the nodes have sent their boot-up messages by then."""


class EmbeddedBoard:
    """A robot's board, or several, on a bus of their own; implements the client's Link."""

    def __init__(
        self,
        robot: Robot,
        kernel: Kernel,
        options: MachineOptions = AS_FILED,
        *,
        schedule: Iterable[Scheduled] = (),
        commissioned: bool = True,
        waits_for: Collection[str] | None = None,
    ) -> None:
        """Switch on the boards.

        Args:
            robot: the machine.
            kernel: form of the firmware's kernel.
            options: differences from the robot's file, and operations on the machine.
            schedule: further operations on the machine, such as EmergencyStop, each with its instant.
            commissioned: True for a board with the robot's settings in flash, False for a new one.
            waits_for: inputs for which the motion waits; None: unknown.

        Raises:
            InputError: as `MachineParts.of`, or the machine lacks the target of an operation or of a feature's part.
        """
        self.robot: Robot = robot
        self.options: MachineOptions = options
        parts = MachineParts.of(robot, kernel, options, commissioned=commissioned, waits_for=waits_for)
        self.driver_profile: DriverProfile = parts.driver_profile
        self._machine = EmulatedMachine(parts, schedule)
        self.parts: Mapping[str, MachinePart] = parts.features
        """Parts of features in the machine, by name."""
        self.operations: OperationLog = self._machine.operations
        """Operations on the machine."""
        self.connect_host()
        self._changes: list[InputChange] = []
        """Changes of inputs that begin with the SYNC of the next motion."""
        self._changes_after = 0
        """Length of the bus log when these were set."""
        self.wait(_BOOT_S)

    def connect_host(self) -> None:
        """Connect a host in place of the last one; `network` is its network."""
        of_parts = [network for part in self.parts.values() if (network := part.network()) is not None]
        self.network: EmbeddedNetwork = of_parts[0] if of_parts else EmbeddedNetwork(self._machine.simulation)

    @property
    def moving(self) -> bool:
        """True while an axis executes a motion."""
        return self._machine.interpolating

    @property
    def held_up_s(self) -> float:
        """Time during which the simulation waited for this program: 0."""
        return 0.0

    @property
    def now_counts(self) -> int:
        """Counts of the board's timer since power-up."""
        return self._machine.simulation.now_counts

    def now_s(self) -> float:
        """Return the simulated seconds since power-up."""
        return self.network.now_s()

    def wait(self, dt_s: float) -> None:
        """Let `dt_s` seconds of simulated time pass, and complete any periodic frame on the bus."""
        if self._changes and (sync_counts := self._last_sync_counts(self._changes_after)) is not None:
            begin_counts = tick_after(sync_counts)
            for change in self._changes:
                at_counts = begin_counts + round(change.at_s * COUNTS_PER_SECOND)
                placed = self._machine.places.on_boards(self._input_operation(change))
                self._machine.simulation.schedule(Scheduled(at_counts, each, number) for number, each in placed)
            self._changes = []
        self.network.wait(dt_s)

    def pass_time(self, dt_s: float) -> None:
        """Let simulated time pass, in whole microseconds, without a host or its heartbeat."""
        self._machine.simulation.run_until(self._machine.simulation.now_counts + whole_us_counts(dt_s))

    def set_input(self, name: str, *, on: bool) -> None:
        """Set a digital input of the robot now; raise InputError for an unknown name."""
        self.operate(set_input(self.robot, name, on=on))

    def change_inputs(self, changes: Sequence[InputChange]) -> None:
        """Change inputs during the motion of the next SYNC; raise InputError for an unknown name."""
        for change in changes:
            self._input_operation(change)
        for change in sorted(changes, key=lambda change: change.at_s):
            if change.at_s <= 0:
                self.operate(self._input_operation(change))
        self._changes = [change for change in changes if change.at_s > 0]
        self._changes_after = len(self._machine.bus.log_frames)

    def _input_operation(self, change: InputChange) -> InputOperation:
        return set_input(self.robot, change.name, on=change.on)

    def _last_sync_counts(self, after: int = 0) -> int | None:
        """Return the instant of the host's last SYNC in the bus log from entry `after` on; None if there is none."""
        bus = self._machine.bus
        log = zip(bus.log_counts[after:], bus.log_frames[after:], strict=True)
        rogue = {counts for counts, _ in self._machine.simulation.rogue_frames}
        return max((counts for counts, frame in log if frame.cob_id == COB_SYNC and counts not in rogue), default=None)

    def operate(self, operation: Operation) -> None:
        """Execute an operation on the machine now, such as EmergencyStop(pressed=True).

        Raises:
            InputError: the machine lacks its target, such as motors that turn with the board.
        """
        self._machine.operate(operation)

    def verdicts(self, end: RunEnd) -> dict[str, RunVerdict]:
        """Return the verdicts of features on a run that ends now, by name."""
        judged = {name: part.verdict(end) for name, part in self.parts.items()}
        return {name: verdict for name, verdict in judged.items() if verdict is not None}

    @property
    def bus_log(self) -> list[tuple[int, Frame]]:
        """Every frame with the instant when it became valid, in counts."""
        return self._machine.bus_log

    def bus_report(self) -> BusReport:
        """Return bit rate, number of frames and load since power-up."""
        bus = self._machine.bus
        load_percent = 100 * bus.busy_bits / (bus.bitrate * self._machine.simulation.now_s)
        return BusReport(bus.bitrate, bus.frames, load_percent)

    def driver_positions(self) -> list[int]:
        """Return `motor_positions` in whole steps, rounded down."""
        return list(map(floor, self.motor_positions()))

    def motor_positions(self) -> list[float]:
        """Return the position of each motor by the steps of its driver, from the joint's zero.

        It is in steps of the robot's file, a whole number of them if the driver makes the same steps.
        """
        return self._machine.steps()

    def counted_units(self) -> list[int]:
        """Return the position of each axis by the firmware's count, as in 0x6064, without a request on the bus."""
        return [board.firmware.motion.axes[axis].counter_units for board, axis in self._machine.axes]

    def rotor_positions(self) -> list[float]:
        """Return the real position of each rotor, in the steps of `motor_positions`; equal to it without motors."""
        full_steps = self._machine.simulation.rotors_full_steps()
        return [
            start + moved * joint.transmission.microsteps
            for start, moved, joint in zip(self._machine.start_steps, full_steps, self.robot.axes, strict=True)
        ]

    def held_positions(self) -> list[float]:
        """Return the position where each driver holds its rotor, in steps from the joint's zero as `motor_positions`.

        A rotor that turns with the board and has slipped is whole electrical cycles away from its driver's count. The
        load angle is left out.
        """
        positions = []
        for steps, rotor, joint in zip(self.motor_positions(), self.rotor_positions(), self.robot.axes, strict=True):
            cycle = CYCLE_FULL_STEPS * joint.transmission.microsteps
            positions.append(steps + cycle * round((rotor - steps) / cycle))
        return positions

    def rotor_slips(self) -> list[float]:
        """Return the steps of the robot's file that each rotor has slipped by itself; 0 without motors.

        It is the distance from the driver's steps with the injected slips.
        """
        made = [full_steps for board in self._machine.simulation.boards for full_steps in board.slipped_full_steps]
        places = zip(self.held_positions(), self.motor_positions(), made, self.robot.axes, strict=True)
        return [held - steps - moved * joint.transmission.microsteps for held, steps, moved, joint in places]

    def settled(self, evidence: Evidence) -> dict[str, Any]:
        """Return the evidence of features some time after the last edge of a run with this evidence, by name."""
        return self._machine.features_settled(max(axis.last_counts for axis in evidence.axes))

    @property
    def motors_turn(self) -> bool:
        """True if the robot's motors turn with the board."""
        return self._machine.simulation.rotor_watch is not None

    def slipped_full_steps(self) -> list[int]:
        """Return the full steps of each rotor's slips since power-up, with sign."""
        return [board.shaft(axis).slipped_full_steps for board, axis in self._machine.axes]

    def microsteps(self) -> list[Microsteps]:
        """Return the microsteps per full step of each axis: its driver's, its board's and its robot file's."""
        return self._machine.microsteps()

    @property
    def started(self) -> bool:
        """True once the host has sent a SYNC."""
        return self._last_sync_counts() is not None

    def evidence(self) -> Evidence:
        """Return every edge at the drivers; t = 0 is the first servo tick after the last SYNC, else power-up."""
        return self._evidence(axes_evidence(self._machine))

    def axes_evidence(self) -> tuple[AxisEvidence, ...]:
        """Return the edges of `evidence` without the phase currents, which would take most of the time."""
        return axes_evidence(self._machine, currents=False)

    def evidence_by_own_clocks(self) -> Evidence:
        """Return every edge by the boards' own crystals: exactly as planned, however far crystals are off."""
        return self._evidence(axes_by_own_clocks(self._machine, self._last_sync_counts() or 0))

    def _evidence(self, axes: tuple[AxisEvidence, ...]) -> Evidence:
        start_counts = tick_after(self._last_sync_counts() or 0)
        return Evidence(start_counts, axes, output_edges(self.robot, axes), self._machine.features_evidence())
