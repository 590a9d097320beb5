"""No command replaces a file unasked: it says so before the work, and --replace lets it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.command_line import refusal

CALIBRATE = ["calibrate", "calibration-scara"]
KEPT = "somebody's"


def measured(folder: Path) -> list[str]:
    path = folder / "m.csv"
    assert run([*CALIBRATE, str(path), "--simulate", "50"]) == 0
    return [*CALIBRATE, str(path)]


def words(*some: str) -> Callable[[Path, Path], list[str]]:
    """Return a command's words, {} standing for the folder of a run."""
    return lambda _folder, stored: [word.format(stored) for word in some]


@pytest.mark.parametrize(
    ("command", "option", "names"),
    [
        (words("kernel-c"), [], ["README.md", "steptwin_kernel.c", "steptwin_kernel.h"]),
        (lambda folder, _: measured(folder), ["--out"], ["robot.toml", "calibration.json", "residuals.png"]),
        (words("workspace", "teaching-scara", "--samples", "10"), ["--out"], ["workspace.json", "cloud.csv"]),
        (words("plot", "{}", "--what", "joints"), ["--out"], ["joints.png"]),
        (words("plot", "{}", "--what", "joints", "--format", "svg"), ["--out"], ["joints.svg"]),
        (words("motors", "{}"), ["--out"], ["motor-load.png"]),
    ],
)
def test_of_a_folder(
    command: Callable[[Path, Path], list[str]],
    option: list[str],
    names: list[str],
    carry_run: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("matplotlib")
    given, out = command(tmp_path, carry_run), tmp_path / "out"
    capsys.readouterr()
    for name in names:
        out.mkdir(exist_ok=True)
        (out / name).write_text(KEPT)
        told = refusal(capsys, *given, *option, str(out))
        assert told == f"{out / name}: exists: take another name, or --replace"
        assert [path.name for path in out.iterdir()] == [name]
        assert (out / name).read_text() == KEPT
        (out / name).unlink()


@pytest.mark.parametrize(
    ("given", "name"),
    [
        (["trace", "{}", "--out"], "mine.vcd"),
        (["trace", "{}", "--format", "csv", "--out"], "mine.csv"),
        ([*CALIBRATE, "--simulate", "3"], "measured.csv"),
        (["new", "--kind", "scara"], "arm.toml"),
    ],
)
def test_of_a_file(
    given: list[str], name: str, carry_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_text(KEPT)
    asked = [*(word.format(carry_run) for word in given), str(path)]
    assert refusal(capsys, *asked) == f"{path}: exists: take another name, or --replace"
    assert path.read_text() == KEPT
    assert run([*asked, "--replace"]) == 0
    assert path.read_text() != KEPT


@pytest.mark.parametrize("name", ["robot.toml", "trajectory.csv"])
def test_a_run_replaces_a_run_and_nothing_else(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A robot's own file may have the name of one in a run's folder."""
    (tmp_path / name).write_text(KEPT)
    for command in (["run", "teaching-scara", "carry"], ["serve", "teaching-scara", "--port", "0"]):
        told = refusal(capsys, *command, "--out", str(tmp_path))
        assert told.startswith(f"--out {tmp_path}: holds {name}, which no run has written: take another folder")
        assert [path.read_text() for path in tmp_path.iterdir()] == [KEPT]


def test_what_belongs_to_a_run_is_written_again(carry_run: Path) -> None:
    """Its trace and its pictures follow from its other files."""
    for _ in range(2):
        assert run(["trace", str(carry_run)]) == 0
