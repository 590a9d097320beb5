"""Read a paper's TOML file: its items as the page shows them, and for each number of ours its name in the study.

A name is a path of attributes, keys and numbers of elements, joined by points: `joint.d1.upper`, `pose.0`; `count` at
its end counts elements. What stands on the paper's side is a number in the file: nothing of it can come from a
computation of ours.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from importlib.resources import files
from typing import Any, Final, TypeVar

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Reading, Table, toml_table
from steptwin.host.studies.papers import paper as data
from steptwin.host.studies.papers.paper import Basis, Coverage, Listing, Look, Paper, Picture, PictureKind, Value
from steptwin.host.studies.papers.study import Study, dh_columns

Made = TypeVar("Made")


def load_paper(name: str, study: type[Study]) -> Paper:
    """Return the paper in the file of this name, without its ending, beside this module."""
    text = (files("steptwin.host.studies.papers") / f"{name}.toml").read_text(encoding="utf-8")
    with prefixed(f"{name}.toml: "):
        return read_paper(text, study)


def read_paper(text: str, study: type[Study]) -> Paper:
    """Return the paper that a TOML text describes; raise InputError, with the key, for what is wrong."""
    table = toml_table(text)
    table.check_keys(("citation", "items"))
    item = _made(data.Item, {"place": Table.text, "title": Table.text}, _ITEM | {"listings": _each(_listing(study))})
    return Paper(study.robot_name, table.text("citation"), study, table.each("items", item))


def look_at(name: str) -> Look:
    """Return the function that looks a name up in a study."""

    def look(study: Any) -> Any:
        value = study
        for key in name.split("."):
            if isinstance(value, Mapping):
                value = value[key]
            elif key == "count":
                value = len(value)
            else:
                value = value[int(key)] if key.isdecimal() else getattr(value, key)
        return value

    return look


def _read(table: Table, required: Mapping[str, Reading], optional: Mapping[str, Reading]) -> dict[str, Any]:
    """Return the values of the keys that are there."""
    return {key: value for key, value in table.read(required, optional).items() if value is not None}


def _made(
    make: Callable[..., Made], required: Mapping[str, Reading], optional: Mapping[str, Reading]
) -> Callable[[Table], Made]:
    """Return the function that makes something of a table whose keys are its fields."""
    return lambda table: make(**_read(table, required, optional))


def _each(make: Callable[[Table], Any]) -> Reading:
    return lambda table, key: table.each(key, make)


def _texts(table: Table, key: str) -> tuple[str, ...]:
    return _text_row(key, table.elements(key))


def _text_row(place: str, row: object) -> tuple[str, ...]:
    if not isinstance(row, list) or not all(isinstance(cell, str) for cell in row):
        raise InputError(f"{place}: is not a list of texts")
    return tuple(row)


def _rows(make: Callable[..., Any], least: int, most: int) -> Reading:
    """Return the reading of a list of rows, each of so many texts: a line in one of the page's tables."""

    def read(table: Table, key: str) -> tuple[Any, ...]:
        made = []
        for i, row in enumerate(table.elements(key)):
            with prefixed(f"{key}[{i}]"):
                cells = _text_row("", row)
                if not least <= len(cells) <= most:
                    takes = f"takes {least}" if least == most else f"takes from {least} to {most}"
                    raise InputError(f": has {len(cells)} texts, but {takes}")
                made.append(make(*cells))
        return tuple(made)

    return read


def _part(place: str, what: str, how: str, answer: str = Coverage.YES, why: str = "") -> data.Part:
    if answer not in list(Coverage):
        raise InputError(f": {answer!r} is not one of {', '.join(Coverage)}")
    return data.Part(place, what, how, Coverage(answer), why)


def _look(table: Table, key: str) -> Look:
    return look_at(table.text(key))


def _number(table: Table, key: str) -> float:
    return table.number(key)


_SHOWN: Final[dict[str, Reading]] = {"unit": Table.text, "tolerance": _number, "decimals": Table.integer}
_OF_THE_PAPER: Final[dict[str, Reading]] = {"paper": _number, "place": partial(Table.text, empty=False)}
_KINDS: Final[dict[Basis, tuple[dict[str, Reading], dict[str, Reading]]]] = {
    Basis.DIMENSION: (_OF_THE_PAPER, {}),
    Basis.RESULT: (_OF_THE_PAPER, {"source": lambda table, key: table.choice(key, data.Source)}),
    Basis.CHECK: ({"expected": _number}, {}),
    Basis.ALONE: ({}, {}),
}
"""The keys of each kind of value, required and optional, beside its name, `ours` and those that show it."""


def _values(table: Table, key: str) -> tuple[Value, ...]:
    return tuple(value for values in table.each(key, _value) for value in values)


def _value(table: Table) -> tuple[Value, ...]:
    """Return a number; for a run both that it has: the tool's largest error by the driver's counts, and the verdict."""
    kind = _kind(table, {kind.name.lower(): kind for kind in Basis} | {"run": None})
    if kind is None:
        run = f"run.{table.text('run')}"
        off = Value(Basis.ALONE, "tool off the plan by the counted steps, max", look_at(f"{run}.tool_off_mm"), "mm")
        failed = Value(Basis.CHECK, "checks of the run that failed", look_at(f"{run}.failed"), expected=0.0)
        return replace(off, decimals=4), failed
    name, (required, optional) = kind.name.lower(), _KINDS[kind]
    values = _read(table, {name: Table.text, "ours": _look, **required}, {**_SHOWN, **optional})
    what = values.pop(name)
    if "paper" in values:
        values = {"source": data.Source.STATED, **values, "expected": values["paper"]}
        del values["paper"]
    return (Value(kind, what, **values),)


def _kind(table: Table, kinds: Mapping[str, Made]) -> Made:
    """Return the kind that one of a table's keys names; raise InputError without one."""
    found = [kind for key, kind in kinds.items() if key in table]
    if not found:
        raise InputError(f"one of {', '.join(kinds)} is missing")
    return found[0]


def _listing(study: type[Study]) -> Callable[[Table], Listing]:
    """Return the reading of a table: of the study, of transforms, of the robot's DH parameters, or of a run."""

    def read(table: Table) -> Listing:
        if "dh" in table:
            convention, columns = dh_columns(study.robot_name)
            return Listing(f"{table.text('dh')}, {convention} convention", columns, look_at("dh_rows"))
        if "run" in table:
            job = table.text("run")
            return Listing(f"The run of `{job}` on the emulated board", _RUN, look_at(f"run.{job}.rows"))
        return _made(partial(Listing, columns=_MATRIX), *_LISTING)(table)

    return read


_LISTING: Final[tuple[dict[str, Reading], dict[str, Reading]]] = (
    {"title": Table.text, "rows": _look},
    {"columns": _texts, "text_columns": Table.integer},
)
_MATRIX: Final = ("row", "n", "o", "a", "p mm")
"""The columns of a transform, for a table that has none of its own: the tool's axes and its position."""
_RUN: Final = ("axis", "steps at start", "at end", "pulses", "peak steps/s", "error max, steps")


def _picture(table: Table) -> Picture:
    kind = _kind(table, {kind.value: kind for kind in PictureKind})
    named = {"view": Table.text} if kind is PictureKind.RUN else {"name": Table.text}
    required = {"place": Table.text, "caption": Table.text, kind.value: Table.text, **named}
    values = _read(table, required, {"columns": Table.integer})
    drawn = values.pop(kind.value)
    if kind is PictureKind.RUN:
        return Picture(kind=kind, name=f"{drawn}-{values['view']}", job=drawn, **values)
    what = {"view": drawn} if kind is PictureKind.WORKSPACE else {"look": look_at(drawn)}
    return Picture(kind=kind, **what, **values)


_FORMULA: Final = _made(data.Formula, {"what": Table.text, "compute": _look, "truth_from": Table.text}, _SHOWN)
_ERRATUM: Final = _made(
    data.Erratum, dict.fromkeys(("place", "printed", "right", "found"), Table.text), {"formulas": _each(_FORMULA)}
)
_ITEM: Final[dict[str, Reading]] = {
    "text": Table.text,
    "parts": _rows(_part, 3, 5),
    "values": _values,
    "errata": _each(_ERRATUM),
    "left_open": _rows(data.Gap, 3, 3),
    "lost": _rows(data.Gap, 3, 3),
    "pictures": _each(_picture),
}
