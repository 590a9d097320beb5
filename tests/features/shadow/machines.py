"""A machine in virtual time that a session operates, and the shadow that hears its bus afterwards."""

import random
from collections.abc import Sequence
from math import inf

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.operations import Operation
from steptwin.features.replay.power_up import MachineAtPowerUp
from steptwin.features.shadow.discrepancy import Discrepancy
from steptwin.features.shadow.shadow import Shadow
from steptwin.host.client.axis import AxisClient
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.session import Session
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, Status
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_US

COUNTS_PER_S = 72_000_000
CLOCK_US = 1_764_000_000_000_000
"""What the computer's clock says at power-up, as in 2025."""
NEAR = [-128.0, -148.0, 1.0, -358.0]
"""Where the teaching robot stands 7 units or less from the switches by which its axes are homed."""
Heard = list[tuple[int, Frame]]
"""Frames with their stamps in microseconds by the computer's clock."""


class Real:
    """A board that stands for the real one."""

    def __init__(self, robot: Robot, kernel: Kernel, stand_at: Sequence[float] | None = None) -> None:
        self.board = EmbeddedBoard(robot, kernel, MachineOptions(stand_at=stand_at or list(robot.home)))
        self.session = Session(self.board, robot)
        self.rest_frames = 0
        """Number of frames on the bus up to an instant at which the machine rests."""

    def operate(self, operation: Operation) -> None:
        self.board.operate(operation)

    def go_relative(self, axis: AxisClient, distance_units: int, base: int = 1, longest_s: float = inf) -> None:
        """Move an enabled axis as a master of its own does; wait until its drive says that it has reached the target.

        `base` is what the distance counts from, bits 1 and 0 of 60F2h: 0 the last target, 1 the demand, 2 the position.
        """
        axis.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
        axis.write(od.POSITIONING_OPTION, base)
        axis.write(od.TARGET_POSITION, distance_units)
        axis.write(od.CONTROLWORD, 0x0F)
        axis.write(od.CONTROLWORD, 0x5F)
        until_s = self.board.now_s() + longest_s
        while self.board.now_s() < until_s and not axis.read(od.STATUSWORD) & Status.TARGET_REACHED:
            self.board.wait(0.01)

    def heard(self, *, jitter_us: int = 0, ppm: float = 0.0, seed: int = 0) -> Heard:
        """Return what a computer hears: stamps by a clock that is off by parts in a million, and late by up to some us.

        The stamps rise, as a driver's do.
        """
        draw = random.Random(seed)
        stamped, last_us = Heard(), 0
        for counts, frame in self.board.bus_log:
            us = CLOCK_US + round(counts / COUNTS_PER_US * (1 + ppm * 1e-6)) + draw.randint(0, jitter_us)
            last_us = max(us, last_us + 1)
            stamped.append((last_us, frame))
        return stamped


def homed(robot: Robot, kernel: Kernel, stand_at: Sequence[float]) -> Real:
    """Return a machine that has homed all its axes at once, and stays at its switches."""
    real = Real(robot, kernel, stand_at)
    home_robot(real.session, together=True, stay=True)
    return real


def shadowed(
    robot: Robot, heard: Heard, kernel: Kernel, stand_at: Sequence[float] | None = None
) -> tuple[list[Discrepancy], Shadow]:
    """Let a shadow hear the frames; return what it tells."""
    told: list[Discrepancy] = []
    shadow = Shadow(robot, MachineAtPowerUp(MachineOptions(stand_at=stand_at or list(robot.home))), told.append, kernel)
    for us, frame in heard:
        shadow.hear(us, frame)
    if heard:
        shadow.pass_time(heard[-1][0] + 200_000)
    return told, shadow
