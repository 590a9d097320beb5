"""Jogging by a step: a number alone is a distance, joints keep their limits, the tool its line."""

from collections.abc import Callable

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client import HomingSettings
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.operate.jogging import check_step, check_step_speed, step_joint, step_tool
from steptwin.host.operate.moving import Moved, move
from steptwin.host.operate.recovering import axis_states
from steptwin.host.operate.session import Session
from steptwin.host.planning.tool_by_hand import ToolStep
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol.homing_methods import HOME_HERE
from tests.host.client.machines import SX, TH1
from tests.host.operate.sessions import HALF_STEPS, HOME, ROBOT, CommandLine, board_at, preset
from tests.host.operate.test_coupled_machine import HERE, machine, standing
from tests.host.operate.test_coupled_machine import STEP_DEG as COUPLED_STEP_DEG
from tests.host.robots.coupled import DIRECT, TWO_TO_ONE
from tests.messages import refusing

STEP_DEG = 1 / ROBOT.joints[TH1].transmission.steps_per_unit


def counted(board: EmbeddedBoard) -> list[float]:
    """Return the joints by the drivers' own counts."""
    return [float(each) for each in np.array(board.driver_positions()) / ROBOT.steps_per_unit]


def tool_of(joints: list[float]) -> list[float]:
    return [float(each) for each in make_kinematics(ROBOT).forward(np.array([joints]))[0]]


@pytest.mark.parametrize("distance", [1.0, -1.0, 30.0])
def test_a_joint_moves_by_the_distance_and_the_others_stay(
    board: EmbeddedBoard, session: Session, distance: float
) -> None:
    before = counted(board)
    moved = step_joint(session, "th1", distance)
    after = counted(board)
    assert after[TH1] - before[TH1] == pytest.approx(distance, abs=2 * HALF_STEPS[TH1])
    assert moved.goal[TH1] - moved.start[TH1] == pytest.approx(distance, abs=1e-9)
    assert [i for i in range(6) if after[i] != before[i]] == [TH1]
    assert [state.state for state in axis_states(session)] == ["OPERATION ENABLED"] * 6


def test_the_speed_is_a_part_of_the_joints(session: Session) -> None:
    slow, fast = (step_joint(session, "th1", 30.0, speed_percent=percent).planned_s for percent in (10.0, 100.0))
    assert slow > 30 / (0.1 * ROBOT.joints[TH1].speed_max) > fast


@pytest.mark.slow
def test_steps_end_at_the_limit_and_not_beyond(board: EmbeddedBoard, session: Session) -> None:
    upper = ROBOT.joints[TH1].upper
    move(session, [*HOME[:TH1], upper - 2.0, *HOME[TH1 + 1 :]])
    for _ in range(2):
        step_joint(session, "th1", 1.0)  # each rounded to wire units
    assert counted(board)[TH1] == pytest.approx(upper, abs=HALF_STEPS[TH1])
    stands = board.driver_positions()
    with refusing(InputError):
        step_joint(session, "th1", 1.0)
    assert board.driver_positions() == stands
    step_joint(session, "th1", -5.0)
    with refusing(InputError):
        step_joint(session, "th1", 5.0 + 0.6 * STEP_DEG)
    assert step_joint(session, "th1", 5.0 + 0.4 * STEP_DEG).goal[TH1] == upper


def test_a_joint_beyond_its_limit_comes_back_by_steps(board: EmbeddedBoard) -> None:
    """As after a homing that was interrupted: the axis stands at its switch."""
    session = preset(board, [-5.0, *HOME[1:]])
    with refusing(InputError):
        step_joint(session, "sx", -1.0)
    for goal in (-4.0, -3.0, 7.0):
        assert step_joint(session, "sx", goal - session.positions(session.demanded_units())[SX]).goal[SX] == (
            pytest.approx(goal, abs=1e-9)
        )


def test_a_joint_of_unknown_position_has_no_limits(fast_kernel: Kernel) -> None:
    """The slide stands at 300 mm but counts from 0, its lower limit, and passes that limit."""
    board = board_at([300.0, *HOME[1:]], fast_kernel)
    session = Session(board, ROBOT)
    assert step_joint(session, "sx", -10.0).end[SX] == pytest.approx(-10.0, abs=0.03)
    assert counted(board)[SX] == pytest.approx(290.0, abs=0.03)
    with refusing(DeviceFaultError):
        step_tool(session, ToolStep({"x": 1.0}, 20.0))


def test_steps_have_bounds() -> None:
    travel = ROBOT.joints[SX].upper - ROBOT.joints[SX].lower
    for distance in (travel, -travel):
        assert check_step(ROBOT, "sx", distance) is ROBOT.joints[SX]
    for distance in (0.0, 0.0000122, -0.0000122, travel * 1.001, -travel * 1.001):
        with refusing(InputError):
            check_step(ROBOT, "sx", distance)
    for percent in (1.0, 100.0):
        check_step_speed(percent)
    for percent in (0.99, 100.1, float("nan")):
        with refusing(InputError):
            check_step_speed(percent)


@pytest.mark.slow
def test_the_smallest_steps_add_up(session: Session) -> None:
    """1.22071e-05 mm are a wire unit, a 1024th of the slide's 16th of a full step; less would never move it."""
    standing = session.demanded_units()[SX]
    for count in (1, 2, 3):
        step_joint(session, "sx", 0.0000122071)
        assert session.demanded_units()[SX] == standing + count


@pytest.mark.slow
@pytest.mark.parametrize(("axis", "column"), [("x", 0), ("y", 1), ("z", 2), ("phi", 3)])
def test_the_tool_moves_along_one_axis(board: EmbeddedBoard, session: Session, axis: str, column: int) -> None:
    """On the drivers' counts, to within what half a step of each joint moves the tool; and back to the same units."""
    before, units = tool_of(counted(board)), session.demanded_units()
    step_tool(session, ToolStep({axis: 8.0}, 50.0))
    after = tool_of(counted(board))
    wanted = list(before)
    wanted[column] += 8.0
    assert after == pytest.approx(wanted, abs=0.15)
    step_tool(session, ToolStep({axis: -8.0}, 50.0))
    assert session.demanded_units() == pytest.approx(units, abs=16)


@pytest.mark.slow
def test_a_step_of_the_tool_that_is_refused_moves_nothing(board: EmbeddedBoard, session: Session) -> None:
    before = board.driver_positions()
    with refusing(InputError) as caught:
        step_tool(session, ToolStep({"x": 500.0}, 20.0))
    assert board.driver_positions() == before
    passing = float(str(caught.value).split()[-3])
    step_tool(session, ToolStep({"x": passing}, 100.0))
    with refusing(InputError):
        step_tool(session, ToolStep({"x": 0.1}, 100.0))


@pytest.mark.slow
def test_ctrl_c_stops_all_axes(board: EmbeddedBoard, session: Session) -> None:
    def interrupt(fraction: float) -> None:
        if fraction > 0.5:
            raise KeyboardInterrupt

    steps: list[Callable[[], Moved]] = [
        lambda: step_joint(session, "th1", 20.0, progress=interrupt),
        lambda: step_tool(session, ToolStep({"y": 30.0}, 20.0), progress=interrupt),
    ]
    for step in steps:
        with pytest.raises(KeyboardInterrupt):
            step()
        stands = board.driver_positions()
        board.wait(0.5)
        assert board.driver_positions() == stands
        assert [state.state for state in axis_states(session)] == ["QUICK STOP ACTIVE"] * 6


@pytest.mark.slow
@pytest.mark.parametrize("coupling", [DIRECT, TWO_TO_ONE])
def test_a_step_of_a_coupled_joint_leaves_the_other_joints(coupling: str, fast_kernel: Kernel) -> None:
    """Its motor and the elbow's, which stands on the base, move in proportion; the limits are the joint's."""
    board, session = machine(fast_kernel, coupling)
    step_joint(session, "th1", 10.0)
    there = [HERE[0] + 10.0, *HERE[1:]]
    assert standing(board) == pytest.approx(there, abs=3 * COUPLED_STEP_DEG)
    with refusing(InputError):
        step_joint(session, "th1", 101.0)
    before = make_kinematics(session.robot).forward(np.array([there]))[0]
    step_tool(session, ToolStep({"x": -8.0}, 50.0))
    after = make_kinematics(session.robot).forward(np.array([standing(board)]))[0]
    assert after - before == pytest.approx([-8.0, 0.0, 0.0, 0.0], abs=0.3)


def test_a_coupled_joint_is_known_only_with_all_its_axes(fast_kernel: Kernel) -> None:
    """The elbow's motor alone says only where the forearm points, so the joint has no limits yet."""
    board, session = machine(fast_kernel, known=False)
    here = HomingSettings(HOME_HERE, 1, 1, 1, session.units([0.0, 150.0, 0.0, 0.0])[1], 0)
    with session.charge("preset", needs=()) as charge:
        axes = charge.enable()
        axes.home_axes((None, here, None, None))
    step_joint(session, "th2", 5.0)
    assert standing(board) == pytest.approx([HERE[0], HERE[1] + 5.0, *HERE[2:]], abs=3 * COUPLED_STEP_DEG)


# --- the command


@pytest.mark.usefixtures("session")
@pytest.mark.parametrize("amount", ["+1", "1", "1deg", "+1.0deg"])
def test_a_number_alone_is_a_distance(steptwin: CommandLine, board: EmbeddedBoard, amount: str) -> None:
    document = steptwin.json(f"jog warehouse-scara th1 {amount}")
    assert list(document) == ["robot", "start", "goal", "end", "planned_s", "pose"]
    assert counted(board)[TH1] == pytest.approx(HOME[TH1] + 1, abs=HALF_STEPS[TH1])
    assert board.now_s() < 10


@pytest.mark.usefixtures("session")
@pytest.mark.parametrize("words", ["th1 -20 --seconds 0.5", "th1 -20deg/s --seconds 0.5", "th1 -20/s --seconds 0.5"])
def test_a_speed_has_a_time_or_its_unit(steptwin: CommandLine, words: str) -> None:
    document = steptwin.json(f"jog warehouse-scara {words}")
    assert document["joint"] == "th1"
    assert document["end"] - document["start"] == pytest.approx(-10.0, abs=1.0)


@pytest.mark.slow
@pytest.mark.usefixtures("session")
def test_the_tool_by_the_command(steptwin: CommandLine) -> None:
    before = steptwin.json("status warehouse-scara")["pose"]
    document = steptwin.json("jog warehouse-scara x -5 --speed 100")
    assert document["pose"] == pytest.approx(before | {"x_mm": before["x_mm"] - 5}, abs=0.15)
    exit_code, out, err = steptwin.run("jog warehouse-scara phi +5deg")
    assert (exit_code, err) == (0, "")
    assert "tool: x " in out


@pytest.mark.slow
@pytest.mark.usefixtures("session")
def test_the_tool_at_a_speed_by_the_command(steptwin: CommandLine) -> None:
    """At home the warehouse's tool points along the world's x, z is its own z: along y both frames differ by a turn."""
    before = steptwin.json("status warehouse-scara")["pose"]
    document = steptwin.json("jog warehouse-scara y -20mm/s --seconds 1")
    assert list(document) == ["robot", "coordinate", "start", "end", "at_end", "pose"]
    moved = {key: value - before[key] for key, value in document["pose"].items()}
    assert -20.0 < moved["y_mm"] < -14.0  # with a ramp up, and one down
    assert [moved["x_mm"], moved["z_mm"]] == pytest.approx([0.0, 0.0], abs=0.15)
    turned = steptwin.json("jog warehouse-scara phi 20 --seconds 1 --frame tool")
    assert 14.0 < turned["pose"]["attitude_deg"] - document["pose"]["attitude_deg"] < 20.5
    exit_code, out, err = steptwin.run("jog warehouse-scara z -60mm/s --seconds 60")
    assert (exit_code, err) == (0, "")
    assert ", at the end of its travel" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("th1", "a joint or x, y, z, phi, rx, ry, rz, and a distance or a speed are needed after the robot, not th1"),
        ("th9 1", "joint 'th9' is unknown: did you mean th3 or th2 or th1?"),
        ("th1 fast", "AMOUNT: 'fast' is not a number"),
        ("th1 5mm", "AMOUNT: 5mm is not in deg or deg/s"),
        ("sx 5deg/s", "AMOUNT: 5deg/s is not in mm or mm/s"),
        ("th1 0", "th1: a step of 0 deg is not from 2.19727e-05 to 240 deg, with a sign"),
        ("th1 20 --seconds 0", "--seconds 0: is not above 0 and finite"),
        ("th1 20deg --seconds 1", "--seconds 1: is for a speed, such as 20deg/s"),
        ("th1 20deg/s --speed 5", "--speed 5: is for a step; the speed of this jog is 20"),
        ("th1 999deg/s", "th1: a speed of 999 deg/s is not from 0.000351563 to 120 deg/s, with a sign"),
        ("th1 1 --speed 0.5", "--speed 0.5: is 0.5 % of the speed; for 0.5 of it write --speed 50; the least is 1"),
        ("th1 1 --speed 0", "--speed 0: is not from 1 to 100 percent"),
        ("x 251mm/s", "x: a speed of 251 mm/s is not above 0 and up to 250 mm/s, with a sign"),
        ("phi -91 --seconds 1", "phi: a speed of -91 deg/s is not above 0 and up to 90 deg/s, with a sign"),
        ("x 5mm/s --speed 5", "--speed 5: is for a step; the speed of this jog is 5"),
        ("rx 5deg/s", "joint 'rx' is unknown: did you mean x?"),
        ("x 5 --frame base", "--frame base: there are world, tool"),
        ("th1 5 --frame tool", "--frame tool: is for the tool; th1 is a joint"),
        ("x 0", "a step of 0 moves nothing: x +0 mm"),
        ("phi 400", "phi +400 deg: a step turns the tool by at most 360 deg"),
    ],
)
def test_bad_input_is_refused_before_anything_is_sent(
    steptwin: CommandLine, board: EmbeddedBoard, words: str, message: str
) -> None:
    sent = len(board.bus_log)
    assert steptwin.run(f"jog warehouse-scara {words}") == (2, "", f"steptwin: {message}\n")
    assert len(board.bus_log) == sent
