"""The emulated machine of a replay: boards in virtual time whose hosts speak from a recording."""

from steptwin.controller.backend import Kernel
from steptwin.emulator.bus import Bus
from steptwin.emulator.operations import Scheduled
from steptwin.host.record.folder import REPLAY_JOB
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine_options import MachineOptions
from steptwin.host.twin.machine_parts import MachineParts
from steptwin.host.twin.operation_log import OperationLog
from steptwin.host.twin.places import Places
from steptwin.host.twin.replay.power_up import PowerUp
from steptwin.host.twin.unplanned_run import UnplannedRun


class ReplayedMachine:
    """A robot's boards on a bus of their own, as they stood at power-up; what was done to them beside it is scheduled.

    Attributes:
        simulation: boards and bus; its host's interface is free.
        run: everything that the machine does.
    """

    def __init__(self, robot: Robot, power_up: PowerUp, kernel: Kernel) -> None:
        """Switch the boards on; raise InputError if the drivers or a place of the shelf do not exist."""
        options = MachineOptions(
            driver_profile=power_up.driver_profile,
            dip_microsteps=power_up.dip_microsteps,
            stock=power_up.stock,
            locked_drawers=power_up.locked_drawers,
            axes_per_board=power_up.axes_per_board,
            crystal_ppm=power_up.crystals_ppm,
        )
        parts = MachineParts.of(
            robot,
            list(power_up.joints),
            kernel,
            options,
            commissioned=power_up.commissioned,
            shelf_sensors=power_up.shelf_sensors,
        )
        places = Places(power_up.axes_per_board)
        schedule = [
            Scheduled(counts, each, number)
            for counts, operation in power_up.operations
            for number, each in places.on_boards(operation)
        ]
        self.simulation = parts.simulation(Bus(power_up.bitrate), schedule)
        self.run = UnplannedRun(parts, self.simulation, OperationLog(robot, self.simulation), REPLAY_JOB)
