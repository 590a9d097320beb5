"""How often an operator's action talks to a configured machine of four axes that is enabled and stands."""

from collections import Counter
from collections.abc import Callable

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client.axis import AxisClient
from steptwin.host.operate.homing import declare, home_robot
from steptwin.host.operate.jogging import jog, jog_tool, step_joint, step_tool
from steptwin.host.operate.moving import move
from steptwin.host.operate.running import execute_live
from steptwin.host.operate.session import Session
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.planning.tool_by_hand import ToolStep
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode, Status
from tests.end_to_end.marks import slow_but

ROBOT = load_robot("lab-scara")
HOME = list(ROBOT.home)
TH2 = ROBOT.index_of("th2")
GOAL = [None, HOME[TH2] + 5.0, None, None]

ACTIONS: dict[str, tuple[Callable[[Session], object], int]] = {
    "move": (lambda session: move(session, GOAL), 93),
    "move to a pose": (lambda session: move(session, lambda standing: [*GOAL[:2], *standing[2:]]), 93),
    "step": (lambda session: step_joint(session, "th2", 1.0), 93),
    "jog": (lambda session: jog(session, "th2", 5.0, 0.2), 99),
    "step of the tool": (lambda session: step_tool(session, ToolStep({"x": -1.0}, 20.0)), 132),
    "jog of the tool": (lambda session: jog_tool(session, "x", -5.0, None, until=lambda: True), 96),
    "home": (lambda session: home_robot(session, joints=["th2"], stay=True), 117),
    "run": (lambda session: execute_live(session, spiral(), "spiral", approach=True), 156),
}
"""What is done, and its SDO dialogues: reads and writes of one object each."""


def spiral() -> Plan:
    return plan(ROBOT, make_job(ROBOT, "spiral", {}))


@pytest.fixture
def session(fast_kernel: Kernel) -> Session:
    made = Session(EmbeddedBoard(ROBOT, fast_kernel, MachineOptions(stand_at=HOME)), ROBOT)
    declare(made, HOME)
    move(made, HOME)
    return made


@pytest.fixture
def dialogues(session: Session, monkeypatch: pytest.MonkeyPatch) -> Counter[tuple[str, str, int]]:
    """Count the dialogues by axis, kind and object; not those of a board on which a run is tried beforehand."""
    made: Counter[tuple[str, str, int]] = Counter()
    for kind in ("read", "write"):
        original = getattr(AxisClient, kind)

        def counted(axis: AxisClient, *args: int, _kind: str = kind, _original: Callable[..., int] = original) -> int:
            made[axis.name, _kind, args[0]] += axis in session.machine.axes
            return _original(axis, *args)

        monkeypatch.setattr(AxisClient, kind, counted)
    return made


@pytest.mark.parametrize("action", slow_but([name for name in ACTIONS if name not in ("run", "home")], ACTIONS))
def test_what_an_action_asks_and_tells(action: str, session: Session, dialogues: Counter[tuple[str, str, int]]) -> None:
    """It claims each axis once."""
    do, count = ACTIONS[action]
    dialogues.clear()
    do(session)
    assert {dialogues[joint.name, "write", od.CHARGE_TOKEN] for joint in ROBOT.joints} == {1}
    assert {dialogues[joint.name, "read", od.DEVICE_TYPE] for joint in ROBOT.joints} == {1}
    assert dialogues.total() == count


def test_a_move_reads_nothing_twice_but_who_is_in_charge(
    session: Session, dialogues: Counter[tuple[str, str, int]]
) -> None:
    dialogues.clear()
    move(session, GOAL)
    again = {address: count for (_, kind, address), count in dialogues.items() if kind == "read" and count > 1}
    assert again == {od.CHARGE_TOKEN: 3}


def test_nodes_that_do_not_report_are_asked_for_their_modes(
    session: Session, dialogues: Counter[tuple[str, str, int]]
) -> None:
    """Another master has left them PRE-OPERATIONAL; their drives are enabled."""
    session.link.network.nmt.state = "PRE-OPERATIONAL"
    session.link.wait(0.2)
    for axis in session.machine.axes:
        axis.drive_status = None
    dialogues.clear()
    assert move(session, GOAL).end[TH2] == pytest.approx(HOME[TH2] + 5.0, abs=0.1)
    assert {dialogues[joint.name, "read", od.MODE_OF_OPERATION_DISPLAY] for joint in ROBOT.joints} == {1}
    assert {dialogues[joint.name, "read", od.STATUSWORD] for joint in ROBOT.joints} == {2}  # the enabling is seen


def test_limits_of_an_earlier_program_hold_no_axis_that_moves(session: Session) -> None:
    th2, th3 = session.machine.axes[TH2], session.machine.axes[TH2 + 1]
    limits = th2.read(od.POSITION_ACTUAL) + 1000, th3.read(od.POSITION_ACTUAL) + 1000
    th2.write(od.POSITION_LIMIT_MAX, limits[0])
    th3.write(od.POSITION_LIMIT_MAX, limits[1])
    assert move(session, GOAL).end[TH2] == pytest.approx(HOME[TH2] + 5.0, abs=0.1)
    assert (th2.read(od.POSITION_LIMIT_MAX), th3.read(od.POSITION_LIMIT_MAX)) == ((1 << 31) - 1, limits[1])
    goal = [None, None, HOME[TH2 + 1] - 5.0, None]
    assert move(session, goal).end[TH2 + 1] == pytest.approx(goal[2], abs=0.1)
    goal = [None, None, HOME[TH2 + 1] + 5.0, None]
    assert move(session, goal).end[TH2 + 1] == pytest.approx(goal[2], abs=0.1)


def test_a_target_velocity_holds_no_axis_against_its_limit(session: Session) -> None:
    """Another axis moves; this one would set off if somebody lifted the limit."""
    th3 = session.machine.axes[TH2 + 1]
    th3.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)
    th3.write(od.POSITION_LIMIT_MAX, th3.read(od.POSITION_DEMAND))
    th3.write(od.TARGET_VELOCITY, 1_000_000)
    session.link.wait(0.5)
    move(session, GOAL)
    assert (th3.read(od.TARGET_VELOCITY), th3.read(od.POSITION_LIMIT_MAX)) == (0, (1 << 31) - 1)


def test_an_old_report_says_nothing_of_the_mode(session: Session) -> None:
    move(session, GOAL)
    session.link.wait(0.2)
    axis = session.machine.axes[TH2]
    statusword, report = axis.read(od.STATUSWORD), axis.drive_status
    assert report is not None
    assert axis.mode(statusword) == report.mode == Mode.PROFILE_POSITION
    axis.drive_status = report._replace(statusword=statusword ^ Status.TARGET_REACHED, mode=Mode.HOMING)
    assert axis.mode(statusword) == Mode.PROFILE_POSITION
