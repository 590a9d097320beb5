"""One program in charge of a machine: what the second is told, and what is left when the first has lost it."""

from collections.abc import Callable
from functools import partial

import pytest

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.lease import WATCH_HOST, Lease
from steptwin.host.client.profile_motion import VelocityTarget, drive
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.moving import move
from steptwin.host.operate.recovering import emergency_stop, reset, stop
from steptwin.host.operate.session import MachineCharge, Session
from steptwin.host.operate.status import read_status
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control
from steptwin.protocol.frame import COB_NMT
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.od import CHARGE_FREE, CHARGE_UNWATCHED_MS
from tests.host.client.machines import TH2, Neighbour
from tests.host.operate.sessions import HOME, ROBOT
from tests.messages import refusing

TAKEN = (
    r"^another program is in charge of the machine, says sx \(node 0x10\): wait for its end, up to 1 s if it was "
    r"killed; `steptwin stop` and `estop` work at any time$"
)


@pytest.fixture
def other(board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch) -> Session:
    """A session of another program on the same bus."""
    return Session(Neighbour(board, monkeypatch), ROBOT)


def tokens(session: Session) -> list[int]:
    return [axis.read(od.CHARGE_TOKEN) for axis in session.machine.axes]


def watched(session: Session) -> list[int]:
    return [axis.read(od.CONSUMER_HEARTBEATS[0]) for axis in session.machine.axes]


def take_away(axis: AxisClient) -> None:
    """Release an axis in its owner's place, as a person's deliberate takeover would: the token is no secret."""
    axis.write(od.CHARGE_RELEASE, axis.read(od.CHARGE_TOKEN))


def test_the_second_program_is_refused(session: Session, other: Session) -> None:
    with session.charge("move") as charge:
        charge.enable()
        held = tokens(session)
        for do in (lambda: move(other, HOME), lambda: reset(other)):
            with refusing(BusError) as caught:
                do()
            assert caught.value.exit_code == 4
        assert tokens(session) == held
        assert watched(session) == [WATCH_HOST] * len(held)
    assert tokens(session) == [CHARGE_FREE] * len(held)
    move(other, HOME)


def test_everyone_may_look_and_stop(session: Session, other: Session) -> None:
    with session.charge("move") as charge:
        charge.enable()
        assert not read_status(other).streaming
        assert {state.state for state in stop(other)} == {"QUICK STOP ACTIVE"}


def test_a_program_that_gets_some_axes_only_gives_them_back(session: Session, other: Session) -> None:
    Lease(other.machine.axes[TH2:]).claim()
    with refusing(BusError):
        move(session, HOME)
    assert [token == CHARGE_FREE for token in tokens(session)] == [axis < TH2 for axis in range(6)]


def fail_in(charge: MachineCharge, error: type[BaseException]) -> None:
    charge.enable()
    raise error


def test_an_error_or_an_interruption_frees_the_machine(session: Session, other: Session) -> None:
    for error in (KeyboardInterrupt, BusError):
        with pytest.raises(error), session.charge("move") as charge:
            fail_in(charge, error)
        assert tokens(session) == [CHARGE_FREE] * 6
    move(other, HOME)


def test_a_program_that_hangs_before_its_heartbeat_loses_the_machine(
    board: EmbeddedBoard, session: Session, other: Session
) -> None:
    with session.alone("look"):
        with refusing(BusError):
            move(other, HOME)
        board.wait(CHARGE_UNWATCHED_MS / 1000)
        move(other, HOME)


def test_a_program_that_has_lost_the_machine_leaves_the_next_one_alone(session: Session, other: Session) -> None:
    with session.charge("move") as charge:
        charge.enable()
        for axis in other.machine.axes:
            take_away(axis)
        Lease(other.machine.axes).claim()
        held = tokens(other)
    assert tokens(other) == held
    assert watched(other) == [WATCH_HOST] * 6


def test_a_program_that_lost_the_machine_while_setting_up_enables_no_drive(
    session: Session, other: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    session.machine.disable()
    adopt = session.machine.adopt

    def too_late(*objects: object) -> None:
        adopt(*objects)  # type: ignore[arg-type]
        for axis in other.machine.axes:
            take_away(axis)
        Lease(other.machine.axes).claim()

    monkeypatch.setattr(session.machine, "adopt", too_late)
    with refusing(BusError):
        move(session, HOME)
    assert {axis.state for axis in read_status(other).axes} == {"SWITCH ON DISABLED"}


def test_a_charge_that_nobody_has_taken_meanwhile_is_claimed_again(session: Session) -> None:
    with session.charge("move") as charge:
        held = tokens(session)
        take_away(session.machine.axes[TH2])
        charge.enable()
        assert tokens(session) == held
        take_away(session.machine.axes[TH2])
    assert tokens(session) == [CHARGE_FREE] * 6
    assert watched(session) == [0] * 6


def void_after_setting_up(session: Session, patch: pytest.MonkeyPatch, strike: Callable[[], object]) -> str:
    """Let something strike the machine once it is set up for a move; return why nothing has moved then."""
    adopt = session.machine.adopt

    def struck(*objects: object) -> bool:
        changed = adopt(*objects)  # type: ignore[arg-type]
        strike()
        session.link.wait(0.1)
        return changed

    patch.setattr(session.machine, "adopt", struck)
    with pytest.raises(DeviceFaultError) as caught:
        move(session, HOME)
    return str(caught.value)


def test_a_stop_after_the_setting_up_leaves_the_drives_off(
    session: Session, other: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    session.machine.disable()

    def stop_and_release() -> None:
        emergency_stop(other)
        session.link.wait(0.05)
        for axis in other.machine.axes:
            axis.write(od.CONTROLWORD, 0)
            axis.write(od.CONTROLWORD, Control.FAULT_RESET)

    said = void_after_setting_up(session, monkeypatch, stop_and_release)
    assert said == "move: void, since the machine was stopped after this was asked for"
    assert {axis.state for axis in read_status(other).axes} == {"SWITCH ON DISABLED"}


def test_a_restart_after_the_setting_up_is_named(
    session: Session, other: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    restart = partial(session.link.network.send_message, COB_NMT, bytes((NmtCommand.RESET_NODE, 0)))
    said = void_after_setting_up(session, monkeypatch, restart)
    assert said == "sx (node 0x10) has restarted (boot-up message); its position is unknown: home it"
    assert {axis.state for axis in read_status(other).axes} == {"SWITCH ON DISABLED"}


def test_an_axis_that_another_master_drives_is_left_alone(session: Session, other: Session) -> None:
    th2 = other.machine.axes[TH2]
    drive(other.link, [VelocityTarget(th2, 10_000, 100_000)])
    session.link.wait(0.2)
    with refusing(InputError):
        move(session, HOME)
    assert th2.read(od.TARGET_VELOCITY) == 10_000
    assert tokens(session) == [CHARGE_FREE] * 6
