"""Assemble an emulated machine: boards with drivers, and the parts of features."""

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
from steptwin.host.twin.machine.boards import board_configs, make_boards, steps_at_joints
from steptwin.host.twin.machine.drivers import driver_profile
from steptwin.host.twin.machine.input_changes import request_of
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.host.twin.machine.robot_boards import RobotBoards
from steptwin.protocol.drivers import DriverProfile
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND


@dataclass(frozen=True, slots=True)
class MachineParts:
    """Parts of an emulated machine at power-up.

    Attributes:
        robot: the machine.
        options: differences from the robot's file.
        driver_profile: the drivers.
        start_steps: motor positions, in steps of the robot's file from their axes' zeros.
        commissioned: True for boards with the robot's settings in flash, False for new ones.
        boards: the boards, without power.
        features: parts of features, by name.
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
        """Create the parts.

        Args:
            robot: the machine.
            kernel: form of the firmware's kernel.
            options: differences from the robot's file.
            commissioned: True for boards with the robot's settings in flash, False for new ones.
            waits_for: inputs for which the motion waits; None: unknown.

        Raises:
            InputError: a joint or the drivers do not exist, or lack a setting or switches; a feature's options do not
                fit; the boards' axes do not match the robot's; a crystal is too far off; an EDS is unreadable, or its
                node's id is taken.
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
            steps_at_joints(robot, joints),
            commissioned,
            make_boards(robot, configs, kernel, commissioned=commissioned, program=options.program()),
            parts,
        )


class OperationLog:
    """Operations on a machine from now on, or the last ones, as requests of the control port."""

    def __init__(self, machine: RobotBoards, most: int | None = None) -> None:
        """Start; `most` is the number of operations that are kept, None for all."""
        self._machine = machine
        self._done: deque[tuple[int, Operation]] = deque(maxlen=most)
        """Operations and their instants in counts; axes are numbered over all boards."""
        machine.simulation.on_operation = self._operated

    def _operated(self, scheduled: Scheduled) -> None:
        operation = self._machine.places.on_machine(scheduled.board, scheduled.operation)
        if operation is not None:
            self._done.append((scheduled.counts, operation))

    def requests(self) -> list[dict[str, Any]]:
        """Return the operations under the keys of docs/live.md, with `at_s` in seconds since power-up."""
        robot = self._machine.robot
        return [{"at_s": counts / COUNTS_PER_SECOND} | request_of(robot, each) for counts, each in self._done]


class EmulatedMachine(RobotBoards):
    """A robot's machine on a bus from power-up on: the base of embedded, live and replayed boards.

    Attributes:
        parts: its parts.
        bus: bus of its boards.
        operations: operations on it.
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
            parts: parts of the machine.
            schedule: operations on it, each with its instant.
            log: called with each frame on the bus and its instant; by default the bus keeps them.
            operations_max: number of operations that are kept; None for all.

        Raises:
            InputError: the machine lacks the target of an operation or of a feature's part.
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
        """Every frame that the bus has kept, with the instant when it became valid, in counts."""
        return list(zip(self.bus.log_counts, self.bus.log_frames, strict=True))

    def mismatches(self) -> list[Microsteps]:
        """Return the axes with different microsteps per full step in driver, board and robot file."""
        return [each for each in self.microsteps() if not each.agree]

    def parts_document(self) -> dict[str, Any]:
        """Return the evidence of features so far, under keys of report.json."""
        return {key: value for part in self.parts.features.values() for key, value in part.document().items()}

    def features_evidence(self) -> dict[str, Any]:
        """Update the parts of features; return their evidence since power-up, by name."""
        found = {name: part.evidence() for name, part in self.parts.features.items()}
        return {name: seen for name, seen in found.items() if seen is not None}

    def features_settled(self, last_counts: int) -> dict[str, Any]:
        """Return the evidence of features some time after a run's last edge, by name."""
        found = {name: part.settled(last_counts) for name, part in self.parts.features.items()}
        return {name: seen for name, seen in found.items() if seen is not None}
