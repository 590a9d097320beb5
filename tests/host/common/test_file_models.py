"""Models of files: every error of a file at once, each with its key, and the JSON schema by which editors complete."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any, Literal

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileReading, FileTable, json_schema, read_model, read_toml
from steptwin.host.common.file_values import Choice, Name, NotNegative, OneOf, Positive, TableList, Values, Within
from steptwin.host.common.findings import Findings, Part, UnreadError


class Side(StrEnum):
    LEFT = "left"
    RIGHT = "right"


@dataclass(frozen=True, slots=True)
class Crate(FileTable):
    """A crate that stands somewhere.

    Attributes:
        x_mm: its ends
            along x.
        side: where it is.
        load_kg: what it carries; None: nothing.
    """

    x_mm: Annotated[tuple[float, float], Values("a crate has two ends: [from, to]")]
    side: Side = Side.LEFT
    load_kg: Positive | None = None

    def __post_init__(self) -> None:
        if not self.x_mm[0] < self.x_mm[1]:
            raise InputError(f"x_mm: {self.x_mm[1]:g} mm is not above {self.x_mm[0]:g} mm")


@dataclass(frozen=True, slots=True)
class Go(FileTable):
    """Goes to a place."""

    go: str
    duration_s: Annotated[float, Within(1.0, 5.0, "s")] = 2.0


@dataclass(frozen=True, slots=True)
class Stay(FileTable):
    """Stands still."""

    stay: NotNegative


Step = Annotated[Any, OneOf("step", lambda: {"go": Go, "stay": Stay, "repeat": Repeat}, {"wait": "stay"})]


@dataclass(frozen=True, slots=True)
class Repeat(FileTable):
    """Makes steps several times."""

    repeat: Annotated[int, Within(1, 5)]
    steps: Annotated[tuple[Step, ...], TableList("step", 3, lambda step: "wrong" if step is None else step)]


@dataclass(frozen=True, slots=True)
class Named(FileTable):
    """Becomes something else than itself, of its name and what the reader knows."""

    level: Literal[1, 2, 4]

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> str:
        return f"{reading.name} of {reading.known}: {values['level']}"


@dataclass(frozen=True, slots=True)
class Store(FileTable):
    """A store."""

    name: Annotated[str, Name(8)]
    motor: Annotated[str, Choice("motor", ("17HS19", "23HS22"))] = "17HS19"
    count: int = 0
    wired: bool = False
    crates: Mapping[str, Crate] = field(default_factory=dict)
    places: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    named: Mapping[str, Annotated[Any, Named]] = field(default_factory=dict)
    step: tuple[Step, ...] = ()
    numbered: Mapping[str, Annotated[tuple[Step, ...], TableList("step")] | None] = field(default_factory=dict)
    kept: Mapping[str, float | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.wired and not self.crates:
            raise InputError("wired: without crates")


def test_a_table_becomes_the_dataclass() -> None:
    text = """
        name = "main"
        count = 3
        crates.a = { x_mm = [1, 2.5], side = "right", load_kg = 4 }
        crates.b = { x_mm = [0, 1] }
        places.home = { x = 1, y = -2.5 }
        named.lift = { level = 2 }
        [[step]]
        go = "home"
        [[step]]
        stay = 0
        [[step]]
        repeat = 2
        steps = [{ go = "a" }, { repeat = 3, steps = [{ stay = 1 }] }]
    """
    store = read_toml(Store, text, known="main")
    assert store.crates == {"a": Crate((1.0, 2.5), Side.RIGHT, 4.0), "b": Crate((0.0, 1.0))}
    assert type(store.crates["a"].load_kg) is float
    assert store.places == {"home": {"x": 1.0, "y": -2.5}}
    assert store.named == {"lift": "lift of main: 2"}
    assert store.step == (Go("home", 2.0), Stay(0.0), Repeat(2, (Go("a", 2.0), Repeat(3, (Stay(1.0),)))))
    assert (store.name, store.motor, store.count, store.wired) == ("main", "17HS19", 3, False)


MISTAKES = {
    'name = "much too long"': "name: 'much too long' has 13 characters: a name has at most 8",
    'name = ""': "name: '' is empty",
    "name = 3": "name: 3 is not a text",
    "": "name: is missing",
    'nme = "main"': "nme: key 'nme' is unknown: did you mean name or named?",
    'name = "main"\nmotor = "17HS91"': "motor: motor '17HS91' is unknown: did you mean 17HS19?",
    'name = "main"\ncount = 1.0': "count: 1.0 is not a whole number",
    'name = "main"\ncount = true': "count: True is not a whole number",
    'name = "main"\ncount = 10_000_000_000': "count: 10000000000 is not a whole number up to 1e+09",
    'name = "main"\nwired = 1': "wired: 1 is neither true nor false",
    'name = "main"\nwired = true': "wired: without crates",
    'name = "main"\ncrates = 3': "crates: 3 is not a table",
    'name = "main"\ncrates.a = 3': "crates.a: 3 is not a table",
    'name = "main"\ncrates.a = {}': "crates.a.x_mm: is missing",
    'name = "main"\ncrates.a.x_mm = [2, 1]': "crates.a.x_mm: 1 mm is not above 2 mm",
    'name = "main"\ncrates.a.x_mm = 1': "crates.a.x_mm: 1 is not a list",
    'name = "main"\ncrates.a.x_mm = [1]': "crates.a.x_mm: has 1 values, but a crate has two ends: [from, to]",
    'name = "main"\ncrates.a.x_mm = [1, "a"]': "crates.a.x_mm[1]: 'a' is not a number",
    'name = "main"\ncrates.a.x_mm = [1, inf]': "crates.a.x_mm[1]: inf is not a finite number up to 1e+09",
    'name = "main"\ncrates.a = { x_mm = [1, 2], side = "let" }': (
        "crates.a.side: 'let' is not one of left, right: did you mean left?"
    ),
    'name = "main"\ncrates.a = { x_mm = [1, 2], load_kg = 0 }': "crates.a.load_kg: 0 is not above 0",
    'name = "main"\nplaces.home.x = nan': "places.home.x: nan is not a finite number up to 1e+09",
    'name = "main"\nplaces.home.x = "1"': "places.home.x: '1' is not a number",
    'name = "main"\nnamed.a.level = 3': "named.a.level: 3 is not one of 1, 2, 4",
    'name = "main"\n[step]\ngo = "x"': (
        "step: is a table, not a list: begin each with [[step]], in two pairs of brackets"
    ),
    'name = "main"\nstep = [1]': "step 1: 1 is not a table",
    'name = "main"\n[[step]]\ngo = "x"\nduration_s = 5.1': (
        "step 1: duration_s: 5.1 s is outside 1..5 s; the nearest is 5 s"
    ),
    'name = "main"\n[[step]]\ngo = "x"\nduration_s = 0.5': (
        "step 1: duration_s: 0.5 s is outside 1..5 s; the nearest is 1 s"
    ),
    'name = "main"\n[[step]]\nstay = -1': "step 1: stay: -1 is negative",
    'name = "main"\n[[step]]\nsty = 1': "step 1: 'sty' is unknown: did you mean stay?",
    'name = "main"\n[[step]]\nq = 1': "step 1: a step has exactly one of go, stay, repeat, not none",
    'name = "main"\n[[step]]\ngo = "x"\nstay = 1': (
        "step 1: a step has exactly one of go, stay, repeat, not go and stay"
    ),
    'name = "main"\n[[step]]\nwait = 1': "step 1: 'wait' is unknown: did you mean stay?",
    'name = "main"\n[[step]]\nrepeat = 2\nsteps = []': "step 1: steps: has no steps",
    'name = "main"\n[[step]]\nrepeat = 2\nsteps = [{ stay = 1 }, { stay = -1 }]': "step 1.2: stay: -1 is negative",
    'name = "main"\n[[step]]\nrepeat = 2\nsteps = [1, 2, 3, 4]': "step 1: steps: has 4 steps, more than 3",
    'name = "main"\n[[step]]\nrepeat = 2\nsteps = { stay = 1 }': "step 1: steps: {'stay': 1} is not a list",
    'name = "main"\nnumbered = { up = [{ stay = 1 }, { stay = -1 }] }': "numbered.up step 2: stay: -1 is negative",
    'name = "main"\nnumbered.up.stay = 1': (
        "numbered.up: is a table, not a list: begin each step with [[numbered.up]], in two pairs of brackets"
    ),
    'name = "main"\nkept = { a = 1.5, b = "x" }': "kept.b: 'x' is not a number",
}
"""A mistake in a file, and the one line that it gives."""


@pytest.mark.parametrize(("text", "message"), MISTAKES.items())
def test_each_mistake_gives_one_line(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read_toml(Store, text)
    assert caught.value.messages == (message,)


def test_no_mistake_hides_another() -> None:
    """Wrong values, missing and unknown keys and the checks of the tables that are right are told together."""
    text = """
        nme = "main"
        crates.a = { x_mm = [2, 1], lod_kg = 1 }
        crates.b = { x_mm = [2, 1], side = "up" }
        crates.c = {}
        wired = 3
        [[step]]
        go = 3
        duration_s = 9
        [[step]]
        stay = -1
    """
    with pytest.raises(InputError) as caught:
        read_toml(Store, text)
    assert caught.value.messages == (
        "nme: key 'nme' is unknown: did you mean name or named?",
        "wired: 3 is neither true nor false",
        "crates.a.lod_kg: key 'lod_kg' is unknown: did you mean load_kg?",
        "crates.a.x_mm: 1 mm is not above 2 mm",
        "crates.b.side: 'up' is not one of left, right",
        "crates.b.x_mm: 1 mm is not above 2 mm",
        "crates.c.x_mm: is missing",
        "step 1: go: 3 is not a text",
        "step 1: duration_s: 9.0 s is outside 1..5 s; the nearest is 5 s",
        "step 2: stay: -1 is negative",
    )


def test_what_is_wrong_keeps_its_place() -> None:
    """A list of tables and names that keep their places have something in place of what is wrong."""
    findings = Findings()
    text = """
        name = "main"
        kept = { a = 1.5, b = "x" }
        [[step]]
        repeat = 2
        steps = [3, { stay = -1 }, { stay = 1 }]
    """
    store = read_model(Store, tomllib.loads(text), findings)
    assert findings.messages == [
        "step 1.1: 3 is not a table",
        "step 1.2: stay: -1 is negative",
        "kept.b: 'x' is not a number",
    ]
    assert store.kept == {"a": 1.5, "b": None}
    first, second, third = store.step[0].steps
    assert (first, third) == ("wrong", Stay(1.0))
    assert isinstance(second, Part)
    with pytest.raises(UnreadError):
        second.stay  # noqa: B018


def test_what_is_no_table_is_not_read() -> None:
    findings = Findings()
    with pytest.raises(UnreadError):
        read_model(Store, 3, findings)
    assert findings.messages == ["3 is not a table"]


def test_the_schema_has_descriptions_units_limits_and_defaults() -> None:
    schema = json_schema(Store)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert (schema["required"], schema["additionalProperties"]) == (["name"], False)
    crate = schema["properties"]["crates"]["additionalProperties"]
    assert crate["description"] == "A crate that stands somewhere."
    assert crate["properties"]["x_mm"]["description"] == "its ends along x. Unit: mm"
    assert crate["properties"]["load_kg"]["exclusiveMinimum"] == 0
    assert schema["properties"]["motor"]["enum"] == ["17HS19", "23HS22"]
    assert schema["properties"]["step"]["items"] == {"$ref": "#/$defs/step"}
    go, stay, repeat = schema["$defs"]["step"]["oneOf"]
    assert repeat["properties"]["steps"]["items"] == {"$ref": "#/$defs/step"}
    assert (go["properties"]["duration_s"]["maximum"], go["properties"]["duration_s"]["default"]) == (5.0, 2.0)
    assert list(stay["properties"]) == ["stay"]
