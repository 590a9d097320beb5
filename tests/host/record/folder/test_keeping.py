"""What a live board has recorded is not replaced; a run that can be made again is."""

import json
import os
from pathlib import Path

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.record.folder import RECORDING, keep_any_run, keep_log, keep_recording
from tests.messages import refusing

REPORT = {
    "folder_version": 1, "robot": "r", "job": "j", "duration_s": 1.0, "simulated_s": 1.0, "wall_s": 1.0,
    "bus": {"bitrate": 500_000, "frames": 0, "load_percent": 0.0}, "outputs": [], "driver_profile": "d", "axes": [],
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


def with_report(folder: Path, passed: bool | None) -> None:
    (folder / "edges.npz").touch()
    (folder / "report.json").write_text(json.dumps(REPORT | {"passed": passed}))


def test_an_empty_folder_and_a_missing_one_are_free(folder: Path) -> None:
    for each in (folder, folder / "missing", str(folder)):
        keep_any_run(each)


@pytest.mark.parametrize("passed", [True, False])
def test_a_run_in_virtual_time_is_replaced_by_another_only(passed: bool, folder: Path) -> None:
    with_report(folder, passed)
    keep_recording(folder)
    with refusing(InputError):
        keep_any_run(folder)


def test_a_recording_is_kept(folder: Path) -> None:
    with_report(folder, None)
    with refusing(InputError):
        keep_recording(folder)
    with refusing(InputError):
        keep_any_run(folder)


@pytest.mark.parametrize("job", ["test", "replay"])
def test_what_can_be_made_again_is_replaced_although_nothing_has_judged_it(job: str, folder: Path) -> None:
    (folder / "edges.npz").touch()
    (folder / "report.json").write_text(json.dumps(REPORT | {"passed": None, "job": job}))
    keep_recording(folder)


def test_edges_of_another_recorder_are_kept(folder: Path) -> None:
    """It may leave out the report."""
    (folder / "edges.npz").touch()
    with refusing(InputError):
        keep_recording(folder)


def test_a_recording_without_an_end_is_kept_whatever_else_is_there(folder: Path) -> None:
    with_report(folder, True)
    (folder / RECORDING).mkdir()
    keep_recording(folder)
    (folder / RECORDING / "header.json").touch()
    with refusing(InputError):
        keep_recording(folder)


def test_the_folder_that_it_offers_is_free(folder: Path) -> None:
    with_report(folder, None)
    (folder.parent / "out-2").mkdir()
    (folder.parent / "out-3").touch()
    with refusing(InputError):
        keep_recording(folder)


def test_a_log_is_kept_unless_it_is_empty_or_no_file(tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    keep_log(log)
    log.touch()
    keep_log(log)
    os.mkfifo(tmp_path / "pipe")
    keep_log(tmp_path / "pipe")
    log.write_text("(0) x 080#")
    with refusing(InputError):
        keep_log(log)
