"""What answered a fault: the errors that were told on the bus from its beginning to that of the next one."""

from collections.abc import Sequence
from math import inf

from steptwin.host.twin.scenarios.engine import Emergency, Engine
from steptwin.host.twin.scenarios.moment import Moment
from steptwin.host.twin.scenarios.report import Told
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND


def answers(engine: Engine, began: Moment) -> list[Emergency]:
    """Return the errors that were told from the beginning of a fault to that of the next one, whose answers follow."""
    until_counts = _next_counts(engine, began)
    return [each for each in _told_since(engine, began) if each.counts < until_counts]


def later_errors(engine: Engine, began: Moment) -> list[Emergency]:
    """Return the errors that were told after the fault next to this one had begun."""
    from_counts = _next_counts(engine, began)
    return [each for each in _told_since(engine, began) if each.counts >= from_counts]


def told(engine: Engine, emergencies: Sequence[Emergency], began: Moment) -> tuple[Told, ...]:
    """Return errors with the names of their joints, and how long after a fault's beginning they were on the bus."""
    names = engine.target.robot.joint_names
    return tuple(
        Told(names[each.axis], each.code, (each.counts - began.counts) / COUNTS_PER_MS) for each in emergencies
    )


def seconds(engine: Engine, counts: int) -> float:
    """Return an instant in seconds from the motion's start; from power-up if there was no motion."""
    return (counts - (engine.start_counts or 0)) / COUNTS_PER_SECOND


def _told_since(engine: Engine, began: Moment) -> list[Emergency]:
    return [each for each in engine.emergencies if each.counts >= began.counts and each.code]


def _next_counts(engine: Engine, began: Moment) -> float:
    """Return the instant at which the next fault begins; infinity if none does."""
    begins = [each.began.counts for each in engine.played if each.began is not None]
    return min((counts for counts in begins if counts > began.counts), default=inf)
