"""The small parts of every view: cards, headings, buttons, chips, tables and live numbers."""

import json
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, Literal, Protocol

from nicegui import ui
from nicegui.events import GenericEventArguments

from steptwin.host.panel.desk.state import Snapshot
from steptwin.host.planning.jobs.options import OptionRange


class View(Protocol):
    """A part of the page."""

    def refresh(self, snapshot: Snapshot) -> None:
        """Show what has changed; called whenever something has, but not for numbers that always change."""
        ...


Handler = Callable[[], Any]
Tone = Literal["", "good", "warn", "bad"]
"""Meaning of a text; the words say it too, so that colour is never alone."""


def card(title: str = "", classes: str = "") -> ui.element:
    """Return a card, a section of the page with a heading unless it has none."""
    section = ui.element("section").classes(f"panel-card {classes}")
    if title:
        with section:
            heading(title)
    return section


def heading(text: str) -> ui.element:
    """Return a heading of a card."""
    return ui.label(text).classes("heading").props('role=heading aria-level="2"')


def line(classes: str = "") -> ui.element:
    """Return a row of things, which wraps on a narrow screen."""
    return ui.element("div").classes(f"row-line {classes}")


def stack(classes: str = "") -> ui.element:
    """Return a column of things."""
    return ui.element("div").classes(f"stack {classes}")


def act(text: str, on_click: Handler, icon: str | None = None) -> ui.button:
    """Return the button of a view's main action."""
    return ui.button(text, on_click=on_click, icon=icon, color=None).props("unelevated no-caps").classes("act")


def plain(text: str, on_click: Handler | None, icon: str | None = None) -> ui.button:
    """Return a button of lesser weight."""
    return ui.button(text, on_click=on_click, icon=icon, color=None).props("unelevated no-caps").classes("plain")


def moving(button: ui.button) -> ui.button:
    """Return a button that moves the machine or changes it: it is dead while the page does not see the machine."""
    button.props["data-moves"] = ""
    return button


def icon_button(name: str, label: str, on_click: Handler | None = None) -> ui.button:
    """Return a button that is only an icon, with its meaning for those who cannot see it, and as a tooltip."""
    button = ui.button(icon=name, on_click=on_click, color=None).props("unelevated").classes("plain icon")
    button.props["aria-label"] = label
    return button.tooltip(label)


class Chip:
    """A short text on a coloured ground.

    Attributes:
        element: what NiceGUI shows.
    """

    def __init__(self, text: str = "", tone: Tone = "") -> None:
        self.element = ui.label(text).classes("chip")
        self._tone: Tone = ""
        self.show(text, tone)

    def show(self, text: str, tone: Tone = "") -> None:
        """Change text and tone; an empty text hides the chip."""
        self.element.set_text(text)
        self.element.set_visibility(bool(text))
        if tone != self._tone:
            self.element.classes(add=tone, remove=self._tone)
            self._tone = tone


def live(name: str, classes: str = "number") -> ui.element:
    """Return a number that the panel's script writes many times a second; `name` is its key in a tick."""
    element = ui.element("span").classes(classes)
    element.props["data-live"] = name
    return element


def note(text: str, tone: Tone = "") -> ui.label:
    """Return a remark."""
    return ui.label(text).classes(f"note {tone}")


def choice(label: str, options: Mapping[Any, str], value: Any, on_change: Callable[[Any], Any]) -> ui.toggle:
    """Return a row of buttons with one chosen; `on_change` gets the chosen key."""
    toggle = ui.toggle(dict(options), value=value, on_change=lambda event: on_change(event.value))
    toggle.props("unelevated no-caps dense toggle-color=primary").classes("choice")
    toggle.props["aria-label"] = label
    toggle.props["role"] = "group"
    return toggle


_NUMBER: Final = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


class NumberField(ui.number):
    """A field for a number, which may have a decimal comma; a text that is none leaves the field without a value.

    A browser's own field for numbers drops the comma where the language has a point: 1,5 would become 15.
    """

    def __init__(self, label: str | None = None, **options: Any) -> None:
        super().__init__(label, **options)
        self.props("type=text inputmode=decimal autocomplete=off")

    def _event_args_to_value(self, e: GenericEventArguments) -> float | None:
        text = str(e.args or "").strip()
        return float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else None


def number_field(
    label: str,
    value: float | None,
    allowed: OptionRange,
    on_change: Callable[[], Any] | None = None,
    *,
    whole: bool = False,
) -> NumberField:
    """Return a field for a number, which says its range and unit."""
    wrong = f"{allowed.lower:g} to {allowed.upper:g} {allowed.unit}".rstrip()

    def fits(given: float | None) -> bool:
        return given is not None and allowed.lower <= given <= allowed.upper and not (whole and given % 1)

    field = NumberField(
        label,
        value=value,
        format="%d" if whole else None,
        suffix=allowed.unit or None,
        validation={wrong: fits},
        on_change=None if on_change is None else lambda _: on_change(),
    )
    field.props["hint"] = wrong
    return field.props("outlined dense").classes("w-field")


def wrong_field(fields: Iterable[ui.element]) -> str | None:
    """Return what is wrong in the first field that has no number, or one outside its range; None if all are right."""
    wrong = [field for field in fields if isinstance(field, ui.number) and not field.validate()]
    if not wrong:
        return None
    first = wrong[0]
    given = "there is no number" if first.value is None else f"{first.value:.12g} does not fit"
    return f"{first.props['label']}: {given}; it takes {first.error}"


def table(headings: Iterable[tuple[str, str]]) -> ui.element:
    """Return the body of a table; headings are texts with the classes of their columns."""
    with ui.element("table").classes("grid-table"):
        with ui.element("thead"), ui.element("tr"):
            for text, classes in headings:
                with ui.element("th").props('scope="col"') if text else cell() as head:
                    ui.label(text)
                head.classes(classes)
        return ui.element("tbody")


def cell(classes: str = "") -> ui.element:
    """Return a cell in a row of a table."""
    return ui.element("td").classes(classes)


def call(function: str, *arguments: object) -> str:
    """Return JavaScript that calls a function with arguments."""
    return f"{function}({', '.join(json.dumps(argument) for argument in arguments)})"
