"""The page of one browser: its views and where they stand."""

from typing import Final

from nicegui import ui

from steptwin.host.client.control_client import ControlClient
from steptwin.host.panel.desk import Snapshot
from steptwin.host.panel.page.banner import Banner
from steptwin.host.panel.page.event_log import EventLogView
from steptwin.host.panel.page.hardware import HardwareTab
from steptwin.host.panel.page.header import Header
from steptwin.host.panel.page.jog import JogTab
from steptwin.host.panel.page.joints import Joints
from steptwin.host.panel.page.move import MoveTab
from steptwin.host.panel.page.outputs import OutputsTab
from steptwin.host.panel.page.plots_card import PlotsCard
from steptwin.host.panel.page.result import ResultTab
from steptwin.host.panel.page.run import RunTab
from steptwin.host.panel.page.scene_card import scene_card
from steptwin.host.panel.page.settings import SettingsTab
from steptwin.host.panel.page.theme import apply_theme
from steptwin.host.panel.page.view import View
from steptwin.host.panel.page.visitor import Visitor

_HARDWARE: Final = "Hardware"


class Page:
    """The views of one browser."""

    def __init__(self, visitor: Visitor, positions_file: str, control: ControlClient | None) -> None:
        self.visitor = visitor
        apply_theme()
        header = Header(visitor)
        ui.on("emergency_stop", lambda _: header.emergency_stop())
        self._root = ui.element("div")
        self.views: list[View] = [header]
        with header.root:
            self.views.append(Banner(visitor))
        with self._root, ui.element("div").classes("panel-body"):
            with ui.element("div").classes("panel-left"):
                self._scene = scene_card(visitor.desk.robot)
                self._plots = PlotsCard(visitor)
            with ui.element("div").classes("panel-right"):
                self.views.append(Joints(visitor))
                self._make_tabs(positions_file, control)
            self.views.append(EventLogView(visitor))

    def _make_tabs(self, positions_file: str, control: ControlClient | None) -> None:
        """Make the tabs; all of them are built at once, so that a change shows wherever the operator looks."""
        visitor, scene = self.visitor, self._scene
        with ui.element("section").classes("panel-card flush place-tabs"):
            names = ["Jog", "Move", "Run", "Outputs", "Settings", "Result"]
            with ui.tabs().props("dense no-caps align=left outside-arrows mobile-arrows") as tabs:
                jog, move, run, outputs, settings, result = map(ui.tab, names)
                hardware = ui.tab(_HARDWARE) if control is not None else None
            with ui.tab_panels(tabs, value=jog, animated=False).props("keep-alive"):
                with ui.tab_panel(jog).classes("stack"):
                    self.views.append(JogTab(visitor))
                with ui.tab_panel(move).classes("stack"):
                    self.views.append(MoveTab(visitor, scene, positions_file))
                with ui.tab_panel(run).classes("stack"):
                    self.views.append(RunTab(visitor, scene))
                with ui.tab_panel(outputs).classes("stack"):
                    self.views.append(OutputsTab(visitor))
                with ui.tab_panel(settings).classes("stack"):
                    self.views.append(SettingsTab(visitor))
                with ui.tab_panel(result).classes("stack"):
                    self.views.append(ResultTab(visitor))
                if control is not None and hardware is not None:
                    with ui.tab_panel(hardware).classes("stack"):
                        view = HardwareTab(visitor, control)
                    tabs.on_value_change(lambda event: view.open(event.value == _HARDWARE))
                    self.views.append(view)

    def arrive(self) -> None:
        """Show a browser that has connected the past seconds; operate the machine if nobody does."""
        self._plots.fill()
        operators = self.visitor.desk.operators
        if operators.holder is None:
            self.visitor.attempt(lambda: operators.take(self.visitor.tab, self.visitor.name))

    def refresh(self, snapshot: Snapshot) -> None:
        """Let every view follow what has changed."""
        self._root.classes(add="" if snapshot.connected else "unseen", remove="unseen" if snapshot.connected else "")
        for view in self.views:
            view.refresh(snapshot)
