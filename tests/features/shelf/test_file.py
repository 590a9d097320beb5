"""shelf.json in the folder of a run: read again, judged again, and changes that are found."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from steptwin.features.shelf.verdict import read, stored
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import json_table
from steptwin.host.record.folder import verify_folder
from steptwin.host.record.folder.report_file import read_feature
from tests.messages import refusing

Change = Callable[[dict[str, Any]], object]


@pytest.fixture
def folder(store_run: Path, tmp_path: Path) -> Path:
    copy = tmp_path / "run"
    shutil.copytree(store_run, copy)
    return copy


def change(folder: Path, alter: Change) -> None:
    path = folder / "shelf.json"
    document = json.loads(path.read_text())
    alter(document)
    path.write_text(json.dumps(document))


def test_what_is_written_is_read(store_run: Path) -> None:
    shelf, planned = read_feature(store_run, "shelf")
    assert [event.where for event in shelf.events] == ["hand-over", "A1", "A1", "A1"]
    assert planned is not None
    assert planned.boxes == {"A1": "box"}
    for expected in (planned, None):
        assert read(json_table(json.dumps(stored(shelf, expected, 0)))) == (shelf, expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("alter", "words"),
    [
        (lambda shelf: shelf["events"].pop(2), "report.json says shelf ="),
        (lambda shelf: shelf["events"][1]["tip_mm"].__setitem__(0, 676.5), "the tool was 1.5 mm away from there"),
        (lambda shelf: shelf["events"][2].update(counts=72_000_000), "by the drivers' counts the tool was"),
        (lambda shelf: shelf["events"][2].update(box="nuts"), "but the magnet held box"),
        (lambda shelf: shelf["start"].update({"hand-over": "nuts"}), "but another box was there"),
        (lambda shelf: shelf["end"].update(A1="nuts"), "A1: holds nuts at the end, but box was there last"),
        (lambda shelf: shelf["planned"].update(A1=""), "A1: holds box at the end (planned no box)"),
        (lambda shelf: shelf["open_mm"].update(B1=20.0), "B1: the drawer is left 20.0 mm out"),
        (lambda shelf: shelf["events"][3].update(fault=True), "A1: hand unlocked from the drawer at x 675.0"),
    ],
)
def test_a_changed_file_is_found(folder: Path, alter: Change, words: str) -> None:
    change(folder, alter)
    verdict = verify_folder(folder)
    assert not verdict.passed
    assert any(words in reason for reason in verdict.reasons), verdict.reasons


@pytest.mark.parametrize(
    "alter",
    [
        lambda shelf: shelf.pop("events"),
        lambda shelf: shelf["events"][0].update(tip_mm=[1, 2]),
        lambda shelf: shelf["events"][0].update(tip_mm=[1, 2, "3"]),
        lambda shelf: shelf["events"][0].update(counts=-1),
        lambda shelf: shelf["events"][0].update(counts=1 << 60),
        lambda shelf: shelf.update(end=["A1"]),
        lambda shelf: shelf.update(planned={"A1": None}),
    ],
)
def test_a_wrong_file_is_one_line(folder: Path, alter: Change) -> None:
    change(folder, alter)
    with refusing(InputError):
        read_feature(folder, "shelf")


def test_a_missing_file(folder: Path) -> None:
    (folder / "shelf.json").unlink()
    with refusing(InputError):
        verify_folder(folder)
