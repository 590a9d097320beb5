"""What makes a harm of the values of a request, and a request of a harm: a row for each kind."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from steptwin.host.common.tables import Reading
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.scenarios.harms import Harm


@dataclass(frozen=True, slots=True)
class HarmKind:
    """What a kind of request becomes.

    Attributes:
        make: returns the harm for a robot and the values by their keys, None for one that is missing; raises
            InputError.
        readings: of the values for which it is not enough that they are of their kind.
    """

    make: Callable[..., Harm]
    readings: Mapping[str, Reading] = field(default_factory=dict)


Writer = Callable[[Robot, Any], dict[str, Any]]
"""Returns the keys of the request that asks for a harm, `do` among them; those that are None are left out."""


def place(robot: Robot, joint: str | None) -> int | None:
    """Return the axis of a joint that need not be named."""
    return None if joint is None else robot.index_of(joint)


def joint_at(robot: Robot, axis: int | None) -> str | None:
    """Return the joint of an axis; None for None."""
    return None if axis is None else robot.joint_names[axis]


def by_fields(harm: Any) -> dict[str, Any]:
    """Return the name and the fields of a harm for which nobody can ask."""
    return {"do": type(harm).__name__, **asdict(harm)}
