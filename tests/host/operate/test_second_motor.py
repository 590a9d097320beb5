"""Operating a gantry whose beam has a motor at each end: squared by homing, both always together."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.jogging import jog
from steptwin.host.operate.moving import move
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.robots import parse_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.machine.boards import board_configs
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput
from tests.host.robots.gantries import SECOND, SKEW_MAX_MM, STEPS_PER_MM, UNITS_PER_MM, gantry_text
from tests.messages import refusing
from tests.operations import DriverProtect, Slip, StuckSwitch

Y, Y2 = 1, 2
STEP_MM = 1 / STEPS_PER_MM


def machine(
    kernel: Kernel, second: str = SECOND, *, known: bool = True, driver: str = "a4988"
) -> tuple[BoardUnderTest, Session]:
    """Return a gantry that stands at X 5 mm and Y 10 mm, and a session with it."""
    robot, here = (
        parse_robot(gantry_text(second).replace("a4988", driver).replace("_ns = 500", "_ns = 700"), "gantry.toml"),
        [5.0, 10.0],
    )
    board = BoardUnderTest(robot, stand_at=here, kernel=kernel)
    session = Session(board, robot)
    if known:
        with session.charge("preset", needs=()) as charge:
            charge.enable().preset(session.units(here))
    return board, session


def motors_mm(board: BoardUnderTest) -> list[float]:
    """Return where both motors really have their ends of Y."""
    return [steps / STEPS_PER_MM for steps in board.motor_positions()[1:]]


def slip(board: BoardUnderTest, axis: int, full_steps: int) -> None:
    board.operate(Slip(axis, full_steps))
    board.wait(0.01)


@pytest.mark.slow
@pytest.mark.parametrize("full_steps", [8, -8])
def test_homing_squares_a_crooked_beam(full_steps: int, fast_kernel: Kernel) -> None:
    """8 full steps are 1.6 mm; both motors end a step beyond their own switch, and the beam is square to a step."""
    board, session = machine(fast_kernel)
    slip(board, Y2, full_steps)
    before = motors_mm(board)
    assert before[1] - before[0] == pytest.approx(full_steps * 0.2)
    home_robot(session, joints=["Y"], stay=True)
    first, second = motors_mm(board)
    assert second - first == pytest.approx(0.0, abs=STEP_MM + 1e-9)
    told = [axis.position for axis in read_status(session).axes]
    assert told[1:] == pytest.approx([first, second], abs=STEP_MM + 1e-9)


@pytest.mark.slow
def test_a_switch_that_closes_elsewhere_is_told_by_the_offset(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel, f"{SECOND}square_offset = 0.5\n")
    home_robot(session, joints=["Y"], stay=True)
    assert read_status(session).skews == pytest.approx({"Y2": 0.5}, abs=STEP_MM)
    move(session, [None, 50.0])
    assert motors_mm(board) == pytest.approx([50.0, 50.0], abs=STEP_MM)
    assert read_status(session).skews == pytest.approx({"Y2": 0.0}, abs=STEP_MM)


@pytest.mark.slow
def test_both_motors_set_off_in_one_tick(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel)
    home_robot(session, joints=["Y"], stay=True)
    first, second = (board.pins(name).step_counts for name in ("Y", "Y2"))
    assert first[0] == second[0]
    assert (first == second).all()


@pytest.mark.slow
@pytest.mark.parametrize(("skew_max", "holds"), [(1.55, False), (2.6, True)])
def test_a_beam_more_crooked_than_allowed_is_not_homed(skew_max: float, holds: bool, fast_kernel: Kernel) -> None:
    """1.6 mm, and the millimetre in which the first motor brakes behind its switch: both sides of the limit."""
    board, session = machine(fast_kernel, SECOND.replace("3.0", str(skew_max)))
    slip(board, Y2, 8)
    if holds:
        home_robot(session, joints=["Y"], stay=True)
        return
    with refusing(DeviceFaultError):
        home_robot(session, joints=["Y"], stay=True)


def test_a_switch_that_never_closes_does_not_rack_the_beam(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel)
    board.operate(StuckSwitch(Y2, DigitalInput.NEGATIVE_LIMIT, closed=False))
    with refusing(DeviceFaultError):
        home_robot(session, joints=["Y"], stay=True)
    first, second = motors_mm(board)
    braking_mm = 20.0**2 / (2 * 200.0)
    assert SKEW_MAX_MM < abs(second - first) < SKEW_MAX_MM + braking_mm + 20.0 * 0.05
    assert all(axis.state().value is not None for axis in session.machine.axes)
    board.wait(1.0)
    assert motors_mm(board) == [first, second]


def test_moves_and_jogs_take_both_motors(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel)
    assert move(session, [None, 60.0]).end == pytest.approx([5.0, 60.0], abs=STEP_MM)
    assert motors_mm(board) == pytest.approx([60.0, 60.0], abs=STEP_MM)
    jogged = jog(session, "Y", -20.0, 1.0)
    assert motors_mm(board) == pytest.approx([jogged.end] * 2, abs=2 * STEP_MM)
    assert jog(session, "Y", -50.0, 5.0).at_limit
    assert motors_mm(board) == pytest.approx([0.0, 0.0], abs=STEP_MM)


def test_a_move_takes_no_longer_for_two_motors(fast_kernel: Kernel) -> None:
    """50 mm at 100 mm/s and 500 mm/s^2: 50/100 + 100/500 s."""
    _, session = machine(fast_kernel)
    assert move(session, [None, 60.0]).planned_s == pytest.approx(0.7, abs=0.002)


def preset_apart(session: Session, apart_mm: float) -> None:
    """Let the second motor say that it stands ahead of the first one."""
    with session.charge("preset", needs=()) as charge:
        units = session.units([5.0, 10.0])
        charge.enable().preset([*units[:2], units[2] + round(apart_mm * UNITS_PER_MM)])


@pytest.mark.slow
@pytest.mark.parametrize(("apart_mm", "moves"), [(2.99, True), (3.01, False), (-3.01, False)])
def test_counts_that_are_too_far_apart_hold_the_machine(apart_mm: float, moves: bool, fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel)
    preset_apart(session, apart_mm)
    if moves:
        moved = move(session, [None, 10.0])
        counted = read_status(session)
        assert counted.skews == pytest.approx({"Y2": 0.0}, abs=STEP_MM)
        assert moved.planned_s == pytest.approx(2 * (apart_mm / 500) ** 0.5, abs=0.003)
        return
    with refusing(DeviceFaultError):
        move(session, [None, 20.0])
    move(session, [20.0, None])
    jog(session, "Y", 10.0, 0.2)
    home_robot(session, joints=["Y"])
    assert motors_mm(board) == pytest.approx([150.0, 150.0], abs=2 * STEP_MM)


def test_a_fault_of_one_motor_stops_both(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel, driver="drv8825")  # an A4988 tells of no fault
    with session.charge("jog", needs=()) as charge:
        charge.enable()

    begun = board.now_s()

    def break_it() -> bool:
        if board.now_s() > begun + 0.5:
            board.operate(DriverProtect(Y2, active=True))
        return False

    with pytest.raises(DeviceFaultError):
        jog(session, "Y", 20.0, 3.0, until=break_it)
    board.wait(0.5)
    standing = motors_mm(board)
    board.wait(0.5)
    assert motors_mm(board) == standing
    assert abs(standing[1] - standing[0]) < 20.0**2 / (2 * 500.0) + 20.0 * 0.031


def test_a_limit_switch_of_one_motor_stops_both(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel)
    slip(board, Y2, -40)
    with refusing(DeviceFaultError):
        jog(session, "Y", -20.0, 3.0)
    standing = motors_mm(board)
    board.wait(0.5)
    assert motors_mm(board) == standing
    assert standing[0] - standing[1] == pytest.approx(40 * 0.2, abs=20.0 * 0.031)


def test_both_motors_are_on_one_board() -> None:
    robot = parse_robot(gantry_text(SECOND), "gantry.toml")
    with refusing(InputError):
        board_configs(robot, MachineOptions(axes_per_board=(2, 1)))
    assert len(board_configs(robot, MachineOptions(axes_per_board=(1, 2)))) == 2


@pytest.mark.slow
def test_positions_are_known_if_both_motors_are(fast_kernel: Kernel) -> None:
    _, session = machine(fast_kernel, known=False)
    assert [axis.position_known for axis in read_status(session).axes] == [False] * 3
    home_robot(session, joints=["Y"], stay=True)
    assert [axis.position_known for axis in read_status(session).axes] == [False, True, True]
    session.machine.axes[Y2].write(od.CONTROLWORD, 0)
    assert np.isfinite(read_status(session).axes[Y].position)
