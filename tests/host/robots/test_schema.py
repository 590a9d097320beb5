"""`steptwin schema robot`: it accepts the robot files that StepTwin has or writes, and describes each key."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any, Final

import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.features import giving
from steptwin.host.common.file_models import json_schema
from steptwin.host.robots import brought_text, robot_names
from steptwin.host.robots.kinematics.kinds import kinds
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.reader import robot_model

SCHEMA: Final = json_schema(robot_model())

TYPES: Final[Mapping[str, Any]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "integer": (int,),
    "number": (int, float),
}


def misfits(value: Any, schema: Mapping[str, Any], place: str = "", defs: Mapping[str, Any] | None = None) -> list[str]:
    """Return the places where a value does not fit the words of JSON schema that ours use."""
    defs = defs or schema.get("$defs", {})
    schema = defs[schema["$ref"].removeprefix("#/$defs/")] if "$ref" in schema else schema
    if one := schema.get("oneOf") or schema.get("anyOf"):
        return min((misfits(value, each, place, defs) for each in one), key=len)
    if "type" not in schema or "const" in schema:
        fits = value in schema.get("enum", [schema.get("const", value)])
        return [] if fits else [f"{place}: {value} is beyond its limits"]
    kind = schema["type"]
    if not isinstance(value, TYPES[kind]) or (isinstance(value, bool) and kind != "boolean"):
        return [f"{place}: {value} is no {kind}"]
    if kind == "object":
        own, others = schema.get("properties", {}), schema.get("additionalProperties", {})
        wrong = [f"{place}.{key}: is missing" for key in schema.get("required", ()) if key not in value]
        for key, each in value.items():
            inner = own.get(key, others)
            if inner is False:
                wrong.append(f"{place}.{key}: is unknown")
            elif inner is not True:
                wrong += misfits(each, inner, f"{place}.{key}", defs)
        return wrong
    if kind == "array":
        kinds = schema.get("prefixItems") or [schema["items"]] * len(value)
        assert not schema.get("prefixItems") or len(value) == schema["minItems"] == schema["maxItems"]
        pairs = enumerate(zip(value, kinds, strict=True))
        return [each for i, pair in pairs for each in misfits(*pair, f"{place}[{i}]", defs)]
    beyond = (
        value not in schema.get("enum", [value])
        or (kind in ("number", "integer") and value < schema.get("minimum", value))
        or (kind in ("number", "integer") and value > schema.get("maximum", value))
        or ("exclusiveMinimum" in schema and value <= schema["exclusiveMinimum"])
        or (kind == "string" and not schema.get("minLength", 0) <= len(value) <= schema.get("maxLength", len(value)))
    )
    return [f"{place}: {value} is beyond its limits"] if beyond else []


def keys_in(schema: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each key of the schema, with its place and its own schema."""
    for name, each in schema.get("$defs", {}).items():
        yield from keys_in(each, f"{name}:")
    for word in ("oneOf", "anyOf"):
        for each in schema.get(word, ()):
            yield from keys_in(each, place)
    for key, each in schema.get("properties", {}).items():
        yield f"{place}.{key}", each
        yield from keys_in(each, f"{place}.{key}")
    if isinstance(others := schema.get("additionalProperties"), dict):
        yield from keys_in(others, f"{place}.*")


@pytest.mark.parametrize("name", robot_names())
def test_it_accepts_the_robots_that_come_along(name: str) -> None:
    assert misfits(tomllib.loads(brought_text(name)), SCHEMA) == []


@pytest.mark.parametrize("kind", kinds())
def test_it_accepts_the_files_of_new(kind: str) -> None:
    assert misfits(tomllib.loads(robot_text("mine", kind, *with_settings(kind, {}))), SCHEMA) == []


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("ratio = 5.0", "ratoi = 5.0", ".joints.th1.ratoi: is unknown"),
        ("ratio = 5.0", "ratio = 0", ".joints.th1.ratio: 0 is beyond its limits"),
        ("ratio = 5.0", 'ratio = "5"', ".joints.th1.ratio: 5 is no number"),
        ("microsteps = 16", "", ".joints.th1.microsteps: is missing"),
        ("osc_pf = 330", 'driver_profile = "3a-modul"', ".board.driver_profile: 3a-modul is beyond its limits"),
        ("L2_mm = 200.0", "l2_mm = 200.0", ".kinematics.L2_mm: is missing"),
    ],
)
def test_it_refuses_what_the_reader_refuses(old: str, new: str, place: str) -> None:
    text = brought_text("warehouse-scara")
    assert old in text
    assert place in misfits(tomllib.loads(text.replace(old, new, 1)), SCHEMA)


def test_every_key_is_described() -> None:
    undescribed = [place for place, each in keys_in(SCHEMA) if not each.get("description")]
    assert undescribed == []
    described = dict(keys_in(SCHEMA))
    assert described[".joints.*.link.mass_kg"]["description"].endswith("Unit: kg")
    assert described[".joints.*.unit"]["enum"] == ["mm", "deg"]


def test_it_has_the_tables_of_features() -> None:
    assert {feature.name for feature, _ in giving("section")} <= SCHEMA["properties"].keys()


def test_the_command_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["schema", "robot"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(json.dumps(SCHEMA))
    assert printed["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert run(["schema", "robt"]) == 2
    assert capsys.readouterr().err == "steptwin: kind of file 'robt' is unknown: did you mean robot?\n"
