"""The emulated machine of a replay: boards in virtual time whose hosts speak from a recording."""

from steptwin.controller.backend import Kernel
from steptwin.emulator.bus import Bus
from steptwin.emulator.operations import Scheduled
from steptwin.emulator.simulation import Simulation
from steptwin.host.record.folder import REPLAY_JOB
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.board_config import board_configs
from steptwin.host.twin.boards import make_boards
from steptwin.host.twin.drivers import driver_profile
from steptwin.host.twin.operation_log import OperationLog
from steptwin.host.twin.places import Places
from steptwin.host.twin.replay.power_up import PowerUp
from steptwin.host.twin.shelf import shelf_wiring
from steptwin.host.twin.standing import standing_steps
from steptwin.host.twin.unplanned_run import UnplannedRun


class ReplayedMachine:
    """A robot's boards on a bus of their own, as they stood at power-up; what was done to them beside it is scheduled.

    Attributes:
        simulation: boards and bus; its host's interface is free.
        run: everything that the machine does.
    """

    def __init__(self, robot: Robot, power_up: PowerUp, kernel: Kernel) -> None:
        """Switch the boards on; raise InputError if the drivers or a place of the shelf do not exist."""
        joints, per_board = list(power_up.joints), power_up.axes_per_board
        configs = board_configs(
            robot, joints, per_board, power_up.driver_profile, power_up.dip_microsteps, power_up.crystals_ppm
        )
        shelf = shelf_wiring(
            robot,
            joints,
            per_board,
            stock=power_up.stock,
            locked=power_up.locked_drawers,
            sensors=power_up.shelf_sensors,
        )
        boards = make_boards(robot, configs, kernel, commissioned=power_up.commissioned)
        places = Places(per_board)
        schedule = [
            Scheduled(counts, each, number)
            for counts, operation in power_up.operations
            for number, each in places.on_boards(operation)
        ]
        self.simulation = Simulation(boards, Bus(power_up.bitrate), schedule, shelf)
        self.run = UnplannedRun(
            robot,
            self.simulation,
            standing_steps(robot, joints),
            job=REPLAY_JOB,
            driver_profile=driver_profile(robot.board, power_up.driver_profile).name,
            commissioned=power_up.commissioned,
            stock={} if shelf is None else shelf.shelf.stock,
            operations=OperationLog(robot, self.simulation),
        )
