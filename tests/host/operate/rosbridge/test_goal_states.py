"""The table of a goal's states, against the design article's diagram written again as paths."""

from itertools import product

import pytest

from steptwin.host.operate.rosbridge.goal_states import TRANSITIONS, ActiveGoal, GoalEvent, GoalState

PATHS = [
    ("BEGUN REACHED", 4),
    ("BEGUN FAILED", 6),
    ("FAILED", 6),
    ("CANCEL STOPPED", 5),
    ("BEGUN CANCEL STOPPED", 5),
    ("BEGUN CANCEL CANCEL STOPPED", 5),
    ("BEGUN CANCEL FAILED", 6),
]
"""Events of a goal, and the number of its last state in action_msgs/msg/GoalStatus."""


@pytest.mark.parametrize(("events", "number"), PATHS)
def test_a_goals_way(events: str, number: int) -> None:
    goal = ActiveGoal("g", {})
    for name in events.split():
        assert not goal.state.ended
        goal.take(GoalEvent[name])
    assert goal.state == number
    assert goal.state.ended


def test_every_transition_is_on_a_way_and_no_other_happens() -> None:
    used = set()
    for events, _ in PATHS:
        goal = ActiveGoal("g", {})
        for name in events.split():
            used.add((goal.state, GoalEvent[name]))
            goal.take(GoalEvent[name])
    assert used == set(TRANSITIONS)
    for state, event in product(GoalState, GoalEvent):
        if (state, event) not in TRANSITIONS:
            goal = ActiveGoal("g", {})
            goal.state = state
            with pytest.raises(ValueError, match=f"{event.name} does not happen to a goal that is {state.name}"):
                goal.take(event)
