"""Homing joints that both motors move: each joint is found by all of them, which see its switch in the same tick."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.errors import DeviceFaultError
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.moving import move
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.robots.reader import parse_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, State
from tests.host.robots.gantries import COREXY, STEPS_PER_MM, SWITCH_MM, belts_text
from tests.messages import refusing
from tests.operations import DriverProtect, StuckSwitch

STEP_MM = 1 / STEPS_PER_MM
"""Way of a joint when both motors make a step."""
HALF_BELT = "\n[coupling]\nX = { X = 1.0, Y = 0.5 }\nY = { X = -0.75, Y = 1.0 }\n"
"""Belts of unequal ratios."""


def machine(
    kernel: Kernel, here: list[float], coupling: str = COREXY, driver: str = "a4988"
) -> tuple[BoardUnderTest, Session]:
    robot = parse_robot(belts_text(coupling).replace("a4988", driver).replace("_ns = 500", "_ns = 700"), "belts.toml")
    board = BoardUnderTest(robot, stand_at=here, kernel=kernel)
    return board, Session(board, robot)


def standing(board: BoardUnderTest) -> list[float]:
    return list(board.joints().values())


def known(session: Session) -> list[bool]:
    return [axis.position_known for axis in read_status(session).axes]


@pytest.mark.slow
@given(x_mm=st.floats(SWITCH_MM - 1, 15.0), y_mm=st.floats(SWITCH_MM - 1, 15.0))
@settings(max_examples=12, deadline=None)
def test_both_joints_are_found_to_a_step_from_anywhere(fast_kernel: Kernel, x_mm: float, y_mm: float) -> None:
    """The promise: positions are right to a step, of the way that a joint goes when both motors make one."""
    board, session = machine(fast_kernel, [x_mm, y_mm])
    home_robot(session, stay=True)
    told = [axis.position for axis in read_status(session).axes]
    assert told == pytest.approx(standing(board), abs=STEP_MM)
    assert told == pytest.approx([SWITCH_MM] * 2, abs=0.1)
    assert known(session) == [True, True]


@pytest.mark.slow
def test_unequal_belts(fast_kernel: Kernel) -> None:
    """An axis step is less of a joint's way here, and what X misses at Y comes on top."""
    board, session = machine(fast_kernel, [6.3, 9.1], HALF_BELT)
    home_robot(session, stay=True)
    told = [axis.position for axis in read_status(session).axes]
    assert told == pytest.approx(standing(board), abs=2 * STEP_MM)


def test_the_other_joint_stands_still(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel, [5.0, 10.0])
    with refusing(DeviceFaultError):
        home_robot(session, joints=["X"], stay=True)
    with session.charge("preset", needs=()) as charge:
        charge.enable().preset(session.units([5.0, 10.0]))
    home_robot(session, joints=["X"], stay=True)
    assert standing(board)[1] == pytest.approx(10.0, abs=STEP_MM)
    first, second = (board.pins(name) for name in ("X", "Y"))
    assert first.step_counts[0] == second.step_counts[0]
    t_counts = np.linspace(first.step_counts[0], first.step_counts[-1], 500)
    ways = [
        np.concatenate([[0], np.cumsum(pins.step_signs)])[np.searchsorted(pins.step_counts, t_counts)]
        for pins in (first, second)
    ]
    assert np.abs(ways[0] + ways[1]).max() <= 2, "in proportion all the way: X = (A - B) / 2, Y = (A + B) / 2"
    assert known(session) == [True, True]


@pytest.mark.slow
def test_the_objects_hold_for_one_homing(fast_kernel: Kernel) -> None:
    _, session = machine(fast_kernel, [5.0, 10.0])
    home_robot(session)
    for axis in session.machine.axes:
        assert [axis.read(each) for each in (od.HOMING_SWITCH_NODE, od.HOMING_REVERSED, od.HOMING_PARTIAL)] == [0] * 3


def after_s(session: Session, board: BoardUnderTest, ready: Callable[[], bool], act: Callable[[], None]) -> None:
    """Act half a second after something is ready, while the session waits."""
    waited, begun = session.link.wait, list[float]()

    def wait(dt_s: float) -> None:
        begun.extend([board.now_s()] if ready() else [])
        if begun and board.now_s() > begun[0] + 0.5:
            act()
        waited(dt_s)

    session.link.wait = wait  # type: ignore[method-assign]


@pytest.mark.slow
def test_no_joint_is_known_before_the_last_is_found(fast_kernel: Kernel) -> None:
    """Y's search fails: then X is not known either, though its switch was found."""
    board, session = machine(fast_kernel, [5.0, 200.0])
    parts: list[float] = []
    wrong = StuckSwitch(1, DigitalInput.POSITIVE_LIMIT, closed=True)
    after_s(session, board, lambda: max(parts, default=0.0) >= 0.5, lambda: board.operate(wrong))
    with refusing(DeviceFaultError):
        home_robot(session, stay=True, progress=parts.append)
    assert known(session) == [False, False]
    with refusing(DeviceFaultError):
        move(session, [20.0, None])


def test_a_fault_of_one_motor_stops_both_in_the_firmware(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel, [200.0, 150.0], driver="drv8825")  # an A4988 tells of no fault
    after_s(session, board, lambda: True, lambda: board.operate(DriverProtect(1, active=True)))
    with pytest.raises(DeviceFaultError):
        home_robot(session, stay=True)
    board.wait(0.5)
    assert [axis.state() for axis in session.machine.axes] == [State.FAULT] * 2
    codes = [axis.error_codes for axis in session.machine.axes]
    assert codes[0]
    before = standing(board)
    board.wait(0.5)
    assert standing(board) == before


@pytest.mark.parametrize("node_id", [0x0F, 0x12, 0xFF])
def test_a_switch_of_another_board_is_refused(node_id: int, fast_kernel: Kernel) -> None:
    _, session = machine(fast_kernel, [5.0, 10.0])
    axis = session.machine.axes[0]
    axis.write(od.HOMING_SWITCH_NODE, 0x11)
    with refusing(DeviceFaultError):
        axis.write(od.HOMING_SWITCH_NODE, node_id)
