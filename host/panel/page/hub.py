"""What all browsers share: one look at the desk a tick, and one message with it for every browser."""

import json
from collections.abc import Hashable
from typing import Final

from nicegui import Client, app, core, ui
from starlette.requests import Request
from starlette.responses import Response

from steptwin.host.client.control_client import ControlClient
from steptwin.host.panel.desk import Desk, Snapshot
from steptwin.host.panel.page.page import Page
from steptwin.host.panel.page.ticks import tick_of
from steptwin.host.panel.page.visitor import Visitor

TICK_S: Final = 1 / 30


class Hub:
    """Makes a page for each browser and keeps all of them up to date."""

    def __init__(self, desk: Desk, positions_file: str, control: ControlClient | None = None) -> None:
        """Share a desk, the file of saved positions, and the control port of a served board."""
        self._desk = desk
        self._positions_file = positions_file
        self._control = control
        self._pages: dict[str, Page] = {}
        self._names: dict[str, str] = {}
        self._seen: Hashable = None
        self._time_s = 0.0

    def start(self) -> None:
        """Follow the desk from now on; call this before the server runs."""
        app.timer(TICK_S, self.tick, immediate=False)
        app.add_route("/emergency-stop", self._emergency_stop, methods=["POST"])

    def build(self) -> None:
        """Make the page of the browser that asks for it; its tab is the desk's client, which outlives a reload."""
        client = ui.context.client
        visitor = Visitor(self._desk, client)
        page = Page(visitor, self._positions_file, self._control)
        page.refresh(self._desk.snapshot)
        self._pages[client.id] = page

        def connected() -> None:
            visitor.tab = client.tab_id or client.id
            visitor.name = self._names.setdefault(visitor.tab, f"browser {len(self._names) + 1}")
            page.arrive()
            page.refresh(self._desk.snapshot)

        client.on_connect(connected)
        client.on_delete(lambda: self._leave(client, visitor))

    def _leave(self, client: Client, visitor: Visitor) -> None:
        """Let the tab go, unless another page of it is open, as after a reload."""
        self._pages.pop(client.id, None)
        if all(page.visitor.tab != visitor.tab for page in self._pages.values()):
            self._desk.gone(visitor.tab)

    async def tick(self) -> None:
        """Send the newest snapshot to all browsers, and let their views follow what has changed."""
        snapshot = self._desk.snapshot
        if snapshot.connected and snapshot.time_s != self._time_s:
            self._time_s = snapshot.time_s
            text = json.dumps(tick_of(snapshot))
            for client_id in list(self._pages):
                await core.sio.emit("tick", text, room=client_id)
        seen = self._changes(snapshot)
        if seen != self._seen:
            self._seen = seen
            for page in list(self._pages.values()):
                page.refresh(snapshot)

    def _changes(self, snapshot: Snapshot) -> Hashable:
        """Return all that views show beside the numbers of a tick; while it stays the same they need not look."""
        activity, results = snapshot.activity, self._desk.results
        return (
            (
                snapshot.connected,
                snapshot.why_not,
                snapshot.simulated,
                snapshot.emergency_stopped,
                snapshot.pose is None,
            ),
            tuple((joint.homed, joint.state, joint.error, joint.hindrance) for joint in snapshot.joints),
            activity and (activity.name, activity.paused, activity.pausable, round(100 * (activity.fraction or 0))),
            (tuple(snapshot.inputs.items()), tuple(snapshot.outputs.items())),
            self._desk.operators.holder,
            self._desk.events.span,
            results and results[-1].number,
            self._desk.settings,
        )

    async def _emergency_stop(self, _request: Request) -> Response:
        """Stop at once, for a page whose socket is not connected."""
        self._desk.emergency_stop("a browser without connection")
        return Response(status_code=204)
