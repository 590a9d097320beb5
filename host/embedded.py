"""The default board: emulated in this process, in virtual time, with the client's network wired straight to it."""

from collections.abc import Callable

import canopen

from controller.backend import Kernel
from emulator.board import AxisTrace, Board, BoardConfig
from emulator.bus import Bus
from emulator.simulation import Simulation
from host.robot import Robot
from host.verify.evidence import AxisEvidence, Evidence
from protocol.frame import COB_SYNC, Frame
