"""Small elements of every view: cards, headings, buttons, chips, tables, forms and live numbers."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol

from nicegui import ui
from nicegui.events import GenericEventArguments

from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.planning.jobs.options import OptionRange


class View(Protocol):
    """A part of the page."""

    def refresh(self, snapshot: Snapshot) -> None: ...


Handler = Callable[[], Any]
Tone = Literal["", "good", "warn", "bad"]
"""Meaning of a text; the words carry it too, never colour alone."""


def card(title: str = "", classes: str = "") -> ui.element:
    """Return a card: a section of the page, with a heading if it has a title."""
    section = ui.element("section").classes(f"panel-card {classes}")
    if title:
        with section:
            heading(title)
    return section


def heading(text: str) -> ui.element:
    return ui.label(text).classes("heading").props('role=heading aria-level="2"')


def line(classes: str = "") -> ui.element:
    return ui.element("div").classes(f"row-line {classes}")


def titled(text: str, classes: str = "") -> ui.element:
    """Return a row of elements that begins with a title."""
    row = line(classes)
    with row:
        ui.label(text).classes("muted")
    return row


def stack(classes: str = "") -> ui.element:
    return ui.element("div").classes(f"stack {classes}")


def act(text: str, on_click: Handler, icon: str | None = None, *, moves: bool = False) -> ui.button:
    """Return the button of a view's main action; arguments as `plain`."""
    return plain(text, on_click, icon, moves=moves).classes(add="act", remove="plain")


def plain(
    text: str, on_click: Handler | None, icon: str | None = None, *, label: str = "", moves: bool = False
) -> ui.button:
    """Return a button of lesser weight.

    Args:
        text: text on the button.
        on_click: called when it is clicked.
        icon: name of its icon.
        label: its name for screen readers; its text by default.
        moves: True if it moves or changes the machine; it is disabled while the page does not see the machine.
    """
    button = ui.button(text, on_click=on_click, icon=icon, color=None).props("unelevated no-caps").classes("plain")
    if label:
        button.props["aria-label"] = label
    if moves:
        button.props["data-moves"] = ""
    return button


def icon_button(name: str, label: str, on_click: Handler | None = None) -> ui.button:
    """Return a button with only an icon; its meaning is a tooltip, and its name for screen readers."""
    button = ui.button(icon=name, on_click=on_click, color=None).props("unelevated").classes("plain icon")
    button.props["aria-label"] = label
    return button.tooltip(label)


class Chip:
    """A short text on a coloured ground.

    Attributes:
        element: the element of NiceGUI.
    """

    def __init__(self, text: str = "", tone: Tone = "", classes: str = "") -> None:
        self.element: ui.label = ui.label(text).classes(f"chip {classes}")
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
    return ui.label(text).classes(f"note {tone}")


def choice(label: str, options: Mapping[Any, str], value: Any, on_change: Callable[[Any], Any]) -> ui.toggle:
    """Return a row of buttons, one of them chosen; `on_change` gets the chosen key."""
    toggle = ui.toggle(dict(options), value=value, on_change=lambda event: on_change(event.value))
    toggle.props("unelevated no-caps dense toggle-color=primary role=group").classes("choice")
    toggle.props["aria-label"] = label
    return toggle


# --- forms

_NUMBER: Final = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


class NumberField(ui.number):
    """Field for a number, also with a decimal comma; another text gives no value.

    A browser's own field for numbers drops the comma in languages with a decimal point: 1,5 would become 15.
    """

    def __init__(self, label: str | None = None, **options: Any) -> None:
        super().__init__(label, **options)
        self.props("type=text inputmode=decimal autocomplete=off")

    def _event_args_to_value(self, e: GenericEventArguments) -> float | None:
        text = str(e.args or "").strip()
        return float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else None


@dataclass(frozen=True, slots=True)
class FormField:
    """A field of a form.

    Attributes:
        name: name in the form's values.
        title: visible title.
        value: initial value; None for an empty field for a number.
        allowed: range and unit of a number; None for a text and for a choice.
        whole: True for a whole number.
        choices: texts to choose from, or values with their texts; empty for a number and for a text.
        hint: True if the range of a number is written below it.
    """

    name: str
    title: str
    value: float | str | None
    allowed: OptionRange | None = None
    whole: bool = False
    choices: Sequence[str] | Mapping[float, str] = ()
    hint: bool = True


Input = ui.number | ui.select | ui.input


def make_input(given: FormField, changed: Handler = lambda: None) -> Input:
    """Return the input of a field; `changed` is called when its content changes. A number shows its range and unit.

    A missing or out-of-range number is marked; `wrong` returns a message about it.
    """
    made: Input
    allowed = given.allowed
    if given.choices:
        options = dict(given.choices) if isinstance(given.choices, Mapping) else list(given.choices)
        made = ui.select(options, value=given.value, label=given.title, on_change=lambda _: changed())
    elif allowed is None:
        made = ui.input(given.title, value=str(given.value), on_change=lambda _: changed())
    else:
        limits = f"{allowed.lower:g} to {allowed.upper:g} {allowed.unit}".rstrip()

        def fits(value: float | None) -> bool:
            return value is not None and allowed.lower <= value <= allowed.upper and not (given.whole and value % 1)

        made = NumberField(
            given.title,
            value=given.value,
            format="%d" if given.whole else None,
            suffix=allowed.unit or None,
            validation={limits: fits},
            on_change=lambda _: changed(),
        )
        made.props["hint"] = limits if given.hint else ""
    return made.props("outlined dense").classes("w-field")


def wrong(inputs: Iterable[ui.element]) -> str | None:
    """Return a message about the first input with a missing or out-of-range number; None if all are right."""
    for each in inputs:
        if isinstance(each, ui.number) and not each.validate():
            given = "there is no number" if each.value is None else f"{each.value:.12g} does not fit"
            return f"{each.props['label']}: {given}; it takes {each.error}"
    return None


class Form:
    """Inputs side by side, one for each field; `changed` is called when one of them changes."""

    def __init__(self, fields: Iterable[FormField], changed: Handler = lambda: None) -> None:
        with ui.element("div").classes("form-grid"):
            self._inputs = {given.name: make_input(given, changed) for given in fields}

    def wrong(self) -> str | None:
        """Return a message about the first wrong input; None if all are right."""
        return wrong(self._inputs.values())

    def values(self) -> dict[str, Any]:
        """Return the values of the inputs; None for one without a number."""
        return {name: each.value for name, each in self._inputs.items()}

    def fill(self, values: Mapping[str, Any]) -> None:
        """Set the inputs; values without an input are ignored."""
        for name, value in values.items():
            if name in self._inputs:
                self._inputs[name].set_value(value)


# --- tables


def table(*headings: str) -> ui.element:
    """Return the body of a table; a heading may have its column's classes before a bar: `end|number`."""
    with ui.element("table").classes("grid-table"):
        with ui.element("thead"), ui.element("tr"):
            for text, _, classes in (each.partition("|") for each in headings):
                with ui.element("th").props('scope="col"') if text else cell() as head:
                    ui.label(text)
                head.classes(classes)
        return ui.element("tbody")


def cell(text: str = "", classes: str = "") -> ui.element:
    """Return a cell in a row of a table, with a text or as a container."""
    with ui.element("td").classes(classes) as made:
        if text:
            ui.label(text)
    return made
