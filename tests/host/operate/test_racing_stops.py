"""A stop that comes between any two requests of another program wins; what was asked for before it is void."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client import stopping
from steptwin.host.client.axis import AxisClient
from steptwin.host.common.errors import DeviceFaultError, StepTwinError
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.moving import move
from steptwin.host.operate.recovering import emergency_stop, reset, stop
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, State
from tests.host.client.machines import Neighbour
from tests.host.operate.sessions import HOME, ROBOT, board_at, preset
from tests.messages import refusing

GOAL = [300.0, 0.0, 110.0, 10.0, 50.0, 20.0]


@pytest.fixture
def other(board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch) -> Session:
    """The session of another program on the same bus."""
    return Session(Neighbour(board, monkeypatch), ROBOT)


@contextmanager
def before_request(number: int, of: Session, do: Callable[[], object]) -> Iterator[list[int]]:
    """Do something just before a session's request of this number; the list that is yielded has a place for each."""
    made: list[int] = []
    with pytest.MonkeyPatch.context() as patch:
        for name in ("read", "write"):
            original = getattr(AxisClient, name)

            def asked(axis: AxisClient, *args: int, _original: Callable[..., int] = original) -> int:
                if axis in of.machine.axes:
                    made.append(1)
                    if len(made) == number:
                        do()
                return _original(axis, *args)

            patch.setattr(AxisClient, name, asked)
        yield made


def states(session: Session) -> list[State]:
    return [axis.state() for axis in session.machine.axes]


def requests_of_a_reset(session: Session) -> int:
    emergency_stop(session)
    with before_request(0, session, lambda: None) as made:
        reset(session)
    return len(made)


@pytest.mark.slow
@pytest.mark.parametrize("numbers", [slice(None, None, 7), pytest.param(slice(None), marks=pytest.mark.slow)], ids=str)
def test_an_emergency_stop_amid_a_reset_stays(session: Session, other: Session, numbers: slice) -> None:
    count = requests_of_a_reset(session)
    assert count > 50
    for number in range(1, count + 1)[numbers]:
        emergency_stop(other)
        session.link.wait(0.01)
        with before_request(number, session, lambda: emergency_stop(other)), suppress(DeviceFaultError):
            reset(session)
        assert states(other) == [State.FAULT] * 6, f"request {number} of {count}"


@pytest.mark.slow
def test_a_reset_amid_an_emergency_stop_does_not_end_it(session: Session, other: Session) -> None:
    def release() -> None:
        with suppress(StepTwinError):
            reset(session)

    def stop_all() -> None:
        stopping.emergency_stop(other.link, other.machine.axes)

    with before_request(0, other, lambda: None) as made:
        stop_all()
    for number in range(1, len(made) + 1):
        reset(session)
        with before_request(number, other, release):
            stop_all()
        assert states(other) == [State.FAULT] * 6, f"request {number} of {len(made)}"


def test_a_reset_that_was_held_up_answers_no_later_stop(session: Session, other: Session) -> None:
    emergency_stop(other)
    session.link.wait(2.0)
    emergency_stop(other)
    session.link.wait(0.5)
    with refusing(DeviceFaultError):
        reset(session, age_s=0.6)  # asked for before the second one
    assert states(other) == [State.FAULT] * 6
    reset(session, age_s=0.4)
    assert states(other) == [State.SWITCH_ON_DISABLED] * 6


ACTIONS: dict[str, Callable[[Session], object]] = {
    "move": lambda session: move(session, GOAL),
    "home": lambda session: home_robot(session, joints=["th3"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("every", [30, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("action", ACTIONS)
def test_what_was_asked_for_before_a_stop_and_its_reset_never_moves(
    action: str, every: int, fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before every third request that leads up to the motion; later the drives, which are off, do not move."""
    board = board_at(HOME, fast_kernel)
    session = preset(board, HOME)
    other = Session(Neighbour(board, monkeypatch), ROBOT)

    def stop_and_reset() -> None:
        emergency_stop(other)
        for axis in other.machine.axes:  # as any other master does it, which asks for no lease
            axis.write(od.CONTROLWORD, 0)
            axis.write(od.CONTROLWORD, Control.FAULT_RESET)
        board.wait(0.05)

    standing = board.driver_positions()
    moved: list[bool] = []

    def strike() -> None:
        moved.append(board.driver_positions() != standing)
        stop_and_reset()

    number = 1 - every
    while True:
        number += every
        moved.clear()
        with before_request(number, session, strike), suppress(DeviceFaultError), session.one_action():
            ACTIONS[action](session)
        assert moved, "the action moves before its requests end"
        if moved[0]:
            break
        assert board.driver_positions() == standing, f"request {number}"
    assert number > 60


def test_a_stop_while_a_command_plans_makes_it_void(session: Session, other: Session) -> None:
    standing = session.demanded_units()
    with session.one_action():
        move(session, HOME)
        stop(other)
        with refusing(DeviceFaultError):
            move(session, GOAL)
    assert session.demanded_units() == standing
    move(session, GOAL)  # asked for after the stop
