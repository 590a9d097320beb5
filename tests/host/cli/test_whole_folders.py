"""Commands whose --replace replaces a folder as a whole: one that fails half way leaves the older files."""

import errno
from pathlib import Path

import pytest

from steptwin.host.cli.app import run


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "last"),
    [
        (("workspace", "lab-scara", "--samples", "50"), "steptwin.host.cli.robots.workspace.whole_file"),
        (("calibrate", "calibration-scara", "{measured}"), "steptwin.features.calibration.command._draw"),
    ],
)
def test_a_full_disk_leaves_the_folder(
    words: tuple[str, ...], last: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = tmp_path / "measured.csv"
    assert run(["calibrate", "calibration-scara", str(measured), "--simulate", "50"]) == 0
    command = [*(word.format(measured=measured) for word in words), "--out", str(tmp_path / "out")]
    assert run(command) == 0
    (tmp_path / "out" / "own.txt").write_text("a user's file", encoding="utf-8")
    before = contents(tmp_path / "out")
    assert len(before) > 2
    monkeypatch.setattr(last, full)
    assert run([*command, "--replace"]) != 0
    assert contents(tmp_path / "out") == before
    monkeypatch.undo()
    assert run([*command, "--replace"]) == 0
    assert contents(tmp_path / "out").keys() == before.keys()
