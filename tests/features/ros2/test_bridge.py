"""The bridge against a scripted rosbridge, in virtual time: what it advertises, tells and does with goals."""

import json
from itertools import pairwise
from math import pi
from typing import Any

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.ros2.bridge import RosBridge, RosbridgeLostError
from steptwin.features.ros2.goals import GoalState
from steptwin.host.common.errors import BusError
from steptwin.host.operate.recovering import stop
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import State
from tests.features.ros2.stub_rosbridge import (
    ACTION,
    END,
    EXECUTED,
    FORTH,
    LOST,
    NAMES,
    StubRosbridge,
    arguments,
    cancel,
    goal,
    in_ros,
    moved,
    point,
    served,
)
from tests.host.client.machines import Neighbour
from tests.host.operate.sessions import HALF_STEPS, HOME, ROBOT, board_at
from tests.messages import refusing

pytestmark = pytest.mark.slow

TH1 = ROBOT.joint_names.index("th1")


def standing(session: Session) -> list[float]:
    return session.positions(session.machine.positions_units())


def states(session: Session) -> set[State]:
    return {State.of(axis.read(od.STATUSWORD)) for axis in session.machine.axes}


def test_it_advertises_tells_the_joints_ten_times_a_second_and_withdraws(session: Session) -> None:
    stub, lines = served(session, (2.0, END))
    told = [message for _, message in stub.told]
    assert told[:2] == [
        {"op": "advertise", "topic": "/joint_states", "type": "sensor_msgs/msg/JointState"},
        {"op": "advertise_action", "action": ACTION, "type": "control_msgs/action/FollowJointTrajectory"},
    ]
    assert told[-2:] == [
        {"op": "unadvertise_action", "action": ACTION},
        {"op": "unadvertise", "topic": "/joint_states"},
    ]
    published, times = stub.of("publish"), stub.times_of("publish")
    assert len(published) in (20, 21)
    assert all(0.085 <= after - before <= 0.115 for before, after in pairwise(times))
    assert {message["topic"] for message in published} == {"/joint_states"}
    last = published[-1]["msg"]
    assert last["name"] == list(ROBOT.joint_names)
    assert last["position"] == pytest.approx(in_ros(standing(session)), abs=1e-12)
    assert lines == []


def test_a_board_that_nobody_has_homed_tells_no_positions(fast_kernel: Kernel) -> None:
    session = Session(board_at(HOME, fast_kernel), ROBOT)
    stub, _ = served(session, (0.5, goal(FORTH)), (2.0, END))
    assert stub.of("publish") == []
    assert stub.results() == [
        ("g1", 6, -1, f"{ROBOT.axis_names[0]}: the position is unknown: home the machine first, `steptwin home`")
    ]


def test_a_goal_moves_the_machine_to_its_end(session: Session) -> None:
    stub, lines = served(session, (0.5, goal(FORTH)), (4.0, END))
    assert stub.results() == [("g1", *EXECUTED)]
    assert lines == ["g1: ACCEPTED", "g1: SUCCEEDED"]
    (end_s,) = stub.times_of("action_result")
    assert 2.5 <= end_s <= 3.2  # two seconds, and the time to set it up
    reached = moved(th1=20.0)
    for actual, planned, tolerance in zip(standing(session), reached, HALF_STEPS, strict=True):
        assert actual == pytest.approx(planned, abs=tolerance)
    assert states(session) == {State.OPERATION_ENABLED}
    published = [message["msg"]["position"][TH1] for message in stub.of("publish")]
    assert published == sorted(published)
    assert published[-1] == pytest.approx((HOME[TH1] + 20.0) * pi / 180.0, abs=1e-3)


def test_feedback_ten_times_a_second_says_where_the_joints_should_be_and_are(session: Session) -> None:
    stub, _ = served(session, (0.5, goal(FORTH)), (4.0, END))
    told = [message["values"] for message in stub.of("action_feedback")]
    assert 18 <= len(told) <= 23
    for values in told:
        assert values["joint_names"] == list(ROBOT.joint_names)
        desired, actual = (values[key]["positions"][TH1] for key in ("desired", "actual"))
        assert values["error"]["positions"][TH1] == pytest.approx(desired - actual, abs=1e-12)
        assert abs(desired - actual) <= 0.11 * 15.0 * pi / 180.0  # 0.1 s of reports' age at the spline's 15 deg/s
    times = [
        each["desired"]["time_from_start"]["sec"] + each["desired"]["time_from_start"]["nanosec"] / 1e9 for each in told
    ]
    assert times == sorted(times)
    assert times[-1] <= 2.0


def test_two_goals_one_after_the_other(session: Session) -> None:
    back = arguments(point(0.0, moved(th1=20.0)), point(2.0, HOME))
    stub, _ = served(session, (0.5, goal(FORTH)), (4.0, goal(back, "g2")), (8.0, END))
    assert stub.results() == [("g1", *EXECUTED), ("g2", *EXECUTED)]
    assert standing(session)[TH1] == pytest.approx(HOME[TH1], abs=HALF_STEPS[TH1])


def test_a_goal_from_joint_states_begins_half_a_step_beside_the_demand(session: Session) -> None:
    """MoveIt begins where joint_states says the joints are, a whole step, which the demand is not."""
    stub, _ = served(session, (0.5, goal(FORTH)), (4.0, END))
    names, told = ROBOT.joint_names, stub.of("publish")[-1]["msg"]["position"]
    assert told[TH1] != in_ros(moved(th1=20.0))[TH1]
    args = arguments(point(0.0, HOME), point(2.0, HOME))
    args["trajectory"]["points"][0]["positions"] = told
    assert args["trajectory"]["joint_names"] == list(names)
    stub, _ = served(session, (0.5, goal(args)), (4.0, END))
    assert stub.results() == [("g1", *EXECUTED)]


def test_a_second_goal_is_refused_while_one_is_under_way(session: Session) -> None:
    stub, _ = served(session, (0.5, goal(FORTH)), (1.5, goal(FORTH, "g2")), (4.0, END))
    assert stub.results() == [
        ("g2", 6, -1, "g1 is under way: cancel it first, or wait"),
        ("g1", *EXECUTED),
    ]


def test_a_canceled_goal_stops_the_axes(session: Session) -> None:
    stub, _ = served(session, (0.5, goal(FORTH)), (1.7, cancel()), (4.0, END))
    assert stub.results() == [("g1", 5, 0, "canceled: the axes have made a quick stop")]
    (end_s,) = stub.times_of("action_result")
    assert 1.7 <= end_s <= 2.2
    at = standing(session)[TH1]
    assert HOME[TH1] + 1.0 < at < HOME[TH1] + 19.0
    assert states(session) == {State.QUICK_STOP_ACTIVE}


def test_a_goal_after_a_canceled_one(session: Session) -> None:
    on = arguments(point(2.0, moved(th1=20.0)))
    stub, _ = served(session, (0.5, goal(FORTH)), (1.7, cancel()), (3.0, goal(on, "g2")), (7.0, END))
    assert [result[:2] for result in stub.results()] == [("g1", 5), ("g2", 4)]
    assert standing(session)[TH1] == pytest.approx(HOME[TH1] + 20.0, abs=HALF_STEPS[TH1])


def test_cancellations_that_concern_no_goal_are_left_out(session: Session) -> None:
    foreign = {**cancel(), "action": "/other/follow_joint_trajectory"}
    stub, _ = served(session, (0.2, cancel()), (0.5, goal(FORTH)), (1.5, cancel("g7")), (1.6, foreign), (4.0, END))
    assert stub.results() == [("g1", *EXECUTED)]


def test_a_cancellation_right_behind_its_goal_lets_nothing_move(session: Session) -> None:
    stub, _ = served(session, (0.5, goal(FORTH)), (0.5, cancel()), (2.0, END))
    assert [result[:2] for result in stub.results()] == [("g1", 5)]
    assert standing(session)[TH1] == HOME[TH1]


def test_a_lost_connection_stops_the_axes(session: Session) -> None:
    stub = StubRosbridge(session, [(0.5, goal(FORTH)), (1.7, LOST)])
    with refusing(RosbridgeLostError):
        RosBridge(session, stub, NAMES).run()
    assert stub.now_s() <= 2.2
    assert states(session) == {State.QUICK_STOP_ACTIVE}
    assert HOME[TH1] + 1.0 < standing(session)[TH1] < HOME[TH1] + 19.0


def test_ctrl_c_amid_a_goal_stops_the_axes(session: Session) -> None:
    stub = StubRosbridge(session, [(0.5, goal(FORTH)), (1.7, END)])
    with pytest.raises(KeyboardInterrupt):
        RosBridge(session, stub, NAMES).run()
    assert stub.results() == [("g1", 6, -4, "the bridge was ended")]
    assert states(session) == {State.QUICK_STOP_ACTIVE}


def test_a_stop_by_another_program_ends_the_goal_but_not_the_bridge(
    session: Session, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Session(Neighbour(board, monkeypatch), ROBOT)
    again = arguments(point(2.0, moved(th1=20.0)))
    stub, _ = served(
        session, (0.5, goal(FORTH)), (1.7, lambda: void(stop(other))), (3.0, goal(again, "g2")), (7.0, END)
    )
    (first, second) = stub.results()
    assert first[:3] == ("g1", 6, -4)
    assert "was stopped, the drive is in QUICK STOP ACTIVE" in first[3]
    assert second == ("g2", *EXECUTED)


def void(_: object) -> None:
    """Take what a call returns."""


def test_a_silent_board_ends_the_bridge(
    session: Session, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    stub = StubRosbridge(session, [(0.5, lambda: monkeypatch.setattr(board.network, "notify", lambda *_: None))])
    with refusing(BusError):
        RosBridge(session, stub, NAMES).run()
    assert stub.now_s() <= 2.0


def test_a_goal_that_ends_too_late_is_stopped(
    session: Session, board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another program halts the trajectory; the goal allows half a second."""
    from steptwin.host.client.pausing import pause_trajectory

    other = Session(Neighbour(board, monkeypatch), ROBOT)
    args = {**FORTH, "goal_time_tolerance": {"sec": 0, "nanosec": 500_000_000}}
    stub, _ = served(session, (0.5, goal(args)), (1.5, lambda: void(pause_trajectory(other.machine))), (9.0, END))
    assert stub.results() == [
        ("g1", 6, -5, "the trajectory's end is 0.5 s late, as late as goal_time_tolerance allows")
    ]
    (end_s,) = stub.times_of("action_result")
    assert 3.2 <= end_s <= 4.2


def test_an_end_beside_the_tolerance_is_no_success(session: Session) -> None:
    """Less than a step, which the machine can keep at few ends only."""
    args = {**FORTH, "goal_tolerance": [{"name": "th1", "position": 1e-9, "velocity": 0.0, "acceleration": 0.0}]}
    stub, _ = served(session, (0.5, goal(args)), (4.0, END))
    ((_, status, code, text),) = stub.results()
    assert (status, code) == (6, -5)
    assert text.startswith("th1: stands 0.0")
    assert text.endswith(" deg from the end (limit: 0.0000 deg)")


@pytest.mark.parametrize(
    "junk",
    ["", "[]", "{", "5", "null", '{"op": 5}', json.dumps({**goal({}), "id": 5}), json.dumps({**cancel(), "id": None})],
)
def test_junk_is_dropped_and_told(session: Session, junk: str) -> None:
    stub, lines = served(session, (0.2, junk), (0.5, goal(FORTH)), (4.0, END))
    assert stub.results() == [("g1", *EXECUTED)]
    assert lines[0].startswith("a message of the server was dropped: ")


@pytest.mark.parametrize("args", [None, 5, [], {}, {"trajectory": None}, {"trajectory": {"points": 5}}, {"x": 1}])
def test_goals_of_junk_are_refused(session: Session, args: Any) -> None:
    stub, _ = served(session, (0.2, goal(args)), (1.0, END))
    assert [result[:3] for result in stub.results()] == [("g1", 6, -1)]
    assert standing(session) == pytest.approx(HOME, abs=max(HALF_STEPS))


def test_what_the_server_says_is_told(session: Session) -> None:
    """A rosbridge of before 2024 knows no actions."""
    says = {"op": "status", "level": "error", "msg": "Unknown operation: advertise_action"}
    _, lines = served(session, (0.2, says), (0.3, {"op": "publish", "topic": "/x", "msg": {}}), (0.5, END))
    assert lines == ["the server says: Unknown operation: advertise_action"]


def test_it_counts_how_goals_ended(session: Session) -> None:
    stub = StubRosbridge(session, [(0.2, goal({})), (0.5, goal(FORTH, "g2")), (1.7, cancel("g2")), (4.0, END)])
    bridge = RosBridge(session, stub, NAMES)
    bridge.run()
    assert bridge.ends == {GoalState.ABORTED: 1, GoalState.CANCELED: 1}
