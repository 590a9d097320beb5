"""Answer the requests of the control port that harm a served board, and write what was done as such requests."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from steptwin.emulator.operations import Operation
from steptwin.features.faults.kinds import HARMS
from steptwin.features.faults.kinds.harm import Harm
from steptwin.features.faults.requests import read_request, request_of

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.live.live_board import LiveBoard

names: Final = tuple(harm.do for harm in HARMS)


def answer(board: "LiveBoard", request: Mapping[str, Any]) -> Mapping[str, Any]:
    """Do the harm that is requested; the machine's state tells the rest."""
    harm = read_request(board.robot, request)
    if harm is not None:
        board.operate(harm)
    return {}


def written(robot: "Robot", operation: Operation) -> Mapping[str, Any] | None:
    """Return the request that asks for a harm."""
    return request_of(robot, operation) if isinstance(operation, Harm) else None
