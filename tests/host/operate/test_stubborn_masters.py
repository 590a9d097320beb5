"""Stops against another master that repeats "enable operation", by process data, every millisecond."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.errors import DeviceFaultError
from steptwin.host.operate.recovering import emergency_stop, stop
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode
from steptwin.protocol.od import UNITS_PER_FULL_STEP
from tests.host.client.machines import Neighbour
from tests.host.client.other_masters import node402

ROBOT = load_robot("turntable")
NODE = 0x10
SPEED = 200 * UNITS_PER_FULL_STEP
MODES = {"velocity": Mode.PROFILE_VELOCITY, "cyclic velocity": Mode.CYCLIC_SYNCHRONOUS_VELOCITY}


class StubbornMaster:
    """Turns the axis, and repeats controlword, mode and target velocity whatever the statusword says."""

    def __init__(self, board: EmbeddedBoard, mode: Mode, quick_stop_option: int = 2) -> None:
        self.board = board
        self.mode = mode
        self.node = node402(board.network, NODE)
        for address, value in (
            (0x1401_01, 0x8000_0310),  # RPDO2: the target velocity, with SYNC
            (0x1601_00, 0),
            (0x1601_01, 0x60FF_0020),
            (0x1601_00, 1),
            (0x1401_01, 0x310),
            (od.INTERPOLATION_PERIOD, 1),
            (od.QUICK_STOP_OPTION, quick_stop_option),
        ):
            self.node.write(address, value)
        board.network.send_message(0x000, bytes((1, NODE)))
        for controlword in (0x06, 0x07, 0x0F):
            self.send(controlword)
        self.wait(0.1)
        assert self.node.read(od.VELOCITY_ACTUAL) == pytest.approx(SPEED, rel=1e-3)

    def send(self, controlword: int) -> None:
        self.board.network.send_message(0x200 + NODE, controlword.to_bytes(2, "little") + bytes((self.mode,)))

    def wait(self, dt_s: float) -> None:
        """Let time pass, in which this master goes on."""
        for _ in range(max(1, round(1000 * dt_s))):
            self.send(0x0F)
            self.board.network.send_message(0x300 + NODE, SPEED.to_bytes(4, "little", signed=True))
            self.board.network.send_message(0x080, b"")
            self.board.wait(0.001)


@pytest.fixture
def board(fast_kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(ROBOT, fast_kernel, MachineOptions())


@pytest.mark.parametrize("mode", MODES.values(), ids=MODES)
@pytest.mark.parametrize("option", [1, 2])
def test_a_stop_switches_off_whatever_the_master_says(
    board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch, mode: Mode, option: int
) -> None:
    """By the default options of a drive, and by a slower ramp: at rest the drive is off, and stays off."""
    master = StubbornMaster(board, mode, option)
    began_s = board.now_s()
    (axis,) = stop(Session(Neighbour(board, monkeypatch, master.wait), ROBOT))
    assert axis.state == "SWITCH ON DISABLED"
    assert board.now_s() - began_s < 1.0
    stood = board.driver_positions()
    master.wait(0.2)
    assert board.driver_positions() == stood
    assert master.node.read(od.STATUSWORD) & 0x4F == 0x40


def test_a_drive_that_holds_after_a_stop_obeys_the_master_again(
    board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Transition 16: the stop says at once that the axis does not stay stopped; the emergency stop holds it."""
    master = StubbornMaster(board, Mode.PROFILE_VELOCITY, quick_stop_option=6)
    session = Session(Neighbour(board, monkeypatch, master.wait), ROBOT)
    began_s = board.now_s()
    with pytest.raises(DeviceFaultError, match=r"^table: another program enables the drive again .*`steptwin estop`"):
        stop(session)
    assert board.now_s() - began_s < 1.0
    assert [axis.state for axis in emergency_stop(session)] == ["FAULT"]
    master.wait(0.2)
    assert master.node.read(od.STATUSWORD) & 0x4F == 0x08
