"""`steptwin schema program`: it accepts the programs that come along, refuses wrong ones and describes each key."""

import tomllib
from pathlib import Path
from typing import Final

import pytest

from steptwin.host.common.file_models import json_schema
from steptwin.host.planning.programs.program import step_models
from steptwin.host.planning.programs.program_file import program_model
from tests.end_to_end.pages import ROOT, blocks_of, read_page
from tests.host.robots.test_schema import keys_in, misfits

SCHEMA: Final = json_schema(program_model())
PROGRAMS: Final = sorted((ROOT / "docs" / "programs").rglob("*.toml"))
BLOCKS: Final = [text for language, text in blocks_of(read_page("docs/programs.md")) if language == "toml"]


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_it_accepts_the_programs_that_come_along(path: Path) -> None:
    assert misfits(tomllib.loads(path.read_text(encoding="utf-8")), SCHEMA) == []


def test_it_accepts_the_programs_of_the_page() -> None:
    found = [misfits({"step": [{"pause": 1}]} | tomllib.loads(text), SCHEMA) for text in BLOCKS]
    assert [each for each in found if each] == []


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("", ".step: is missing"),
        ('titel = "x"\n[[step]]\npause = 1', ".titel: is unknown"),
        ('law = "cubic"\n[[step]]\npause = 1', ".law: cubic is beyond its limits"),
        ("[[step]]\npause = true", ".step[0].pause: True is no number"),
        ('[[step]]\nwait = "ready"\non = true\ntimeout_s = 3601', ".step[0].timeout_s: 3601 is beyond its limits"),
        ('[[step]]\nline = "a"\nspeed_mm_s = 0', ".step[0].speed_mm_s: 0 is beyond its limits"),
        ('[[step]]\nrepeat = 2\nsteps = [{ pause = "1" }]', ".step[0].steps[0].pause: 1 is no number"),
        ("[pallets.box]\nfirst = { x = 1 }\nalong = { count = 0 }", ".pallets.box.along.count: 0 is beyond its limits"),
    ],
)
def test_it_refuses_what_the_reader_refuses(text: str, place: str) -> None:
    assert place in misfits(tomllib.loads(text), SCHEMA)


def test_every_key_is_described() -> None:
    assert [place for place, each in keys_in(SCHEMA) if not each.get("description")] == []


def test_it_has_a_table_for_each_verb_also_of_features() -> None:
    verbs = {key.partition(".")[2] for key, _ in keys_in(SCHEMA["$defs"]["step"])}
    assert step_models().keys() <= verbs
