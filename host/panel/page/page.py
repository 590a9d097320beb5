"""The page of one browser: its views and where they stand."""

import asyncio
from typing import Final, TypeVar

from nicegui import ui

from steptwin.host.client.control_client import ControlClient
from steptwin.host.panel.desk import Snapshot
from steptwin.host.panel.page.elements import View
from steptwin.host.panel.page.hardware import HardwareTab
from steptwin.host.panel.page.header import Banner, EventLogView, PageHead
from steptwin.host.panel.page.jog import JogTab
from steptwin.host.panel.page.joints import Joints, OutputsTab
from steptwin.host.panel.page.move import MoveTab
from steptwin.host.panel.page.plots_card import PlotsCard
from steptwin.host.panel.page.result import ResultTab
from steptwin.host.panel.page.run import RunTab
from steptwin.host.panel.page.scene import SceneCard
from steptwin.host.panel.page.settings import SettingsTab
from steptwin.host.panel.page.visitor import Visitor, apply_theme

V = TypeVar("V", bound=View)
_HARDWARE: Final = "Hardware"


class Page:
    """The views of one browser."""

    def __init__(self, visitor: Visitor) -> None:
        """Make an empty page, which `build` fills."""
        self.visitor = visitor
        self.views: list[View] = []

    async def build(self, positions_file: str, control: ControlClient | None) -> None:
        """Make the views, with a turn for others after each: a page that is opened must not hold up another's beats."""
        visitor = self.visitor
        apply_theme()
        header = await self._add(PageHead(visitor))
        self._root = ui.element("div")
        with header.root:
            await self._add(Banner(visitor))
        with self._root, ui.element("div").classes("panel-body"):
            with ui.element("div").classes("panel-left"):
                self._scene = await self._add(SceneCard(visitor.desk.robot, visitor.desk.drawing))
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
        """Make the tabs; all of them are built at once, so that a change shows wherever the operator looks."""
        visitor, scene = self.visitor, self._scene.scene
        with ui.element("section").classes("panel-card flush place-tabs"):
            names = ["Jog", "Move", "Run", "Outputs", "Settings", "Result"]
            with ui.tabs().props("dense no-caps align=left outside-arrows mobile-arrows") as tabs:
                jog, move, run, outputs, settings, result = map(ui.tab, names)
                hardware = ui.tab(_HARDWARE) if control is not None else None
            with ui.tab_panels(tabs, value=jog, animated=False).props("keep-alive"):
                with ui.tab_panel(jog).classes("stack"):
                    await self._add(JogTab(visitor))
                with ui.tab_panel(move).classes("stack"):
                    await self._add(MoveTab(visitor, scene, positions_file))
                with ui.tab_panel(run).classes("stack"):
                    self.run = await self._add(RunTab(visitor, scene))
                with ui.tab_panel(outputs).classes("stack"):
                    await self._add(OutputsTab(visitor))
                with ui.tab_panel(settings).classes("stack"):
                    await self._add(SettingsTab(visitor))
                with ui.tab_panel(result).classes("stack"):
                    await self._add(ResultTab(visitor))
                if control is not None and hardware is not None:
                    with ui.tab_panel(hardware).classes("stack"):
                        view = await self._add(HardwareTab(visitor, control))
                    tabs.on_value_change(lambda event: view.open(event.value == _HARDWARE))

    def arrive(self, before: "Page | None") -> None:
        """Show a browser that has connected the past; operate the machine if nobody does.

        `before` is the page that the same tab has just shown; None without one.
        """
        if before is not None:
            self.run.go_on(before.run.shown())
        self._scene.arrive()
        self._plots.fill()
        operators = self.visitor.desk.operators
        if operators.holder is None:
            self.visitor.attempt(lambda: operators.take(self.visitor.tab, self.visitor.name))

    def refresh(self, snapshot: Snapshot) -> None:
        """Let every view follow what has changed."""
        self._root.classes(add="" if snapshot.connected else "unseen", remove="unseen" if snapshot.connected else "")
        for view in self.views:
            view.refresh(snapshot)
