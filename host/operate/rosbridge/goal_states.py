"""The states of a goal, as ROS 2 has them, and what leads from one to another.

Source: "Actions" in the design articles of ROS 2 (goal states), and action_msgs/msg/GoalStatus for the numbers.
"""

from enum import Enum, IntEnum
from typing import Final


class GoalState(IntEnum):
    """State of a goal, with its number in action_msgs/msg/GoalStatus."""

    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def ended(self) -> bool:
        """True if nothing follows."""
        return self >= GoalState.SUCCEEDED


class GoalEvent(Enum):
    """What happens to a goal."""

    BEGUN = "the axes have set off"
    CANCEL = "somebody asks to cancel it"
    REACHED = "the axes stand at its end"
    STOPPED = "the axes rest, since it was canceled"
    FAILED = "it was refused, or has failed"


TRANSITIONS: Final = {
    (GoalState.ACCEPTED, GoalEvent.BEGUN): GoalState.EXECUTING,
    (GoalState.ACCEPTED, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.ACCEPTED, GoalEvent.FAILED): GoalState.ABORTED,
    (GoalState.EXECUTING, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.EXECUTING, GoalEvent.REACHED): GoalState.SUCCEEDED,
    (GoalState.EXECUTING, GoalEvent.FAILED): GoalState.ABORTED,
    (GoalState.CANCELING, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.CANCELING, GoalEvent.STOPPED): GoalState.CANCELED,
    (GoalState.CANCELING, GoalEvent.FAILED): GoalState.ABORTED,
}
"""The state that follows on an event; what is not here does not happen."""


class ActiveGoal:
    """A goal from its arrival to its result."""

    def __init__(self, goal_id: str, args: object) -> None:
        self.goal_id = goal_id
        self.args = args
        self.state: GoalState = GoalState.ACCEPTED

    def take(self, event: GoalEvent) -> None:
        """Go on to the state that follows on an event; raise ValueError if the event cannot happen now."""
        after = TRANSITIONS.get((self.state, event))
        if after is None:
            raise ValueError(f"{self.goal_id}: {event.name} does not happen to a goal that is {self.state.name}")
        self.state = after
