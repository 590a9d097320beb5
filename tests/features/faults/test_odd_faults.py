"""Faults of the bus on a board under test: each works, or a sentence says what is wrong with it."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.bus import Babble, BusRepair, FrameLoss
from steptwin.features.faults.kinds.host import HostFault, HostFaultKind
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.frame import Frame


@pytest.fixture
def board(fast_kernel: Kernel) -> BoardUnderTest:
    return BoardUnderTest(load_robot("turntable"), kernel=fast_kernel)


def test_a_fault_of_the_bus_can_be_let_begin_and_end(board: BoardUnderTest) -> None:
    """The request for the statusword is lost until the repair."""
    frames: list[int] = []
    board.network.subscribe(0x590, lambda *_: frames.append(1))
    request = bytes.fromhex("4041600000000000")
    board.operate(FrameLoss())
    board.network.send_message(0x610, request)
    assert frames == []
    board.operate(BusRepair())
    board.network.send_message(0x610, request)
    assert frames == [1]


def test_a_fault_of_the_host_is_refused_by_a_sentence(board: BoardUnderTest) -> None:
    with pytest.raises(InputError, match="is for scenarios"):
        board.operate(HostFault(HostFaultKind.DEATH))


@pytest.mark.slow
def test_a_bus_that_a_rogue_node_fills_says_so(board: BoardUnderTest) -> None:
    board.operate(Babble(Frame(0x001, bytes(8)), 47, 1_000_000))
    with pytest.raises(BusError, match=r"a rogue node's frames 0x001 fill the bus"):
        board.network.send_message(0x610, bytes.fromhex("4041600000000000"))
