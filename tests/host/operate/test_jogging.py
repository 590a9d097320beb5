"""Jogging a joint for a time, up to a limit, until Ctrl-C, and a joint or the tool while a condition lasts."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client import AxisClient, profile_motion, reports
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.operate.jogging import check_jog, jog, jog_tool, step_tool
from steptwin.host.operate.recovering import axis_states
from steptwin.host.operate.session import Session
from steptwin.host.planning.tool_by_hand import ToolStep
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode
from tests.host.client.machines import SX, TH1
from tests.host.complaints import complaint_of
from tests.host.operate.sessions import HALF_STEPS, HOME, ROBOT, CommandLine, board_at
from tests.messages import refusing

AT_REST = [0, -(1 << 31), (1 << 31) - 1]


def tool_of(joints: list[float]) -> FloatArray:
    return np.asarray(make_kinematics(ROBOT).forward(np.array([joints]))[0])


def left_by(axis: AxisClient) -> list[int]:
    """Return an axis' target velocity and position limits."""
    return [axis.read(address) for address in (od.TARGET_VELOCITY, od.POSITION_LIMIT_MIN, od.POSITION_LIMIT_MAX)]


@pytest.mark.parametrize("speed", [20.0, -20.0])
def test_it_stops_by_time(board: EmbeddedBoard, session: Session, speed: float) -> None:
    """Both ramps are the same, so the way is the speed times the time, except for the 10 ms between two polls."""
    jogged = jog(session, "th1", speed, 1.5)
    assert jogged.end - jogged.start == pytest.approx(1.5 * speed, abs=0.05 * 20)
    assert not jogged.at_limit
    standing = board.driver_positions()
    board.wait(1.0)
    assert board.driver_positions() == standing
    assert [state.state for state in axis_states(session)] == ["OPERATION ENABLED"] * 6


def test_the_end_of_travel_stops_it(board: EmbeddedBoard, session: Session) -> None:
    joint = ROBOT.joints[TH1]
    jogged = jog(session, "th1", -joint.speed_max, 1000.0)
    assert jogged.at_limit
    assert joint.lower - HALF_STEPS[TH1] <= jogged.end <= joint.lower + HALF_STEPS[TH1]
    assert board.now_s() < 100
    assert session.machine.axes[TH1].read(od.POSITION_LIMIT_MIN) == -(1 << 31)


def test_an_axis_of_unknown_position_has_no_limits(fast_kernel: Kernel) -> None:
    """The slide stands at 300 mm but counts from 0, its lower limit, and passes that limit."""
    session = Session(board_at([300.0, *HOME[1:]], fast_kernel), ROBOT)
    assert jog(session, "sx", -10.0, 2.0).end == pytest.approx(-20.0, abs=0.5)


def test_a_limit_switch_stops_it_with_a_fault(board: EmbeddedBoard) -> None:
    with refusing(DeviceFaultError):
        jog(Session(board, ROBOT), "sx", -10.0, 2.0)


def interrupted_after(looks: int, patch: pytest.MonkeyPatch) -> None:
    check = reports.check_enabled
    left = [looks]

    def check_or_interrupt(axes: Sequence[AxisClient]) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt
        check(axes)

    patch.setattr(profile_motion, "check_enabled", check_or_interrupt)


def test_ctrl_c_ends_a_jog_without_a_time(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupted_after(100, monkeypatch)
    jogged = jog(session, "th1", 20.0, None)
    assert jogged.end - jogged.start == pytest.approx(20.0, abs=1.5)
    assert [state.state for state in axis_states(session)] == ["OPERATION ENABLED"] * 6


def test_ctrl_c_before_the_time_is_over_stops_all_axes(
    steptwin: CommandLine, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted_after(100, monkeypatch)
    assert steptwin.run("jog warehouse-scara th1 20 --seconds 10")[:2] == (130, "")
    assert [state.state for state in axis_states(session)] == ["QUICK STOP ACTIVE"] * 6
    assert left_by(session.machine.axes[TH1]) == AT_REST


def after(looks: int) -> Callable[[], bool]:
    """Return a condition that holds from this look on."""
    left = [looks]

    def holds() -> bool:
        left[0] -= 1
        return left[0] <= 0

    return holds


def test_a_condition_ends_a_jog(board: EmbeddedBoard, session: Session) -> None:
    """It is looked at every 10 ms, and once before the start."""
    jogged = jog(session, "th1", 20.0, None, until=after(101))
    assert jogged.end - jogged.start == pytest.approx(20.0, abs=1.5)
    assert left_by(session.machine.axes[TH1]) == AT_REST
    before = board.driver_positions()
    stood = jog(session, "th1", 20.0, None, until=lambda: True)
    assert (stood.start, board.driver_positions()) == (stood.end, before)


@pytest.mark.slow
def test_a_jog_of_the_tool_ends_on_its_line(board: EmbeddedBoard, session: Session) -> None:
    """By a condition, which leaves nothing that could go on; and where the reach ends."""
    jogged = jog_tool(session, "y", -20.0, None, until=after(101))
    assert not jogged.at_end
    ways = tool_of(jogged.end)[:3] - tool_of(jogged.start)[:3]
    assert ways == pytest.approx([0.0, -20.0, 0.0], abs=4.0)
    assert ways[[0, 2]] == pytest.approx([0.0, 0.0], abs=0.1)
    standing = board.driver_positions()
    board.wait(0.5)
    assert board.driver_positions() == standing
    assert [state.state for state in axis_states(session)] == ["OPERATION ENABLED"] * 6
    assert jog_tool(session, "z", 20.0, None).at_end
    stood = jog_tool(session, "z", -20.0, None, until=lambda: True)
    assert stood.start == stood.end
    step_tool(session, ToolStep({"y": 1.0}, 20.0))


def test_taking_charge_begins_with_targets_at_rest(board: EmbeddedBoard, session: Session) -> None:
    """A program that was killed has left a target velocity and limits; where the axis stands, a limit holds it."""
    th1 = session.machine.axes[TH1]
    here = th1.read(od.POSITION_ACTUAL)
    for address, value in (
        (od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY),
        (od.POSITION_LIMIT_MAX, here),
        (od.TARGET_VELOCITY, 1_000_000),
    ):
        th1.write(address, value)
    board.wait(0.5)
    standing = board.driver_positions()
    with session.charge("nothing") as charge:
        charge.enable()
        assert left_by(th1) == AT_REST
        board.wait(0.5)
    assert board.driver_positions() == standing


def test_speeds_have_limits() -> None:
    joint = ROBOT.joints[SX]
    for speed in (joint.speed_max, -joint.speed_max):
        assert check_jog(ROBOT, "sx", speed) is joint
    for speed in (0.0, 0.000195, -0.000195, joint.speed_max * 1.001, -joint.speed_max * 1.001):
        with refusing(InputError):
            check_jog(ROBOT, "sx", speed)
    check_jog(ROBOT, "sx", -0.000195313)
    with refusing(InputError):
        check_jog(ROBOT, "sy", 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1])
def test_the_slowest_jog_moves(session: Session, sign: int) -> None:
    """16 units/s are a step of 1024 units in 65.5 s, as the firmware rounds them; 15 would be none at all."""
    slowest = sign * 16 / (ROBOT.joints[TH1].transmission.steps_per_unit * 1024)
    with refusing(InputError):
        jog(session, "th1", slowest * 15 / 16, 100.0)
    standing = session.machine.positions_units()[TH1]
    jogged = jog(session, "th1", slowest, 100.0)
    assert (jogged.end - jogged.start) * sign > 0
    assert session.machine.positions_units()[TH1] - standing == sign * 1024  # 1563 units: the second comes at 1600


def test_the_largest_speed_that_a_refusal_names_passes() -> None:
    """200/3 mm/s has no end in decimals."""
    odd = replace(ROBOT, joints=(replace(ROBOT.joints[SX], speed_max=200 / 3, homing=None), *ROBOT.joints[1:]))
    told = complaint_of(lambda: check_jog(odd, "sx", 66.6667))
    largest = float(told.rsplit(" to ", 1)[1].split(" ", 1)[0])
    assert largest == 66.6666
    check_jog(odd, "sx", -largest)


@pytest.mark.usefixtures("session")
def test_the_command(steptwin: CommandLine) -> None:
    document = steptwin.json("jog warehouse-scara th1 -20 --seconds 0.5")
    assert document["joint"] == "th1"
    assert document["start"] == pytest.approx(HOME[TH1], abs=1e-4)
    assert document["end"] < document["start"] - 8
