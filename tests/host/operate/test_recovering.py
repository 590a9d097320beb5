"""Stop, power off and fault reset: from every state, with and without process data."""

import pytest

from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.host.operate.moving import move
from steptwin.host.operate.recovering import emergency_stop, reset, stop
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from tests.host.client.machines import TH2, Neighbour, silence_heartbeat
from tests.host.operate.sessions import HOME, ROBOT, CommandLine
from tests.messages import refusing
from tests.operations import BrownOut, WatchdogReset

MOVING = (
    "move warehouse-scara th1=1",
    "jog warehouse-scara th1 1 --seconds 1",
    "jog warehouse-scara th1 +1",
    "jog warehouse-scara x +1",
    "home warehouse-scara",
    "home warehouse-scara --here '0 0 100 0 60 30'",
    "run warehouse-scara pull-line",
    "run warehouse-scara pull-line --approach",
)
GOAL = [400.0, 0.0, 120.0, 30.0, 40.0, -60.0]


def states(steptwin: CommandLine, command: str) -> list[tuple[str, bool]]:
    document = steptwin.json(f"{command} warehouse-scara")
    return [(axis["state"], axis["position_known"]) for axis in document["axes"]]


def test_all_axes_stop_in_the_same_tick(
    board: EmbeddedBoard, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One SYNC follows the latched controlwords; no axis needs a quick stop by SDO."""
    other = Session(Neighbour(board, monkeypatch), ROBOT)
    begin: list[int] = []

    def halfway(fraction: float) -> None:
        if fraction > 0.5 and not begin:
            begin.append(len(board.bus_log))
            stop(other)

    with refusing(DeviceFaultError):
        move(session, GOAL, progress=halfway)
    sent = [frame for _, frame in board.bus_log[begin[0] :]]
    assert [frame.cob_id for frame in sent if 0x300 < frame.cob_id < 0x380][:6] == [0x310 + i for i in range(6)]
    stopped = next(i for i, frame in enumerate(sent) if frame.cob_id == 0x080)
    told = [frame for frame in sent[:stopped] if 0x600 < frame.cob_id < 0x680]
    assert not told


@pytest.mark.slow
def test_a_stop_holds_and_an_emergency_stop_lets_go(steptwin: CommandLine, session: Session) -> None:
    assert states(steptwin, "stop") == [("QUICK STOP ACTIVE", True)] * 6
    assert states(steptwin, "stop") == [("QUICK STOP ACTIVE", True)] * 6
    assert states(steptwin, "estop") == [("FAULT", True)] * 6
    assert states(steptwin, "stop") == [("FAULT", True)] * 6
    assert states(steptwin, "reset") == [("SWITCH ON DISABLED", True)] * 6
    move(session, GOAL)


@pytest.mark.slow
def test_an_emergency_stop_lasts_until_the_reset(steptwin: CommandLine, session: Session) -> None:
    """Also when the drives were off or in fault before, and whichever command tries."""
    session.machine.disable()
    assert states(steptwin, "estop") == [("FAULT", True)] * 6
    held = "is held by an emergency stop until `steptwin reset`"
    for moving in MOVING:
        assert steptwin.run(moving) == (3, "", f"steptwin: sx: {held}\n")
    exit_code, out, err = steptwin.run("status warehouse-scara")
    assert (exit_code, err) == (3, "steptwin: sx: the drive is in FAULT: estop\n")
    assert out.count("held by an emergency stop until `steptwin reset`") == 6
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 3
    assert [line for line in out.splitlines() if line.startswith("[FAIL] ")] == [
        f"[FAIL] {name} drive: {held}" for name in ROBOT.joint_names
    ]
    session.machine.axes[TH2].write(od.CONTROLWORD, 0x0F)  # as any other master might try
    assert states(steptwin, "reset") == [("SWITCH ON DISABLED", True)] * 6
    move(session, GOAL)


@pytest.mark.slow
def test_an_emergency_stop_in_motion_keeps_the_position(
    board: EmbeddedBoard, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Session(Neighbour(board, monkeypatch), ROBOT)

    def halfway(fraction: float) -> None:
        if fraction > 0.5:
            left = emergency_stop(other)
            assert [(state.state, state.position_known) for state in left] == [("FAULT", True)] * 6

    with refusing(DeviceFaultError):
        move(session, GOAL, progress=halfway)
    counted = [
        steps * 16384 // joint.transmission.microsteps
        for steps, joint in zip(board.driver_positions(), ROBOT.joints, strict=True)
    ]
    assert session.machine.positions_units() == counted


@pytest.mark.slow
def test_nodes_without_process_data_are_stopped_by_sdo(board: EmbeddedBoard, session: Session) -> None:
    board.network.nmt.state = "PRE-OPERATIONAL"
    begin = len(board.bus_log)
    assert [state.state for state in stop(session)] == ["QUICK STOP ACTIVE"] * 6
    assert not [frame for _, frame in board.bus_log[begin:] if frame.cob_id == 0]


@pytest.mark.usefixtures("session")
def test_a_reset_starts_nodes_that_another_master_has_stopped(steptwin: CommandLine, board: EmbeddedBoard) -> None:
    """Stopped nodes answer no request; those in PRE-OPERATIONAL do. None of the others gets a command."""
    board.network.send_message(0x000, b"\x02\x12")
    board.network.send_message(0x000, b"\x80\x14")
    told = "steptwin: L1: node 0x12 does not answer (No SDO response received)\n"
    assert steptwin.run("status warehouse-scara") == (4, "", told)
    begin = len(board.bus_log)
    assert len(states(steptwin, "reset")) == 6
    sent = [frame.data for _, frame in board.bus_log[begin:] if frame.cob_id == 0]
    assert sent == [b"\x01\x12", b"\x01\x14"]
    assert steptwin.run("status warehouse-scara")[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("fault", [WatchdogReset(), BrownOut(for_ms=30)])
def test_a_board_that_restarts_in_motion_is_told(
    fault: WatchdogReset | BrownOut, board: EmbeddedBoard, session: Session, steptwin: CommandLine
) -> None:
    struck: list[float] = []

    def halfway(fraction: float) -> None:
        if fraction > 0.5 and not struck:
            struck.append(board.now_s())
            board.operate(fault)

    with refusing(DeviceFaultError):
        move(session, GOAL, progress=halfway)
    assert board.now_s() - struck[0] < 0.2
    assert states(steptwin, "reset") == [("SWITCH ON DISABLED", False)] * 6


def test_no_node_answers(monkeypatch: pytest.MonkeyPatch, board: EmbeddedBoard) -> None:
    monkeypatch.setattr(board.network, "send_message", lambda *_: None)
    session = Session(board, ROBOT)
    for do in (stop, emergency_stop, reset):
        with refusing(BusError):
            do(session)


@pytest.mark.slow
def test_a_reset_needs_the_cause_to_be_gone(steptwin: CommandLine, session: Session) -> None:
    axis = session.machine.axes[TH2]
    session.machine.disable()
    axis.write(od.SUPPLY_VOLTAGE_MIN, 5000)  # above the 24 V of the supply
    with refusing(DeviceFaultError):
        move(session, GOAL)
    exit_code, out, err = steptwin.run("reset warehouse-scara")
    assert (exit_code, out) == (3, "")
    assert err == "steptwin: th2: stays in FAULT because the cause lasts: undervoltage (0x3220)\n"
    axis.write(od.SUPPLY_VOLTAGE_MIN, 1000)
    assert states(steptwin, "reset")[TH2] == ("SWITCH ON DISABLED", True)
    move(session, GOAL)


@pytest.mark.slow
def test_a_lost_host_is_a_fault_that_can_be_reset(
    board: EmbeddedBoard, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The axes watch the host while it moves them, and no longer after it has disconnected."""
    board.wait(5.0)
    move(session, GOAL)

    def hang(fraction: float) -> None:
        if fraction > 0.2:
            silence_heartbeat(monkeypatch)

    with refusing(DeviceFaultError):
        move(session, HOME, progress=hang)
    monkeypatch.undo()
    other = Session(Neighbour(board, monkeypatch), ROBOT)
    assert [state.state for state in reset(other)] == ["SWITCH ON DISABLED"] * 6
    move(other, HOME)


@pytest.mark.usefixtures("session")
def test_without_a_trajectory_there_is_nothing_to_pause(steptwin: CommandLine) -> None:
    for command in ("pause", "resume"):
        message = f"steptwin: nothing to {command}: no axis runs a trajectory\n"
        assert steptwin.run(f"{command} warehouse-scara") == (2, "", message)
