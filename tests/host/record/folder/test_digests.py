"""A folder whose files are of two runs is refused, and one of a version that wrote no digests is read."""

import json
import shutil
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.whole_file import files_together

MIXED = "robot.toml is not the file with which report.json was written: changed since, or of another run"


@pytest.fixture
def folder(tmp_path: Path, carry_run: Path) -> Path:
    """A copy of a run, whose robot's file has been replaced by one that says the same."""
    copied = shutil.copytree(carry_run, tmp_path / "mixed")
    (copied / "robot.toml").write_text((copied / "robot.toml").read_text() + "# of another run\n")
    return copied


def test_a_mixture_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["verify", str(folder), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert (document["passed"], document["reasons"], document["of_other_runs"]) == (False, [MIXED], ["robot.toml"])
    assert run(["verify", str(folder)]) == 1
    assert MIXED in capsys.readouterr().out


def test_it_is_told_beside_what_else_is_wrong(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = folder / "bus.log"
    log.write_text("".join(log.read_text().splitlines(keepends=True)[1:]))
    assert run(["verify", str(folder)]) == 1
    told = capsys.readouterr()
    assert "robot.toml, bus.log are not the files with which report.json was written" in told.err
    assert "report.json says bus.frames = " in told.out


def test_a_report_without_digests_is_read(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = json.loads((folder / "report.json").read_text())
    assert set(report.pop("files")) == {"robot.toml", "trajectory.csv", "edges.npz", "shelf.json", "bus.log"}
    (folder / "report.json").write_text(json.dumps(report))
    assert run(["verify", str(folder)]) == 0
    assert "PASSED" in capsys.readouterr().out


def test_files_together(tmp_path: Path) -> None:
    """All or none take their places; stale ones go, and others stay."""
    for name in ("a", "b", "stale", "other"):
        (tmp_path / name).write_text("old")

    def names() -> dict[str, str]:
        return {path.name: path.read_text() for path in tmp_path.iterdir()}

    before = names()

    def fill() -> None:
        with files_together(tmp_path) as new:
            (new / "a").write_text("new")
            raise OSError(28, "No space left", str(new / "b"))

    with pytest.raises(OSError, match="No space") as caught:
        fill()
    assert caught.value.filename == str(tmp_path / "b")
    assert names() == before
    with files_together(tmp_path, "b", ["a", "stale"]) as new:
        for name in ("a", "b"):
            (new / name).write_text("new")
    assert names() == {"a": "new", "b": "new", "other": "old"}
