"""The Settings tab: speeds, limits and currents with their units; some are the board's, some this panel's alone."""

from nicegui import ui

from steptwin.features.panel.page.elements import Form, FormField, act, heading, line, note, plain
from steptwin.features.panel.page.visitor import Visitor
from steptwin.features.panel.service.commands import WriteSettings
from steptwin.features.panel.service.settings import Setting
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.planning.jobs.options import OptionRange


class SettingsTab:
    """A form for each joint, and one for the machine."""

    def __init__(self, visitor: Visitor) -> None:
        self._visitor = visitor
        self._shown: tuple[Setting, ...] = ()
        self._forms: dict[str | None, Form] = {}
        self._list = ui.element("div").classes("stack")
        with line():
            self._save = act("Write what has changed", self._write, "save", moves=True)
            self._save.set_enabled(False)
            plain("Show the present values", lambda: self._show(visitor.service.settings))
        note("A setting with * is kept by the board; the others hold for this panel until it ends.")
        geometry = visitor.service.robot.geometry
        figures = {name: f"{value:g}" if isinstance(value, float) else value for name, value in geometry.items()}
        lengths = ", ".join(f"{name} {value}" for name, value in figures.items())
        note(f"Dimensions, which only the robot's file sets: {lengths}.")

    def refresh(self, _snapshot: Snapshot) -> None:
        settings = self._visitor.service.settings
        if settings != self._shown:
            self._show(settings)

    def _show(self, settings: tuple[Setting, ...]) -> None:
        self._shown = settings
        self._list.clear()
        self._forms = {}
        with self._list:
            if not settings:
                note("The settings are read when the machine is connected.")
            for joint in dict.fromkeys(setting.joint for setting in settings):
                heading(joint or "Machine")
                fields = [_field(setting) for setting in settings if setting.joint == joint]
                self._forms[joint] = Form(fields, self._compare)
        self._save.set_enabled(False)

    def _write(self) -> None:
        for joint, form in self._forms.items():
            wrong = form.wrong()
            if wrong is not None:
                self._visitor.tell(wrong if joint is None else f"{joint}: {wrong}")
                return
        self._visitor.ask(WriteSettings(values=self._changed()))

    def _changed(self) -> dict[str, float]:
        values = {key: value for form in self._forms.values() for key, value in form.values().items()}
        return {setting.key: values[setting.key] for setting in self._shown if values[setting.key] != setting.value}

    def _compare(self) -> None:
        self._save.set_enabled(bool(self._changed()))


def _field(setting: Setting) -> FormField:
    title = f"{'* ' if setting.stored else ''}{setting.title}"
    choices = {choice: f"{choice:g} {setting.unit}".rstrip() for choice in setting.choices}
    allowed = OptionRange(setting.lower, setting.upper, setting.unit)
    return FormField(setting.key, title, setting.value, allowed, choices=choices)
