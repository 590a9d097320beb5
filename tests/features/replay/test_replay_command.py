"""`steptwin replay`: what it prints, its exit codes, and input that it refuses."""

import shutil
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.record.folder import BUS_LOG
from tests.end_to_end.command_line import refusal, run_json


@pytest.fixture
def other(carry_run: Path, tmp_path: Path) -> Path:
    """The bus log of the run, as another program would have recorded it."""
    log = tmp_path / "other.log"
    log.write_text((carry_run / BUS_LOG).read_text().replace("steptwin0", "can0"))
    return log


@pytest.mark.slow
def test_the_folder_of_a_run(carry_run: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Robot, start and edges are those of the folder; so they are beside its bus log."""
    capsys.readouterr()
    assert run(["replay", str(carry_run), "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{carry_run}/bus.log: 821 frames on the board's clock, 554 of them played to teaching-scara",
        "frames: the same, to the microsecond",
        f"edges: all those of {carry_run}, to the count",
        f"the replay's report, edges and bus log are in {tmp_path}/",
    ]
    assert (tmp_path / BUS_LOG).read_bytes() == (carry_run / BUS_LOG).read_bytes()


def test_the_log_of_a_run_is_compared_with_the_folder(carry_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = run_json(capsys, "replay", str(carry_run / BUS_LOG), "teaching-scara")
    assert document["equal"]
    assert document["against"] == str(carry_run)
    assert document["frames"] is document["edges"] is None
    assert document["recorded_frames"] == document["replayed_frames"] == 821


def test_a_computers_log(carry_run: Path, other: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run(["replay", str(other), "teaching-scara", "--against", str(carry_run)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{other}: 821 frames by a computer's clock, 554 of them played to teaching-scara",
        "frames: the nodes say the same",
        f"edges: the drivers make the steps of {carry_run}, those of the last motion within 0.0 us",
    ]


@pytest.mark.slow
def test_without_the_run_the_machine_stands_where_it_is_said(other: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its home is the job's start here; a board that had stored its settings says its robot's name when asked."""
    words = ("replay", str(other), "teaching-scara", "--new-board")
    document = run_json(capsys, *words)
    assert document["equal"]
    assert document["clock"] == "wall"
    assert document["against"] is document["step_shift_us_max"] is None
    elsewhere = run_json(capsys, *words, "--machine", "stand-at=10 0 0 0")
    assert elsewhere["equal"]  # a board without memory of its position does not know where it stands


@pytest.mark.slow
def test_a_recording_that_was_cut_and_one_that_differs(
    carry_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "altered"
    shutil.copytree(carry_run, folder)
    lines = (carry_run / BUS_LOG).read_text().splitlines(keepends=True)
    (folder / BUS_LOG).write_text("".join(lines[:400]) + "(0000000000.3")
    capsys.readouterr()
    assert run(["replay", str(folder)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[1] == "the recording is cut off within a frame: it is compared up to there"
    record = next(i for i, line in enumerate(lines) if i > 400 and " 511#" in line)
    lines[record] = lines[record].replace("511#", "511#7F")[:-3] + "\n"
    (folder / BUS_LOG).write_text("".join(lines))
    assert run(["replay", str(folder)]) == 1
    printed = capsys.readouterr().out.splitlines()
    assert printed[1].startswith("frames: first difference at 0.0")
    assert printed[2].startswith(f"edges: first difference from {folder}: at 0.")


def test_bad_input_is_one_line(
    carry_run: Path, other: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(other)
    (tmp_path / "empty.log").touch()
    refusal(capsys, "replay", str(tmp_path / "no.log"), "lab-scara")
    refusal(capsys, "replay", str(tmp_path / "empty.log"), "lab-scara")
    refusal(capsys, "replay", str(tmp_path), "teaching-scara", "--against", str(carry_run))
    refusal(capsys, "replay", log)
    refusal(capsys, "replay", log, "lab-skara")
    refusal(capsys, "replay", log, "lab-scara", "-m", "bitrate=9600")
    refusal(capsys, "replay", log, "lab-scara", "--machine", "boards=9")
    refusal(capsys, "replay", log, "lab-scara", "-c", "can7")
    refusal(capsys, "replay", log, "lab-scara", "--machine", "stand-at=1 2 3")
    refusal(capsys, "replay", log, "lab-scara", "--against", str(carry_run))
    refusal(capsys, "replay", log, "lab-scara", "--against", str(tmp_path))
