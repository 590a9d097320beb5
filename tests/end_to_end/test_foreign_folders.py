"""A folder from somebody else: nothing is written through its links, and its pipes are not waited for."""

import os
import shutil
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import refusal

KEPT = "somebody else's"


@pytest.fixture
def folder(carry_run: Path, tmp_path: Path) -> Path:
    return shutil.copytree(carry_run, tmp_path / "run")


@pytest.fixture
def target(tmp_path: Path) -> Path:
    """Return a file elsewhere that no command may touch."""
    path = tmp_path / "elsewhere" / "kept"
    path.parent.mkdir()
    path.write_text(KEPT)
    return path


def draw_nothing(patch: pytest.MonkeyPatch) -> None:
    """Let pictures be empty: these tests are about their files."""
    figure = pytest.importorskip("matplotlib.figure").Figure
    patch.setattr("steptwin.host.record.plots.picture.draw_picture", lambda *_: figure())


def untouched(target: Path) -> bool:
    return target.read_text() == KEPT and os.listdir(target.parent) == [target.name]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("trace.vcd", ["trace"]),
        ("trace.csv", ["trace", "--format", "csv"]),
        ("trace.npz", ["trace", "--format", "npz"]),
        ("joints.png", ["plot", "--what", "joints"]),
        ("joints.svg", ["plot", "--what", "joints", "--format", "svg"]),
    ],
)
@pytest.mark.parametrize("part", ["", ".part"])
def test_what_belongs_to_a_run_is_not_written_through_a_link(
    name: str,
    words: list[str],
    part: str,
    folder: Path,
    target: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if words[0] == "plot":
        draw_nothing(monkeypatch)
    link = folder / f"{name}{part}"
    link.unlink(missing_ok=True)
    link.symlink_to(target)
    command, *options = words
    if part:  # a name that the file once had while it was written
        assert run([command, str(folder), *options]) == 0
    else:
        told = refusal(capsys, command, str(folder), *options)
        assert told == f"{link}: is a symbolic link, through which nothing is written: remove it, or take another name"
    assert untouched(target)
    assert link.is_symlink()


@pytest.mark.parametrize("words", [["run", "teaching-scara", "carry"], ["workspace", "teaching-scara"]])
def test_a_folder_with_a_link_is_refused_before_the_work(
    words: list[str], tmp_path: Path, target: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "trace.vcd").symlink_to(target)
    told = refusal(capsys, *words, "--out", str(out))
    assert told.startswith(f"--out {out}: trace.vcd: is a symbolic link, through which nothing is written")
    assert untouched(target)
    assert os.listdir(out) == ["trace.vcd"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rows", "report", "files"])
def test_a_campaign_does_not_write_into_a_linked_folder(
    name: str, tmp_path: Path, target: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / name).symlink_to(target.parent)
    told = refusal(capsys, "campaign", "nightly", "--runs", "1", "--out", str(out))
    assert f"{name}: is a symbolic link, through which nothing is written" in told
    assert untouched(target)


@pytest.mark.parametrize("name", ["report.json", "robot.toml", "trajectory.csv", "edges.npz", "bus.log"])
def test_a_pipe_among_the_files_is_not_waited_for(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / name).unlink()
    os.mkfifo(folder / name)
    refusal(capsys, "verify", str(folder))


@pytest.mark.parametrize(
    "words",
    [
        ["run", "teaching-scara", "{}/motion.csv"],
        ["run", "teaching-scara", "{}/motion.toml"],
        ["run", "{}/motion.toml", "carry"],
        ["check", "{}/motion.toml"],
        ["replay", "{}/motion.log", "teaching-scara"],
        ["replay", "{}/motion.blf", "teaching-scara"],
        ["calibrate", "calibration-scara", "{}/motion.csv"],
    ],
)
@pytest.mark.parametrize("device", [None, "/dev/zero"], ids=["pipe", "device"])
def test_a_pipe_or_a_device_is_not_read(
    words: list[str], device: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix in ("csv", "toml", "log", "blf"):
        path = tmp_path / f"motion.{suffix}"
        if device is None:
            os.mkfifo(path)
        else:
            path.symlink_to(device)
    told = refusal(capsys, *(word.format(tmp_path) for word in words))
    assert "is no file but a pipe or a device, which is not read" in told
