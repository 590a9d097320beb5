"""Whatever a server says, and whenever: the bridge answers each goal once, and raises nothing but its own errors."""

import json
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.features.ros2.goals import GoalState, RefusedGoalError, follow_goal
from steptwin.host.common.errors import InputError
from steptwin.protocol import od
from steptwin.protocol.cia402 import State
from tests.features.ros2.stub_rosbridge import ACTION, END, FORTH, NAMES, cancel, goal, served
from tests.host.operate.sessions import HOME, ROBOT, board_at, preset

KEYS = [
    *("op", "id", "action", "args", "msg", "trajectory", "header", "stamp", "joint_names", "points", "positions"),
    *("velocities", "accelerations", "effort", "time_from_start", "sec", "nanosec", "path_tolerance"),
    *("goal_tolerance", "component_goal_tolerance", "goal_time_tolerance", "name", "position"),
]
WORDS = ["send_action_goal", "cancel_action_goal", "status", ACTION, "g1", *ROBOT.joint_names]
VALUES: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(WORDS) | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=6),
    max_leaves=12,
)
PLACES = [
    ("trajectory",),
    ("trajectory", "header"),
    ("trajectory", "header", "stamp"),
    ("trajectory", "joint_names"),
    ("trajectory", "joint_names", 1),
    ("trajectory", "points"),
    ("trajectory", "points", 1),
    ("trajectory", "points", 1, "positions"),
    ("trajectory", "points", 1, "positions", 2),
    ("trajectory", "points", 0, "velocities"),
    ("trajectory", "points", 2, "time_from_start"),
    ("trajectory", "points", 2, "time_from_start", "sec"),
    ("path_tolerance",),
    ("goal_tolerance",),
    ("component_goal_tolerance",),
    ("goal_time_tolerance",),
]


@pytest.mark.slow
@given(VALUES)
def test_any_message_is_understood_or_refused(value: Any) -> None:
    for text in (json.dumps(value), str(value), repr(value).encode()):
        with suppress(InputError):
            NAMES.parsed(text)


@pytest.mark.slow
@given(st.sampled_from(PLACES), VALUES)
def test_a_goal_with_anything_in_a_place_is_accepted_or_refused(place: tuple[Any, ...], value: Any) -> None:
    args = json.loads(json.dumps(FORTH))
    inner = args
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    with suppress(RefusedGoalError):
        assert follow_goal(ROBOT, args, HOME).plan.start_joints == pytest.approx(HOME)


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(0.0, 3.0), st.sampled_from(["goal", "cancel"]), st.integers(0, 2)), max_size=6))
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_each_goal_has_one_result_and_the_machine_rests(
    fast_kernel: Kernel, said: list[tuple[float, str, int]]
) -> None:
    session = preset(board_at(HOME, fast_kernel), HOME)
    script: list[Any] = [
        (at_s, goal(FORTH, f"g{number}.{name}") if what == "goal" else cancel(f"g{number - 1}.{name}"))
        for number, (at_s, what, name) in enumerate(sorted(said))
    ]
    stub, _ = served(session, *script, (6.0, END))
    sent = [message["id"] for _, message in script if message["op"] == "send_action_goal"]
    results = stub.results()
    assert sorted(name for name, *_ in results) == sorted(sent)
    assert all(GoalState(status).ended for _, status, _, _ in results)
    states = {State.of(axis.read(od.STATUSWORD)) for axis in session.machine.axes}
    assert states in ({State.OPERATION_ENABLED}, {State.QUICK_STOP_ACTIVE})


def test_a_text_that_is_no_unicode_or_endless_is_refused() -> None:
    for text in (b"\xff", "[" * 100_000, '{"op": ' + "9" * 5000 + "}"):
        with pytest.raises(InputError):
            NAMES.parsed(text)
