"""The page of each browser, and the hub of all pages: one look at the service a tick, and one message for everyone."""

import asyncio
import json
import time
from collections.abc import Callable, Hashable
from functools import partial
from typing import Any, Final, TypeVar

import numpy as np
from nicegui import app, core, ui

from steptwin.features.panel.page.elements import View
from steptwin.features.panel.page.hardware import HardwareTab
from steptwin.features.panel.page.header import Banner, EventLogView, PageHead
from steptwin.features.panel.page.joints import JogTab, Joints, OutputsTab
from steptwin.features.panel.page.move import MoveTab
from steptwin.features.panel.page.plots_card import PlotsCard
from steptwin.features.panel.page.result import ResultTab
from steptwin.features.panel.page.run import RunTab
from steptwin.features.panel.page.scene import SceneCard, flat_lines
from steptwin.features.panel.page.settings import SettingsTab
from steptwin.features.panel.page.visitor import Answer, Visitor, apply_theme, note_shown, on_stop
from steptwin.features.panel.service.service import MachineService
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.client.control_client import ControlClient

V = TypeVar("V", bound=View)

_SHOWN_S: Final = 5.0
"""Time from sending a change until a browser must have shown it."""


class Page:
    """The views of one browser."""

    def __init__(self, visitor: Visitor) -> None:
        """Create an empty page; `build` fills it."""
        self.visitor = visitor
        self.views: list[View] = []
        self._revision = 0
        """Number of the last change that the views have shown."""
        self._expect_from_now()

    async def build(self, positions_file: str, control: ControlClient | None) -> None:
        """Build the views; yield after each one, since opening a page must not delay another page's beats."""
        visitor = self.visitor
        apply_theme()
        self._head = (await self._add(PageHead(visitor))).root
        self._root = ui.element("div")
        with self._head:
            await self._add(Banner(visitor))
        with self._root, ui.element("div").classes("panel-body"):
            with ui.element("div").classes("panel-left"):
                self._scene = await self._add(SceneCard(visitor.service.robot, visitor.service.drawing))
                self._plots = await self._add(PlotsCard(visitor))
            with ui.element("div").classes("panel-right"):
                await self._add(Joints(visitor))
                await self._make_tabs(positions_file, control)
            await self._add(EventLogView(visitor))

    async def _add(self, view: V) -> V:
        self.views.append(view)
        await asyncio.sleep(0)
        return view

    async def _make_tabs(self, positions_file: str, control: ControlClient | None) -> None:
        """Build all tabs at once, so that a change shows in each of them."""
        visitor, scene = self.visitor, self._scene.scene
        makers: dict[str, Callable[[], View]] = {
            "Jog": lambda: JogTab(visitor),
            "Move": lambda: MoveTab(visitor, scene, positions_file),
            "Run": lambda: RunTab(visitor, scene),
            "Outputs": lambda: OutputsTab(visitor),
            "Settings": lambda: SettingsTab(visitor),
            "Result": lambda: ResultTab(visitor),
        }
        if control is not None:
            makers["Hardware"] = lambda: HardwareTab(visitor, control)
        made: dict[str, View] = {}
        with ui.element("section").classes("panel-card flush place-tabs"):
            with ui.tabs().props("dense no-caps align=left outside-arrows mobile-arrows") as tabs:
                for name in makers:
                    ui.tab(name)
            with ui.tab_panels(tabs, value="Jog", animated=False).props("keep-alive"):
                for name, make in makers.items():
                    with ui.tab_panel(name).classes("stack") as panel:
                        panel.props["aria-label"] = name
                        made[name] = await self._add(make())
        run = made["Run"]
        assert isinstance(run, RunTab)
        self.run = run
        if isinstance(hardware := made.get("Hardware"), HardwareTab):
            tabs.on_value_change(lambda event: hardware.open(event.value == "Hardware"))

    def arrive(self, before: "Page | None") -> None:
        """Show the past to a connected browser, and make it the operator if there is none.

        `before` is the page that the same tab has just shown; None without one.
        """
        if before is not None:
            self.run.go_on(before.run)
        self._expect_from_now()  # missed messages are sent now
        self._scene.arrive()
        self._plots.fill()
        visitor = self.visitor
        if visitor.service.operator.holder is None:
            visitor.attempt(lambda: visitor.service.operator.take(visitor.tab, visitor.name))

    def _expect_from_now(self) -> None:
        """Drop expectations of earlier changes: `_marked` is due next, since it was noted at `_marked_s`."""
        self._due, self._marked, self._marked_s = 0, self._revision, time.monotonic()

    def due(self, now_s: float) -> int:
        """Return the number of the change that the browser must have shown by now.

        Texts and numbers use the same connection, in order: everything sent before has arrived, however slow the
        browser is.
        """
        if now_s - self._marked_s > _SHOWN_S:
            self._due, self._marked, self._marked_s = self._marked, self._revision, now_s
        return self._due

    def refresh(self, snapshot: Snapshot) -> None:
        """Update every view."""
        self._revision += 1
        self._root.classes(add="" if snapshot.connected else "unseen", remove="unseen" if snapshot.connected else "")
        for view in self.views:
            view.refresh(snapshot)
        self._head.props(f"data-revision={self._revision}")  # last: if a view fails, it stays old


def tick_of(snapshot: Snapshot) -> dict[str, Any]:
    """Return a snapshot's numbers for the panel's script, in mm, degrees, percent and ms; None is unknown."""
    pose, activity, parts = snapshot.pose, snapshot.activity, snapshot.links_mm
    drawable = parts and all(np.isfinite(part).all() for part in parts)  # otherwise the mechanism cannot be assembled
    return {
        "n": snapshot.number,
        "held": snapshot.emergency_stopped and all(joint.error is not None for joint in snapshot.drives),
        "t": round(snapshot.time_s, 3),
        "q": [round(joint.position, 4) for joint in snapshot.drives],
        "known": [joint.homed for joint in snapshot.drives],
        "v": [_rounded(joint.rate) for joint in snapshot.drives],
        "e": [_rounded(joint.following_error) for joint in snapshot.drives],
        "pose": None if pose is None else [round(figure, 3) for figure in pose.values()],
        "arm": flat_lines(parts) if drawable else None,
        "tool": None if pose is None else [round(figure, 2) for figure in list(pose.values())[:3]],
        "load": _rounded(snapshot.board.bus_load_percent),
        "fill": None if snapshot.queue_fill is None else round(100 * snapshot.queue_fill),
        "late": _rounded(snapshot.board.late_ms),
        "part": 0 if activity is None or activity.fraction is None else round(activity.fraction, 3),
    }


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return None if value is None else round(value, digits)


TICK_S: Final = 1 / 30
_ALIVE_S: Final = 0.1
"""Time without a tick after which a sign of life is sent to the pages."""


class Hub:
    """Creates a page for each browser and keeps all of them up to date."""

    def __init__(self, service: MachineService, positions_file: str, control: ControlClient | None = None) -> None:
        """Share a service, the file of saved positions, and the control port of a served board."""
        self._service = service
        self._positions_file = positions_file
        self._control = control
        self._pages: dict[str, Page] = {}
        self._names: dict[str, str] = {}
        self._seen: Hashable = None
        self._number = -1
        self._sent_s = 0.0

    def start(self) -> None:
        """Follow the service; call this before the server runs."""
        app.timer(TICK_S, self.tick, immediate=False)
        note_shown()
        for name, stop in (("emergency_stop", self._service.emergency_stop), ("stop", self._service.stop)):
            on_stop(name, partial(self._stop, stop))

    def _stop(self, stop: Callable[[str, str | None], bool], page: str | None, press: str | None) -> Answer:
        known = self._pages.get(page or "")
        return {"told": stop(known.visitor.name if known else "a browser", press)}

    async def build(self) -> None:
        """Build the page of the requesting browser; its tab is the service's client, which survives a reload."""
        client = ui.context.client
        visitor = Visitor(self._service, client)
        page = Page(visitor)
        await page.build(self._positions_file, self._control)
        page.refresh(self._service.snapshot)
        self._pages[client.id] = page

        def of_same_tab() -> Page | None:
            others = (each for each in self._pages.values() if each is not page)
            return next((each for each in others if each.visitor.tab == visitor.tab), None)

        def connected() -> None:
            visitor.tab = client.tab_id or client.id
            visitor.name = self._names.setdefault(visitor.tab, f"browser {len(self._names) + 1}")
            page.arrive(of_same_tab())
            page.refresh(self._service.snapshot)

        def leave() -> None:
            self._pages.pop(client.id, None)
            if of_same_tab() is None:  # as after a reload
                self._service.gone(visitor.tab)

        client.on_connect(connected)
        client.on_delete(leave)

    async def tick(self) -> None:
        """Send the newest snapshot to all browsers, and update their views if anything has changed."""
        snapshot = self._service.snapshot
        now_s = time.monotonic()
        if snapshot.connected and snapshot.number != self._number:
            self._number, self._sent_s = snapshot.number, now_s
            await self._send("tick", json.dumps(tick_of(snapshot)), now_s)
        elif now_s - self._sent_s > _ALIVE_S:  # tells a page a lost machine from a lost panel
            self._sent_s = now_s
            await self._send("alive", "", now_s)
        seen = self._changes(snapshot)
        if seen != self._seen:
            self._seen = seen
            for page in list(self._pages.values()):
                page.refresh(snapshot)

    async def _send(self, name: str, text: str, now_s: float) -> None:
        for client_id, page in list(self._pages.items()):
            await core.sio.emit(name, (text, page.due(now_s)), room=client_id)

    def _changes(self, snapshot: Snapshot) -> Hashable:
        """Return everything that views show besides the numbers of a tick; they update when it changes."""
        activity, service = snapshot.activity, self._service
        return (
            (snapshot.connected, snapshot.why_not, snapshot.simulated, snapshot.emergency_stopped),
            (snapshot.pose is None, _rounded(snapshot.board.stood_percent, 0), _rounded(snapshot.speed_percent, 0)),
            tuple((joint.homed, joint.state, joint.error, joint.hindrance) for joint in snapshot.drives),
            activity and (activity.name, activity.paused, activity.pausable, activity.waits_for),
            activity and round(100 * (activity.fraction or 0)),
            (tuple(snapshot.inputs.items()), tuple(snapshot.outputs.items())),
            (service.operator.holder, service.events.span, service.drawing.version),
            service.results and service.results[-1].number,
            service.settings,
        )
