"""The service: who may move the machine, what ends a jog, what stops at once, and what comes back by itself."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.panel.service.commands import (
    Command,
    DeclareHere,
    Disable,
    Enable,
    HomeAll,
    HomeJoint,
    JointJog,
    MoveJoints,
    MoveTool,
    ResetFaults,
    RunMotion,
    StepJoint,
    StepTool,
    SwitchOutput,
    ToolJog,
    WriteSettings,
)
from steptwin.features.panel.service.guards import EXPIRED, RELEASED
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.service import MachineService
from steptwin.host.client.words import STOP_PRESSED
from steptwin.host.operate.recovering import emergency_stop, reset
from steptwin.host.operate.session import Session
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.plan import highest_speed
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs.positions import ToolPosition
from tests.end_to_end.marks import slow_but
from tests.features.panel.service.rig import ANN, BOB, HERE, ROBOT, TH1, TH2
from tests.features.panel.service.virtual_rig import VirtualRig, virtual_rig
from tests.host.client.machines import Neighbour
from tests.messages import refusing

JOG = JointJog(TH1, 10.0)
TOOL_JOG = ToolJog("x", -20.0)


@pytest.fixture(scope="module")
def opened(fast_kernel: Kernel) -> Iterator[VirtualRig]:
    with virtual_rig(fast_kernel) as made:
        yield made


@pytest.fixture
def shared(opened: VirtualRig) -> VirtualRig:
    """Return the rig whose machine is ready, whatever a test has left behind."""
    opened.ready()
    return opened


def demo(service: MachineService) -> RunMotion:
    """Return a short run from HERE and back, of all joints."""
    moves = Composer(service.robot, np.array(HERE))
    moves.go(np.array(HERE) + 25.0)
    moves.go(np.array(HERE))
    return RunMotion(plan(service.robot, moves.sequence()), "demo", approach=True)


def settled(it: VirtualRig) -> list[float]:
    """Wait until the machine stands with nothing to do; return where, which a tenth of a second later is the same."""
    it.idle()
    it.await_true(it.stands, "standstill")
    here = it.positions()
    it.pass_time(0.1)
    assert it.positions() == here
    return here


# --- jogs


@pytest.mark.slow
def test_a_page_that_falls_silent_ends_its_jog_for_ever(shared: VirtualRig) -> None:
    press = shared.pressed(JOG)
    settled(shared)
    assert shared.beat_refusal(press, JOG) == EXPIRED
    settled(shared)


@pytest.mark.parametrize("jog", [JOG, pytest.param(TOOL_JOG, marks=pytest.mark.slow)], ids=["joint", "tool"])
def test_a_released_button_ends_its_jog_for_ever(shared: VirtualRig, jog: JointJog | ToolJog) -> None:
    service, start = shared.service, np.array(list((shared.service.snapshot.pose or {}).values()))
    press = shared.pressed(jog)
    service.release(ANN, press)
    settled(shared)
    assert shared.beat_refusal(press, jog) == RELEASED
    way = np.array(list((service.snapshot.pose or {}).values())) - start
    if isinstance(jog, ToolJog):
        assert way[0] < 0
        assert np.abs(way[1:3]).max() < 0.3  # half steps of the joints
    service.release(ANN, shared.pressed(jog))
    settled(shared)


def test_a_press_too_short_to_move_anything_says_so(shared: VirtualRig) -> None:
    start = shared.positions()
    before = shared.service.events.since()[-1].number
    press = shared.next_press()
    shared.fresh()
    shared.service.beat(ANN, press, JOG, shared.service.snapshot.number)
    shared.service.release(ANN, press)
    told = "jog th1: nothing has moved: the button was released before the drives were ready: hold it longer"
    shared.await_true(lambda: [event.text for event in shared.service.events.since(before)] == [told], told)
    assert settled(shared) == start


@pytest.mark.slow
def test_a_jog_ends_where_the_travel_ends(shared: VirtualRig) -> None:
    upper = ROBOT.joint(TH1).upper
    shift = upper - 0.5 - HERE[0]
    shared.do(DeclareHere((HERE[0] + shift, *HERE[1:])))
    try:
        shared.await_true(lambda: shared.positions()[0] > upper - 1.0, "declared")
        press = shared.pressed(JOG)
        with refusing(RefusedError):
            shared.hold(JOG, lambda: False)
        assert settled(shared)[0] == pytest.approx(upper, abs=0.1)
        assert shared.beat_refusal(press, JOG) == "jog th1: at the end of its travel"
    finally:  # declare what is true, or the tests after a failed one would move to a limit switch
        shared.do(DeclareHere((settled(shared)[0] - shift, *HERE[1:])))


def test_who_gives_up_ends_the_jog_and_lets_another_one_operate(shared: VirtualRig) -> None:
    service = shared.service
    press = shared.pressed(JOG)
    with refusing(RefusedError):
        service.operator.take(BOB, "Bob")
    service.operator.give_up(ANN)
    service.operator.take(BOB, "Bob")
    settled(shared)
    assert shared.beat_refusal(press, JOG).startswith("Bob operates the machine")
    assert shared.refusal(Enable()).startswith("Bob operates the machine")
    assert service.snapshot.operator == "Bob"
    service.gone(BOB)
    assert shared.refusal(Enable()).startswith("nobody operates the machine")


# --- stops

ACTIVITIES: dict[str, Callable[[VirtualRig], object]] = {
    "nothing": lambda it: it.do(Enable()),
    "a jog": lambda it: it.pressed(JOG),
    "a jog of the tool": lambda it: it.pressed(TOOL_JOG),
    "a move": lambda it: it.ask(MoveJoints({TH1: HERE[0] + 60.0})),
    "a homing": lambda it: it.ask(HomeAll(together=True)),
    "a run": lambda it: it.ask(demo(it.service)),
}


@pytest.mark.slow
@pytest.mark.parametrize("activity", slow_but(["nothing", "a jog", "a homing"], ACTIVITIES))
def test_anybody_stops_everything_at_once_until_the_reset(shared: VirtualRig, activity: str) -> None:
    service = shared.service
    ACTIVITIES[activity](shared)
    shared.await_true(lambda: activity == "nothing" or not shared.stands(), "motion")
    service.emergency_stop("Bob")
    assert service.snapshot.emergency_stopped
    shared.await_true(lambda: all(joint.drive_state == "FAULT" for joint in service.snapshot.joints), "held")
    here = settled(shared)
    for command in (Enable(), StepJoint(TH1, 1.0), demo(service), DeclareHere(HERE)):
        assert "held by an emergency stop" in shared.refusal(command)
    assert "held by an emergency stop" in shared.beat_refusal(1 << 40, JOG)
    shared.do(ResetFaults())
    shared.await_true(lambda: not service.snapshot.emergency_stopped, "reset")
    assert shared.positions() == here
    assert [joint.state for joint in service.snapshot.joints] == ["off"] * len(here)
    shared.do(Enable())
    assert "emergency stop by Bob" in shared.told()


def test_a_reset_is_refused_in_plain_words_while_the_cause_lasts(shared: VirtualRig) -> None:
    service = shared.service
    shared.do(Enable())
    shared.served.operate(EmergencyStop(pressed=True))
    shared.await_true(lambda: service.snapshot.emergency_stopped, "emergency stop")
    shared.ask(ResetFaults())
    told = f"reset: {', '.join(ROBOT.joint_names)}: the cause lasts: emergency stop; end it, then reset again"
    shared.await_true(lambda: told in shared.told(), "told")
    shared.served.operate(EmergencyStop(pressed=False))
    shared.idle()
    shared.do(ResetFaults())
    shared.await_true(lambda: not service.snapshot.emergency_stopped, "reset")


def test_a_drive_that_is_off_tells_that_the_emergency_stop_is_pressed(shared: VirtualRig) -> None:
    service = shared.service
    shared.do(Disable())
    shared.served.operate(EmergencyStop(pressed=True))
    shared.await_true(lambda: all(joint.hindrance == STOP_PRESSED for joint in service.snapshot.joints), "pressed")
    assert [joint.state for joint in service.snapshot.joints] == ["off"] * len(HERE)
    assert shared.refusal(Enable()) == f"switch on: {TH1}: {STOP_PRESSED}"
    assert shared.beat_refusal(1 << 40, JOG) == f"jog {TH1}: {TH1}: {STOP_PRESSED}"
    shared.served.operate(EmergencyStop(pressed=False))
    shared.await_true(lambda: not any(joint.hindrance for joint in service.snapshot.joints), "pulled out")
    shared.do(Enable())


@pytest.mark.slow
def test_the_operator_changes_the_speed_of_a_run(shared: VirtualRig) -> None:
    """Slower and faster, with the present speed in the snapshot; what comes too late or from another is refused."""
    service = shared.service
    assert service.snapshot.speed_percent is None
    with refusing(RefusedError):
        service.change_speed(ANN, 50, service.snapshot.number)
    made = demo(service)
    highest = highest_speed(made.plan).percent  # before it runs: the motors turn for it
    shared.ask(made)
    shared.await_true(lambda: service.snapshot.speed_percent == 100, "run")
    with refusing(RefusedError):
        service.change_speed(BOB, 50, service.snapshot.number)
    with refusing(RefusedError):
        service.change_speed(ANN, 50, None)
    for percent in (9, 151):
        with refusing(RefusedError):
            service.change_speed(ANN, percent, service.snapshot.number)
    service.change_speed(ANN, 50, service.snapshot.number)
    shared.await_true(lambda: service.snapshot.speed_percent == 50, "slower")
    service.pause("Bob")
    shared.await_true(lambda: service.snapshot.speed_percent == 0, "paused")
    service.resume(ANN, service.snapshot.number)
    service.change_speed(ANN, highest, service.snapshot.number)
    shared.await_true(lambda: service.snapshot.speed_percent == highest, "as fast as it may be")
    if highest < 150:
        service.change_speed(ANN, 150, service.snapshot.number)
        says = f"speed: speed 150 %: this motion can be made at most {highest} % as fast as planned, by its limits"
        shared.await_true(lambda: any(event.text.startswith(says) for event in service.events.since()), "refused")
    shared.idle()
    assert any(event.text == "speed: 50 % of the planned one" for event in service.events.since())
    done = service.results[-1]
    assert (done.name, done.passed, done.why) == ("demo", True, None)
    for axis in done.placed:
        assert np.abs(axis.error_steps).max() < 0.6  # as a run at one speed
    shared.await_true(lambda: service.snapshot.speed_percent is None, "over")


@pytest.mark.slow
def test_anybody_pauses_and_stops_a_run_and_the_operator_resumes_it(shared: VirtualRig) -> None:
    service = shared.service
    with refusing(RefusedError):
        service.pause()
    shared.ask(demo(service))
    shared.await_true(lambda: bool(service.snapshot.activity and service.snapshot.activity.pausable), "run")
    service.pause("Bob")
    shared.await_true(lambda: bool(service.snapshot.activity and service.snapshot.activity.paused), "paused")
    assert shared.refusal(Enable()) == "switch on: not begun: demo goes on"
    assert shared.beat_refusal(1 << 40, JOG) == "jog th1: not begun: demo goes on"
    with refusing(RefusedError):
        service.resume(BOB, service.snapshot.number)
    service.resume(ANN, service.snapshot.number)
    shared.idle()
    done = service.results[-1]
    assert (done.name, done.passed, done.why) == ("demo", True, None)
    assert done.outcome
    assert all(axis.passed for axis in done.outcome.axes)
    for axis, end in zip(done.placed, done.outcome.axes, strict=True):
        assert axis.t_s[-1] == done.outcome.plan.motion.duration_s
        assert axis.units[-1] == end.end_units
        assert np.abs(axis.error_steps).max() < 0.6  # as a run without a pause: a counter is up to 9/16 step behind
    assert max(np.ptp(axis.units) for axis in done.placed) > 10_000

    run = demo(service)
    here = settled(shared)
    shared.ask(run)
    service.stop("Bob")  # at once: what only waits is dropped, what has begun ends
    assert settled(shared) == here
    shared.ask(demo(service))
    shared.await_true(lambda: not shared.stands(), "motion")
    service.stop("Bob")
    settled(shared)
    assert (service.results[-1].passed, service.results[-1].why) == (None, "stopped")
    shared.await_true(
        lambda: {joint.drive_state for joint in service.snapshot.joints} == {"QUICK STOP ACTIVE"}, "stopped"
    )
    assert not service.snapshot.emergency_stopped
    shared.do(StepJoint(TH1, 1.0))


# --- commands


def write_settings(it: VirtualRig, upper: float, percent: float) -> None:
    """Write some settings, and see that the machine and the service's robot have them."""
    wanted = {"th1.upper": upper, "th1.torque": percent, "supply_max": 30.0}
    it.do(WriteSettings(wanted))
    it.await_true(lambda: wanted.items() <= {each.key: each.value for each in it.service.settings}.items(), "settings")
    assert it.service.robot.joint(TH1).upper == upper


@pytest.mark.slow
def test_commands_do_what_they_say(shared: VirtualRig) -> None:
    service = shared.service
    shared.do(StepJoint(TH1, 2.0))
    assert settled(shared)[0] == pytest.approx(HERE[0] + 2.0, abs=0.1)
    pose = service.snapshot.pose
    assert pose
    shared.do(StepTool({"x": -5.0}))
    settled(shared)
    assert (service.snapshot.pose or {})["x_mm"] == pytest.approx(pose["x_mm"] - 5.0, abs=0.3)
    shared.do(MoveJoints({TH2: HERE[1] + 3.0}, 50.0))
    assert settled(shared)[1] == pytest.approx(HERE[1] + 3.0, abs=0.1)
    target = {"x": pose["x_mm"], "y": pose["y_mm"]}
    shared.do(MoveTool(ToolPosition(target)))
    settled(shared)
    assert (service.snapshot.pose or {})["x_mm"] == pytest.approx(pose["x_mm"], abs=0.3)
    try:
        write_settings(shared, upper=1.0, percent=50.0)
        assert shared.refusal(MoveJoints({TH1: 2.0})).startswith("th1: 2.0 deg is outside ")
        wide = plan(ROBOT, make_job(ROBOT, "demo"))
        assert shared.refusal(RunMotion(wide, "demo")).startswith("demo: was planned for other limits")
    finally:  # the tests after a failed one need the joint's whole travel
        write_settings(shared, upper=ROBOT.joint(TH1).upper, percent=100.0)
    shared.do(Disable())
    shared.await_true(lambda: all(joint.state == "off" for joint in service.snapshot.joints), "off")
    assert service.snapshot.simulated


REFUSALS: dict[str, tuple[Callable[[], Command], str]] = {
    "joint": (lambda: StepJoint("th9", 1.0), "joint 'th9' is unknown"),
    "distance": (lambda: StepJoint(TH1, 0.0), "th1: a step of 0 deg is not from 2.19727e-05 to 260 deg"),
    "speed": (lambda: MoveJoints({TH1: 0.0}, 101.0), "speed: 101 is not above 0 and up to 100 percent"),
    "goal": (lambda: MoveJoints({TH1: 1e3}), "th1: 1000.0 deg is outside "),
    "no goal": (lambda: MoveJoints({}), "move: names no joint"),
    "homing": (lambda: HomeJoint("th9"), "joint 'th9' is unknown"),
    "place": (lambda: DeclareHere((0.0,)), "1 positions for the 4 joints"),
    "output": (lambda: SwitchOutput("laser", True), "output of calibration-scara 'laser' is unknown"),
    "setting": (lambda: WriteSettings({"th1.mass": 1.0}), "setting 'mass' is unknown"),
    "value": (lambda: WriteSettings({"th1.torque": 60.0}), "torque: 60 % is not one of 20, 50, 75, 100 %"),
    "looser": (lambda: WriteSettings({"th1.upper": 1e3}), "th1.upper: 1000.0 deg is outside "),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_wrong_commands_are_refused_at_once(shared: VirtualRig, what: str) -> None:
    shared.service.operator.take(ANN, "Ann")
    shared.idle()
    command, why = REFUSALS[what]
    assert shared.refusal(command()).startswith(why)


# --- what the network holds up


def another_program(it: VirtualRig, patch: pytest.MonkeyPatch) -> Session:
    """Return a session of another program on the same board, such as `steptwin estop`."""
    return Session(Neighbour(it.board, patch, it.pass_time), ROBOT)


def held_up(it: VirtualRig, command: Command, shown: int) -> str:
    """Let a command come that was asked for from an earlier state; return why it is refused."""
    with pytest.raises(RefusedError) as refused:
        it.service.ask(ANN, command, shown)
    return str(refused.value)


@pytest.mark.slow
def test_a_click_from_before_a_stop_and_its_reset_never_moves_the_machine(
    shared: VirtualRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Made by the service or by another program; a click from after the reset counts again."""
    service = shared.service
    shared.do(Enable())
    for elsewhere in (True, False):
        shared.fresh()
        clicked = service.snapshot.number
        if elsewhere:
            other = another_program(shared, monkeypatch)
            emergency_stop(other)
            reset(other)
        else:
            service.emergency_stop("Bob")
            shared.await_true(lambda: all(joint.drive_state == "FAULT" for joint in service.snapshot.joints), "held")
            shared.do(ResetFaults())
        shared.await_true(lambda: not service.snapshot.emergency_stopped, "reset")
        shared.idle()
        here = shared.positions()
        for command in (HomeAll(), Enable(), MoveJoints({TH1: HERE[0] + 5.0})):
            assert ("void, since" in (why := held_up(shared, command, clicked))) or "too late" in why
        with refusing(RefusedError):
            service.beat(ANN, 1 << 30, JOG, clicked)
        assert settled(shared) == here
        assert {joint.state for joint in service.snapshot.joints} == {"off"}
        shared.do(Enable())


def test_a_reset_answers_no_emergency_stop_that_came_after_its_click(
    shared: VirtualRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = shared.service
    shared.do(Enable())
    service.emergency_stop("Bob")
    shared.await_true(lambda: all(joint.drive_state == "FAULT" for joint in service.snapshot.joints), "held")
    shared.idle()
    shared.fresh()
    clicked = service.snapshot.number
    emergency_stop(another_program(shared, monkeypatch))  # again: nothing changes that a page could show
    try:
        service.ask(ANN, ResetFaults(), clicked)
    except RefusedError as error:  # this computer was slow
        assert "too late" in str(error)  # noqa: PT017
    else:
        shared.idle()
        assert any("it stays; look at the machine, then reset again" in text for text in shared.told())
    shared.pass_time(0.2)
    assert {joint.drive_state for joint in service.snapshot.joints} == {"FAULT"}
    shared.do(ResetFaults())
    shared.await_true(lambda: not service.snapshot.emergency_stopped, "reset")


@pytest.mark.slow
def test_what_goes_on_ends_for_good_by_an_emergency_stop_that_is_reset_at_once(
    shared: VirtualRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The machine's own button, pressed and pulled out, and a reset by any master of the bus."""
    service = shared.service
    shared.ask(HomeAll())
    shared.await_true(lambda: not shared.stands(), "motion")
    shared.served.operate(EmergencyStop(pressed=True))
    shared.await_true(lambda: service.snapshot.emergency_stopped, "stopped")
    shared.served.operate(EmergencyStop(pressed=False))
    shared.idle()
    here = settled(shared)
    reset(another_program(shared, monkeypatch))
    shared.await_true(lambda: not service.snapshot.emergency_stopped, "reset")
    assert settled(shared) == here
    assert {joint.state for joint in service.snapshot.joints} == {"off"}


def test_another_operator_voids_what_the_last_one_has_clicked(shared: VirtualRig) -> None:
    service = shared.service
    shared.do(Enable())
    shared.fresh()
    clicked = service.snapshot.number
    service.operator.give_up(ANN)
    service.operator.take(BOB, "Bob")
    service.operator.give_up(BOB)
    service.operator.take(ANN, "Ann")
    why = held_up(shared, Enable(), clicked)
    assert "void, since the operator changed after it was asked for" in why or "too late" in why


@pytest.mark.slow
def test_beats_that_come_late_end_the_jog(shared: VirtualRig) -> None:
    """A release would come as late as they do."""
    service = shared.service
    press = shared.pressed(JOG)
    held = service.snapshot.number

    def beat_on() -> None:
        for _ in range(600):
            service.beat(ANN, press, JOG, held)
            shared.pass_time(0.05)

    with refusing(RefusedError):
        beat_on()
    settled(shared)
    assert shared.beat_refusal(press, JOG).startswith("jog th1: too late: ")


def test_a_press_of_the_emergency_stop_counts_once(shared: VirtualRig) -> None:
    """Its copy that comes by the other way after the reset stops nothing."""
    service = shared.service
    shared.do(Enable())
    assert service.emergency_stop("Bob", "a press")
    shared.await_true(lambda: all(joint.drive_state == "FAULT" for joint in service.snapshot.joints), "held")
    told = shared.told().count("emergency stop by Bob")
    assert service.emergency_stop("Bob", "a press")
    assert shared.told().count("emergency stop by Bob") == told
    shared.idle()
    shared.do(ResetFaults())
    shared.await_true(lambda: not service.snapshot.emergency_stopped, "reset")
    assert service.emergency_stop("Bob", "a press")
    shared.do(Enable())
