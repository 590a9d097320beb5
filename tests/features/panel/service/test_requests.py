"""What is asked of the service, without a machine: commands, stops, operators; and its events and history."""

import numpy as np
import pytest

from steptwin.features.panel.service.commands import Command, DeclareHere, Enable, Jog, JointJog, ResetFaults
from steptwin.features.panel.service.guards import OperatorPlace, Stop, StopRequestedError, StopRequests
from steptwin.features.panel.service.history import EVENTS_MAX, EventLog, History, Severity
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.service import MachineService, Order
from steptwin.host.robots import load_robot
from tests.features.panel.service.rig import connection
from tests.messages import refusing


def test_every_command_has_a_title_and_is_performed() -> None:
    commands, jogs = Command.__subclasses__(), Jog.__subclasses__()
    assert (len({kind.__name__ for kind in commands}), len({kind.__name__ for kind in jogs})) == (13, 2)
    for kind in (*commands, *jogs):
        assert "perform" in vars(kind), kind
        assert {"named", "title"} & vars(kind).keys(), kind


def test_one_command_waits_until_it_is_taken_or_dropped() -> None:
    state = MachineService(connection(0), load_robot("lab-scara"))
    first = Order(Enable(), 3)
    state.order(first)
    assert state.activity is not None
    assert (state.activity.name, state.activity.fraction) == ("switch on", 0.0)
    with refusing(RefusedError):
        state.order(Order(ResetFaults(), 3))
    with refusing(RefusedError):
        state.order(Order(Enable(), 3))
    assert state.take() is first
    state.drop()  # what is carried out goes on
    assert state.activity is not None
    state.end()
    state.order(Order(DeclareHere((0.0,)), 4))
    state.drop()
    assert state.take() is None
    idle = state.activity
    assert idle is None


def test_a_command_goes_before_a_held_button() -> None:
    state = MachineService(connection(0), load_robot("lab-scara"))
    state.presses.beat("a", 1, JointJog("th2", 10.0))
    state.order(Order(Enable(), 3))
    assert isinstance(state.take(), Order)
    press = state.take()
    assert press == state.presses.present
    assert state.activity is not None
    assert (state.activity.name, state.activity.jogging) == ("jog th2", True)


def test_another_operator_ends_what_was_asked_for_before() -> None:
    state = MachineService(connection(0), load_robot("lab-scara"))
    number = state.shown.add()
    state.presses.beat("a", 1, JointJog("th2", 10.0))
    state.operator.take("b", "Bob")
    assert state.presses.present is None
    assert state.presses.release("a", 1) == "another client operates the machine"
    with refusing(RefusedError):
        state.shown.require(number)


def raised(stops: StopRequests) -> bool:
    try:
        with stops.sending():
            return False
    except StopRequestedError:
        return True


def test_a_stop_ends_the_work_once_and_lets_the_worker_stop() -> None:
    stops = StopRequests()
    assert not raised(stops)
    stops.ask(Stop.STOP)
    assert [raised(stops) for _ in range(3)] == [True, False, False]
    assert stops.answer() is Stop.STOP
    stops.done(Stop.STOP)
    assert (int(stops.asked), raised(stops)) == (Stop.NONE, False)


def test_an_emergency_stop_ends_a_stop_too_and_is_not_lost() -> None:
    stops = StopRequests()
    stops.ask(Stop.STOP)
    assert raised(stops)
    stops.ask(Stop.EMERGENCY)
    stops.ask(Stop.STOP)
    assert [raised(stops), raised(stops)] == [True, False]
    stops.done(Stop.STOP)
    assert stops.answer() is Stop.EMERGENCY
    assert int(stops.asked) == Stop.EMERGENCY  # until it is made
    stops.done(Stop.EMERGENCY)
    assert int(stops.asked) == Stop.NONE


def test_a_machine_that_was_stopped_already_only_ends_the_work() -> None:
    stops = StopRequests()
    stops.ask(Stop.VOID)
    with refusing(StopRequestedError), stops.sending():
        raise AssertionError("a frame was sent")
    assert (stops.answer(), raised(stops)) == (Stop.VOID, False)
    stops.done(Stop.VOID)
    stops.ask(Stop.VOID)
    stops.ask(Stop.STOP)
    assert stops.answer() is Stop.STOP  # which is still to be made


def test_a_press_that_comes_again_is_known() -> None:
    stops = StopRequests()
    assert [stops.is_new(press) for press in ("a", "b", "a", "b", "c")] == [True, True, False, False, True]


def test_one_client_operates() -> None:
    changes: list[bool] = []
    events = EventLog()
    operators = OperatorPlace(events, lambda: changes.append(True))
    with refusing(RefusedError):
        operators.require("a")
    operators.take("a", "Ann")
    operators.take("a", "Ann")
    operators.require("a")
    with refusing(RefusedError):
        operators.take("b", "Bob")
    with refusing(RefusedError):
        operators.require("b")
    operators.give_up("b")
    assert operators.is_operator("a")
    assert len(changes) == 1
    operators.give_up("a")
    operators.take("b", "Bob")
    assert (operators.is_operator("a"), operators.is_operator("b"), len(changes)) == (False, True, 3)
    operators.give_up("b")
    assert (operators.holder, len(changes)) == (None, 4)
    assert [event.text for event in events.since()] == [
        f"{name} {what} the machine" for name in ("Ann", "Bob") for what in ("operates", "no longer operates")
    ]


def test_events_stay_until_they_are_cleared() -> None:
    events = EventLog(lambda: 12.5)
    events.info("a")
    events.error("b")
    assert [(event.number, event.wall_s, event.severity, event.text) for event in events.since(1)] == [
        (2, 12.5, Severity.ERROR, "b")
    ]
    events.clear()
    assert events.since() == ()
    for _ in range(EVENTS_MAX + 3):
        events.warning("c")
    assert len(events.since()) == EVENTS_MAX
    assert events.since()[-1].number == EVENTS_MAX + 5


@pytest.mark.parametrize("count", [0, 3, 5, 12])
def test_the_history_keeps_the_last_samples(count: int) -> None:
    history = History(2, samples_max=5)
    for i in range(count):
        history.add(float(i), np.array([i, 10.0 * i]), np.array([1.0, 2.0]), np.array([np.nan, 0.5]))
    kept = list(range(max(0, count - 5), count))
    samples = history.since()
    assert samples.t_s.tolist() == kept
    assert samples.positions.tolist() == [[i, 10.0 * i] for i in kept]
    assert samples.rates.tolist() == [[1.0, 2.0]] * len(kept)
    assert samples.following_errors[:, 1].tolist() == [0.5] * len(kept)
    assert history.since(count - 2.0).t_s.tolist() == kept[-1:]
