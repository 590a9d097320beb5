"""The board and the machine that most tests of the client use."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client import Machine
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from tests.host.client.machines import ROBOT, START, ready


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(ROBOT, fast_kernel, MachineOptions(stand_at=START))


@pytest.fixture
def machine(board: EmbeddedBoard) -> Machine:
    """A machine that is enabled and stands at 0 units on every axis."""
    return ready(board)
