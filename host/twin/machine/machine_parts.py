"""Put an emulated machine together: its boards with their drivers, the shelf beside it, the motors at the drivers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.faults.schedule import Scheduled
from steptwin.emulator.motors.rotor_watch import REST_TICKS, MotorWiring
from steptwin.emulator.simulation import Simulation
from steptwin.emulator.world.shelf_watch import ShelfWiring
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.board_config import board_configs
from steptwin.host.twin.machine.boards import make_boards, standing_steps
from steptwin.host.twin.machine.drivers import driver_profile
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.host.twin.machine.shelf import shelf_wiring
from steptwin.host.twin.motors.in_loop import motor_wiring
from steptwin.protocol.drivers import DriverProfile


@dataclass(frozen=True, slots=True)
class MachineParts:
    """The parts of an emulated machine, as they are at power-up.

    Attributes:
        robot: the machine.
        driver_profile: the drivers.
        start_steps: where the motors stand, in steps of the robot's file from their axes' zeros.
        commissioned: True for boards whose flash holds the robot's settings, False for new ones.
        boards: the boards, without power.
        shelf: the shelf; None if there is none.
        stock: the boxes in the shelf, by slot or spot.
        motors: the motors that turn with the boards; None if they do not.
    """

    robot: Robot
    driver_profile: DriverProfile
    start_steps: Sequence[int]
    commissioned: bool
    boards: Sequence[Board]
    shelf: ShelfWiring | None
    stock: Mapping[str, str]
    motors: MotorWiring | None

    @classmethod
    def of(
        cls,
        robot: Robot,
        kernel: Kernel,
        options: MachineOptions,
        *,
        commissioned: bool = True,
        shelf_sensors: bool = True,
        stretch_ticks: int = REST_TICKS,
    ) -> "MachineParts":
        """Make the parts.

        Args:
            robot: the machine.
            kernel: form of the firmware's kernel.
            options: how it differs from the robot's file.
            commissioned: True for boards whose flash holds the robot's settings, False for new ones.
            shelf_sensors: False if the shelf's sensors are not connected.
            stretch_ticks: greatest number of servo ticks that the rotors turn at once while an axis moves.

        Raises:
            InputError: a joint or the drivers do not exist, or cannot be set as the robot needs them, or have no such
                switches, or the shelf has no such place, or the robot's file does not describe its motors and masses,
                or the boards have not as many axes as the robot, or a crystal is too far off or motors turn with it.
        """
        joints, per_board, profile = options.joints(robot), options.boards_of(robot), options.driver_profile
        drivers = driver_profile(robot.board, profile)
        configs = board_configs(robot, joints, per_board, profile, options.dip_microsteps, options.crystals_ppm)
        shelf = shelf_wiring(
            robot, joints, per_board, stock=options.stock, locked=options.locked_drawers, sensors=shelf_sensors
        )
        return cls(
            robot,
            drivers,
            standing_steps(robot, joints),
            commissioned,
            make_boards(robot, configs, kernel, commissioned=commissioned),
            shelf,
            {} if shelf is None else dict(shelf.shelf.stock),
            motor_wiring(robot, drivers.chip, joints, per_board, stretch_ticks) if options.motors else None,
        )

    def simulation(self, bus: Bus, schedule: Iterable[Scheduled] = ()) -> Simulation:
        """Switch the boards on, on a bus; operations on their machines may be scheduled."""
        return Simulation(self.boards, bus, schedule, self.shelf, self.motors)
