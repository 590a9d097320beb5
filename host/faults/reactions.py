"""The documented reaction to each harm, as one table: the page docs/faults.md shows it, tests walk through it.

The first row whose condition holds is the documented one. A condition may depend on what the machine is doing when the
fault begins: a limit switch stops only an axis that moves towards it. Where it depends on what comes later as well, the
reaction is not certain: both it and none are right.
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import Final

from steptwin.emulator.faults.harm import AxisOperation, Harm, Operation
from steptwin.emulator.faults.host import HostFault, HostFaultKind
from steptwin.host.faults import bus_reactions, machine_reactions, wiring_reactions
from steptwin.host.faults.reaction import (
    HEARTBEAT_MS,
    HOST_LOST,
    QUEUE_MS,
    RUN_DRY,
    Documented,
    Motion,
    Reaction,
    stops,
)
from steptwin.host.faults.target import Moment
from steptwin.protocol.cia402 import State


def _host(kind: HostFaultKind) -> Callable[[Harm, Moment], bool]:
    return lambda harm, _: isinstance(harm, HostFault) and harm.kind is kind


_HOST_ROWS: Final[tuple[Documented, ...]] = (
    Documented(
        "host hangs, its heartbeat goes on",
        _host(HostFaultKind.HANG),
        stops(*RUN_DRY, begins_ms=QUEUE_MS, certain=False),
        "the queues bridge it, up to the points that are in them",
    ),
    Documented(
        "host dies",
        _host(HostFaultKind.DEATH),
        stops(*HOST_LOST, begins_ms=HEARTBEAT_MS),
        "records of less than 6 ms run out before the heartbeat is missed",
    ),
    Documented(
        "host dies and starts again",
        _host(HostFaultKind.RESTART),
        Reaction(Motion.RAMP, HOST_LOST, State.OPERATION_ENABLED, HEARTBEAT_MS, certain=False),
        "the new one waits for rest, resets the fault and enables the drives; the motion is not continued",
    ),
    Documented(
        "host is late",
        _host(HostFaultKind.LATE),
        stops(*RUN_DRY, begins_ms=inf, certain=False),
        "the queues bridge it, up to the points that are in them",
    ),
    Documented(
        "host sends points out of order",
        _host(HostFaultKind.DISORDER),
        stops(*RUN_DRY, begins_ms=inf, certain=False),
        "the board reports each gap and the host sends the points again; if it lasts, the queues run dry",
    ),
)


DOCUMENTED: Final = (*machine_reactions.ROWS, *wiring_reactions.ROWS, *bus_reactions.ROWS, *_HOST_ROWS)
"""Every row; those of one kind of harm, among which the order matters, are in one module."""


def documented(harm: Harm, moment: Moment) -> Documented:
    """Return the row for a harm that begins while the machine does this."""
    return next(row for row in DOCUMENTED if row.applies(harm, moment))


def concerned(harm: Harm, boards: Sequence[int]) -> list[int]:
    """Return the axes, whose boards have these numbers, that answer a harm; those of their group stop with them.

    What is done to a board concerns all axes on it.
    """
    axes = range(len(boards))
    if isinstance(harm, AxisOperation):
        return [harm.axis]
    if isinstance(harm, Operation) and harm.place is not None:
        return [each for each in axes if boards[each] == boards[harm.place]]
    return list(axes)
