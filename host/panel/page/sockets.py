"""What a page's web socket carries beside NiceGUI's own messages: the state that it had shown, and emergency stops.

The page's script adds the number of the newest state to each event that it sends (`shown`). An event that the network
held up keeps the number of its click.
"""

from collections.abc import Callable
from contextvars import ContextVar
from typing import Any, Final

from nicegui import app, core
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

SHOWN: Final[ContextVar[int | None]] = ContextVar("shown", default=None)
"""Number of the newest state that the page had shown when it sent the event that is handled now."""

_SPACE: Final = "/"
_EVENT: Final = "event"
_PRESS_MAX: Final = 64
"""Most characters of the name of a press."""

Answer = dict[str, bool]
"""What a page is told of its stop: `told` says whether the machine was."""


def note_shown() -> None:
    """Note the state that pages had shown with each of their events, from now on."""
    handle = core.sio.handlers[_SPACE][_EVENT]
    if not isinstance(handle, _Noting):
        core.sio.on(_EVENT, _Noting(handle))


def on_stop(name: str, stop: Callable[[str | None, str | None], Answer]) -> None:
    """Call `stop` with the page and the press when a page sends a stop of this name, by its socket or a request.

    A press has a name that the page gives it. It comes on both ways, and again until it is answered: the socket may be
    dead, and the request comes on a connection of its own.
    """

    def by_socket(sid: str, press: object = None) -> Answer:
        rooms = [room for room in core.sio.rooms(sid) if room != sid]  # a page's socket is in a room named after it
        return stop(rooms[0] if rooms else None, None if press is None else str(press)[:_PRESS_MAX])

    async def by_request(request: Request) -> Response:
        query = request.query_params
        press = query.get("press")
        return JSONResponse(stop(query.get("page"), None if press is None else press[:_PRESS_MAX]))

    core.sio.on(name, by_socket)
    app.add_route(f"/{name}", by_request, methods=["POST"])


class _Noting:
    """Hands an event on, with `SHOWN` as it says; drops what is no event."""

    def __init__(self, handle: Callable[[str, Any], None]) -> None:
        self._handle = handle

    def __call__(self, sid: str, message: Any = None) -> None:
        if not isinstance(message, dict):
            return
        shown = message.pop("shown", None)
        SHOWN.set(shown if type(shown) is int else None)
        self._handle(sid, message)
