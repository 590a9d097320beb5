"""Operating a machine whose elbow motor sits on the base: moving, jogging, homing and status in joint positions."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client import HomingSettings
from steptwin.host.common.errors import DeviceFaultError, InputError
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.jogging import check_jog, jog, step_joint
from steptwin.host.operate.moving import move, move_within
from steptwin.host.operate.recovering import axis_states
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.host.twin.machine.boards import board_configs
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.homing_methods import HOME_HERE
from tests.host.robots.coupled import DIRECT, STEPS_PER_DEG, TWO_TO_ONE, UNITS_PER_DEG, coupled_robot
from tests.messages import refusing

HERE = [20.0, -50.0, 10.0, 5.0]
STEP_DEG = 1 / STEPS_PER_DEG
FREE = [-(1 << 31), (1 << 31) - 1]


def machine(kernel: Kernel, coupling: str = DIRECT, *, known: bool = True) -> tuple[BoardUnderTest, Session]:
    """Return a machine that stands at HERE, and a session with it."""
    robot = coupled_robot(coupling)
    board = BoardUnderTest(robot, stand_at=HERE, kernel=kernel)
    session = Session(board, robot)
    if known:
        with session.charge("preset", needs=()) as charge:
            axes = charge.enable()
            axes.preset(session.units(HERE))
    return board, session


def standing(board: BoardUnderTest) -> list[float]:
    return list(board.joints().values())


def limits(session: Session) -> list[list[int]]:
    return [
        [axis.read(address) for address in (od.POSITION_LIMIT_MIN, od.POSITION_LIMIT_MAX)]
        for axis in session.machine.axes
    ]


@pytest.mark.parametrize("coupling", [DIRECT, TWO_TO_ONE])
def test_a_move_of_one_joint_leaves_the_other_joints(coupling: str, fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel, coupling)
    moved = move(session, [60.0, None, None, None])
    assert moved.end == pytest.approx([60.0, *HERE[1:]], abs=3 * STEP_DEG)
    assert standing(board) == pytest.approx([60.0, *HERE[1:]], abs=3 * STEP_DEG)
    before = board.steps()
    move(session, [None, None, None, 30.0])
    assert {name for name, steps in board.steps().items() if steps != before[name]} == {"th4"}


def test_a_move_keeps_the_motors_limits(fast_kernel: Kernel) -> None:
    """60 deg of both joints are 120 deg of the elbow's motor, whose 180 deg/s and 1000 deg/s^2 decide."""
    _, session = machine(fast_kernel)
    moved = move(session, [80.0, 10.0, None, None])
    assert moved.planned_s == pytest.approx(120 / 180 + 180 / 1000, abs=0.003)


def test_status_shows_joint_positions(fast_kernel: Kernel) -> None:
    _, session = machine(fast_kernel)
    assert [axis.position for axis in read_status(session).axes] == pytest.approx(HERE, abs=2 * STEP_DEG)
    assert [state.position for state in axis_states(session)] == pytest.approx(HERE, abs=2 * STEP_DEG)


def test_a_joint_is_known_if_all_its_axes_are(fast_kernel: Kernel) -> None:
    """The elbow's motor alone says only where the forearm points."""
    _, session = machine(fast_kernel, known=False)
    here = HomingSettings(HOME_HERE, 1, 1, 1, session.units(HERE)[1], 0)
    with session.charge("preset", needs=()) as charge:
        axes = charge.enable()
        axes.home_axes((None, here, None, None))
    assert [axis.position_known for axis in read_status(session).axes] == [False] * 4
    with refusing(DeviceFaultError):
        move(session, [None, 10.0, None, None])
    jog(session, "th1", 10.0, 0.2)
    assert limits(session) == [FREE] * 4


@pytest.mark.parametrize("coupling", [DIRECT, TWO_TO_ONE])
def test_a_jog_of_the_shoulder_turns_both_motors_in_proportion(coupling: str, fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel, coupling)
    jogged = jog(session, "th1", 40.0, 1.0)
    assert jogged.end - jogged.start == pytest.approx(40.0, abs=1.0)
    assert standing(board) == pytest.approx([jogged.end, *HERE[1:]], abs=3 * STEP_DEG)
    assert limits(session) == [FREE] * 4
    shoulder, elbow = board.pins("th1"), board.pins("th2")
    ratio = 2 if coupling == TWO_TO_ONE else 1
    assert elbow.step_counts.size == pytest.approx(ratio * shoulder.step_counts.size, abs=2)
    starts = np.array([shoulder.step_counts[0], elbow.step_counts[0]]) / 72e6
    ends = np.array([shoulder.step_counts[-1], elbow.step_counts[-1]]) / 72e6
    assert np.ptp(starts) < 0.01
    assert np.ptp(ends) < 0.02
    t_counts = np.linspace(shoulder.step_counts[0], shoulder.step_counts[-1], 200)
    along = [start + np.searchsorted(axis.step_counts, t_counts) for axis, start in ((shoulder, 0), (elbow, 0))]
    assert np.abs(along[1] - ratio * along[0]).max() <= 3


def test_a_jog_of_the_elbow_turns_its_own_motor(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel)
    before = board.steps()
    jog(session, "th2", -30.0, 0.5)
    assert {name for name, steps in board.steps().items() if steps != before[name]} == {"th2"}


@pytest.mark.parametrize(("coupling", "speed", "end"), [(DIRECT, 150.0, 130.0), (TWO_TO_ONE, 80.0, 130.0)])
def test_a_jog_ends_at_the_limit_of_the_joint(coupling: str, speed: float, end: float, fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel, coupling)
    jogged = jog(session, "th1", speed, 100.0)
    assert jogged.at_limit
    assert board.now_s() < 20
    assert standing(board) == pytest.approx([end, *HERE[1:]], abs=3 * STEP_DEG)


def test_the_board_alone_keeps_the_limits_of_a_jog(fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """A host that hangs in the jog but still sends its heartbeat: both axes stop at the ends of their own ways."""
    board, session = machine(fast_kernel)
    seen: list[list[list[int]]] = []

    def hang(*_: object, **__: object) -> None:
        seen.append(limits(session))
        board.wait(5.0)

    monkeypatch.setattr("steptwin.host.operate.jogging.follow", hang)
    jog(session, "th1", 100.0, None)
    assert standing(board) == pytest.approx([130.0, *HERE[1:]], abs=3 * STEP_DEG)
    (jogging,) = seen
    assert jogging[0] == pytest.approx([-130 * UNITS_PER_DEG, 130 * UNITS_PER_DEG], abs=1)
    assert jogging[1] == pytest.approx([(-130 - 50) * UNITS_PER_DEG, (130 - 50) * UNITS_PER_DEG], abs=2)
    assert jogging[2:] == [FREE, FREE]


def test_a_lost_host_stops_both_axes_in_step(fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """All axes miss the same heartbeat and stop by ramps in proportion, so the elbow does not bend."""
    board, session = machine(fast_kernel)

    def die(*_: object, **__: object) -> None:
        board.wait(0.5)
        session.machine._heartbeat.stop()  # noqa: SLF001
        board.wait(2.0)
        raise KeyboardInterrupt

    monkeypatch.setattr("steptwin.host.operate.jogging.follow", die)
    with pytest.raises((DeviceFaultError, KeyboardInterrupt)):
        jog(session, "th1", 60.0, 100.0)
    assert board.joints()["th1"] < 100.0
    assert standing(board)[1:] == pytest.approx(HERE[1:], abs=3 * STEP_DEG)


def test_the_fastest_jog() -> None:
    robot = coupled_robot(TWO_TO_ONE)
    check_jog(robot, "th1", -90.0)
    with refusing(InputError):
        check_jog(robot, "th1", 90.1)
    slow = coupled_robot("th2 = { th1 = 0.25 }")  # the elbow's axis turns a quarter as far, and would stand
    with refusing(InputError):
        check_jog(slow, "th1", 0.0017)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coupling", "stand"),
    [
        (DIRECT, HERE),
        (TWO_TO_ONE, [-60.0, -100.0, 10.0, 5.0]),
        ("th1 = { th2 = 1.0 }", HERE),
        ("d3 = { th4 = 0.01 }\nth2 = { th1 = -0.5, th2 = 1.2 }", HERE),
    ],
)
@pytest.mark.parametrize("together", [pytest.param(False, marks=pytest.mark.slow), True])
def test_homing_finds_the_joints(coupling: str, stand: list[float], together: bool, fast_kernel: Kernel) -> None:
    """Every edge is at a joint position; the host must know where the other joints stand when it is met."""
    robot = coupled_robot(coupling)
    board = BoardUnderTest(robot, stand_at=stand, kernel=fast_kernel)
    session = Session(board, robot)
    parts: list[float] = []
    states = home_robot(session, together=together, progress=parts.append)
    assert all(state.position_known for state in states)
    assert standing(board) == pytest.approx(list(robot.home), abs=3 * STEP_DEG)
    assert [state.position for state in states] == pytest.approx(standing(board), abs=1.5 * STEP_DEG)
    assert parts == sorted(parts)
    assert parts[-1] == 1.0


@pytest.mark.slow
def test_exact_homing_of_a_whole_belt(fast_kernel: Kernel) -> None:
    """With belts of 1:1 and equal motors every edge is on a step, so the machine knows itself to the step."""
    board, session = machine(fast_kernel, known=False)
    home_robot(session, stay=True)
    assert session.positions(session.machine.positions_units()) == pytest.approx(standing(board), abs=1e-9)


@pytest.mark.parametrize(("turn_deg", "closed"), [(-54.9, False), (-55.1, True)])
def test_a_limit_switch_stands_at_a_joint_position(turn_deg: float, closed: bool, fast_kernel: Kernel) -> None:
    """The shoulder's motor alone bends the elbow from 100 deg to 155 deg, where its positive limit switch is."""
    robot = coupled_robot()
    board = BoardUnderTest(robot, stand_at={"th2": 100.0}, kernel=fast_kernel)
    session = Session(board, robot)
    units = session.units([0.0, 100.0, 0.0, 0.0])
    with session.charge("preset", needs=()) as charge:
        axes = charge.enable()
        axes.preset(units)
        goal = [units[0] + round(turn_deg * UNITS_PER_DEG), *units[1:]]
        move_within(session, units, goal)
        assert bool(axes.axes[1].read(od.DIGITAL_INPUTS) & DigitalInput.POSITIVE_LIMIT) is closed
        assert not axes.axes[0].read(od.DIGITAL_INPUTS) & DigitalInput.POSITIVE_LIMIT


def test_coupled_axes_are_on_one_board() -> None:
    robot = coupled_robot()
    board_configs(robot, MachineOptions(axes_per_board=[2, 2]))
    with refusing(InputError):
        board_configs(robot, MachineOptions(axes_per_board=[1, 3]))


def test_a_step_of_the_shoulder_leaves_the_elbow(fast_kernel: Kernel) -> None:
    board, session = machine(fast_kernel)
    step_joint(session, "th1", 7.5)
    assert standing(board) == pytest.approx([27.5, *HERE[1:]], abs=3 * STEP_DEG)


def test_a_step_of_the_shoulder_without_known_positions(fast_kernel: Kernel) -> None:
    """What counts from anywhere still moves both motors by the same way."""
    board, session = machine(fast_kernel, known=False)
    step_joint(session, "th1", 7.5)
    assert standing(board) == pytest.approx([27.5, *HERE[1:]], abs=3 * STEP_DEG)


def test_a_jog_has_no_limits_if_an_axis_that_its_joint_depends_on_is_lost(fast_kernel: Kernel) -> None:
    """The elbow's motor knows its position, but not that of the shoulder, on which th2 depends, too."""
    _, session = machine(fast_kernel, known=False)
    here = HomingSettings(HOME_HERE, 1, 1, 1, session.units(HERE)[1], 0)
    with session.charge("preset", needs=()) as charge:
        charge.enable().home_axes((None, here, None, None))
    seen: list[list[list[int]]] = []
    jog(session, "th2", 10.0, 0.2, until=lambda: bool(seen.append(limits(session))))  # type: ignore[func-returns-value]
    assert len(seen) > 1
    assert all(each == [FREE] * 4 for each in seen)
