"""Documented reactions to faults of the host: it hangs, dies, restarts, is late, or mixes its points up."""

from collections.abc import Callable
from math import inf
from typing import Final

from steptwin.host.twin.scenarios.harms import Harm, HostFault, HostFaultKind
from steptwin.host.twin.scenarios.moment import Moment
from steptwin.host.twin.scenarios.reaction import HOST_LOST, RUN_DRY, Documented, Motion, Reaction, stops
from steptwin.host.twin.scenarios.reaction_times import HEARTBEAT_MS, QUEUE_MS
from steptwin.protocol.cia402 import State


def _host(kind: HostFaultKind) -> Callable[[Harm, Moment], bool]:
    return lambda harm, _: isinstance(harm, HostFault) and harm.kind is kind


ROWS: Final[tuple[Documented, ...]] = (
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
