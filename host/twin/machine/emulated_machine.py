"""Put an emulated machine together: its boards with their drivers, and the parts of features."""

from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board
from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.emulator.bus.can_bus import Bus, Log
from steptwin.emulator.operations import Operation, Scheduled
from steptwin.emulator.simulation import Simulation
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import MachinePart, giving
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import board_configs, make_boards, standing_steps
from steptwin.host.twin.machine.drivers import driver_profile
from steptwin.host.twin.machine.input_changes import request_of
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.protocol.drivers import DriverProfile
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class MachineParts:
    """The parts of an emulated machine, as they are at power-up.

    Attributes:
        robot: the machine.
        options: how it differs from the robot's file.
        driver_profile: the drivers.
        start_steps: where the motors stand, in steps of the robot's file from their axes' zeros.
        commissioned: True for boards whose flash holds the robot's settings, False for new ones.
        boards: the boards, without power.
        features: the parts that features have, by their names.
    """

    robot: Robot
    options: MachineOptions
    driver_profile: DriverProfile
    start_steps: Sequence[int]
    commissioned: bool
    boards: Sequence[Board]
    features: Mapping[str, MachinePart]

    @classmethod
    def of(
        cls,
        robot: Robot,
        kernel: Kernel,
        options: MachineOptions,
        *,
        commissioned: bool = True,
        waits_for: Collection[str] | None = None,
    ) -> "MachineParts":
        """Make the parts.

        Args:
            robot: the machine.
            kernel: form of the firmware's kernel.
            options: how it differs from the robot's file.
            commissioned: True for boards whose flash holds the robot's settings, False for new ones.
            waits_for: inputs for which the motion waits; None: unknown.

        Raises:
            InputError: a joint or the drivers do not exist, or cannot be set as the robot needs them, or have no such
                switches, or a feature's options do not fit, or the boards have not as many axes as the robot, or a
                crystal is too far off, or an EDS cannot be read or its node's id is taken.
        """
        joints, per_board = options.joints(robot), options.boards_of(robot)
        options.check_features()
        drivers, configs = driver_profile(robot.board, options.driver_profile), board_configs(robot, options)
        parts = {
            feature.name: part
            for feature, make in giving("part")
            if (part := make(robot, joints, per_board, feature.options_in(options.extras), waits_for)) is not None
        }
        return cls(
            robot,
            options,
            drivers,
            standing_steps(robot, joints),
            commissioned,
            make_boards(robot, configs, kernel, commissioned=commissioned, program=options.program()),
            parts,
        )


class OperationLog:
    """Every operation on a machine beside its bus from now on, or the last ones, as requests of the control port."""

    def __init__(self, machine: RobotBoards, most: int | None = None) -> None:
        """Begin; `most` is the number of operations that are remembered, None for all."""
        self._machine = machine
        self._done: deque[tuple[int, Operation]] = deque(maxlen=most)
        """What was done, and its instants in counts; axes are numbered among all boards'."""
        machine.simulation.on_operation = self._operated

    def _operated(self, scheduled: Scheduled) -> None:
        operation = self._machine.places.on_machine(scheduled.board, scheduled.operation)
        if operation is not None:
            self._done.append((scheduled.counts, operation))

    def requests(self) -> list[dict[str, Any]]:
        """Return what was done under the keys of docs/control-port.md, with `at_s` in seconds since power-up."""
        robot = self._machine.robot
        return [{"at_s": counts / COUNTS_PER_SECOND} | request_of(robot, each) for counts, each in self._done]


class EmulatedMachine(RobotBoards):
    """A robot's machine on a bus from power-up on: what embedded, live and replayed boards are.

    Attributes:
        parts: what it is made of.
        bus: the bus of its boards.
        operations: what is done to it beside its bus.
    """

    def __init__(
        self,
        parts: MachineParts,
        schedule: Iterable[Scheduled] = (),
        *,
        log: Log | None = None,
        operations_max: int | None = None,
    ) -> None:
        """Switch the boards on.

        Args:
            parts: what the machine is made of.
            schedule: operations on it beside its motion, each with its instant.
            log: called with each frame on the bus and its instant; by default the bus keeps them.
            operations_max: number of operations that are remembered; None for all.

        Raises:
            InputError: the machine has not what an operation or a feature's part concerns.
        """
        robot, options = parts.robot, parts.options
        schedule = tuple(schedule)
        self.parts = parts
        self.bus: Bus = Bus(options.bits_per_s(robot), log)
        try:
            joining = [part.join for part in parts.features.values()]
            simulation = Simulation(parts.boards, self.bus, schedule, joining)
        except FirmwareError as error:
            raise InputError(f"firmware: {error}") from error
        super().__init__(robot, simulation, parts.start_steps)
        self.operations: OperationLog = OperationLog(self, operations_max)
        for each in schedule:
            each.operation.check(simulation, each.board)
        for part in parts.features.values():
            part.switched_on(self)

    @property
    def bus_log(self) -> list[tuple[int, Frame]]:
        """Every frame that the bus has kept, with the instant, in counts, when it became valid."""
        return list(zip(self.bus.log_counts, self.bus.log_frames, strict=True))

    def mismatches(self) -> list[Microsteps]:
        """Return the axes whose driver, board and robot file do not agree on the microsteps per full step."""
        return [each for each in self.microsteps() if not each.agree]

    def parts_document(self) -> dict[str, Any]:
        """Return what the parts of features say has happened so far, under keys of report.json."""
        return {key: value for part in self.parts.features.values() for key, value in part.document().items()}

    def features_evidence(self) -> dict[str, Any]:
        """Let the parts of features look; return what they have seen since power-up, by name."""
        found = {name: part.evidence() for name, part in self.parts.features.items()}
        return {name: seen for name, seen in found.items() if seen is not None}

    def features_settled(self, last_counts: int) -> dict[str, Any]:
        """Return what the parts of features find some time after a run's last edge, by name."""
        found = {name: part.settled(last_counts) for name, part in self.parts.features.items()}
        return {name: seen for name, seen in found.items() if seen is not None}
