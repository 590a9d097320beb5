"""The README and the page of commands do what they tell."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.pages import ROOT, blocks_of, read_page

README = read_page("README.md")
PAGE = read_page("docs/commands.md")
MOTIONS = read_page("docs/motions.md")
BLOCKS = blocks_of(PAGE)
COMMANDS = [
    line for language, block in BLOCKS if not language for line in block.splitlines() if line.startswith("steptwin ")
]


@pytest.mark.parametrize("line", COMMANDS)
def test_command(line: str, carry_run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each exits with 0, but the run whose stream is cut with 3, and the run with slow drivers with 1."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line.split(">", maxsplit=1)[0], comments=True)
    if words[1] in {"trace", "plot", "verify", "replay"}:
        shutil.copytree(carry_run, words[2])
    expected = {"--cut-stream": 3, "--driver-profile": 1}
    assert run(words[1:]) == next((code for option, code in expected.items() if option in words), 0)


def test_there_are_commands() -> None:
    assert len(COMMANDS) >= 8


@pytest.mark.parametrize("text", [README, PAGE, MOTIONS], ids=["README.md", "commands.md", "motions.md"])
def test_python(text: str) -> None:
    for code in [block for language, block in blocks_of(text) if language == "python"]:
        subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, cwd="/")


def test_the_csv_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (csv,) = [block for language, block in BLOCKS if language == "csv"]
    (tmp_path / "mine.csv").write_text(csv, encoding="utf-8")
    assert run(["run", "teaching-scara", str(tmp_path / "mine.csv")]) == 0
    assert "PASSED" in capsys.readouterr().out


def test_it_shows_what_the_demo_prints(capsys: pytest.CaptureFixture[str]) -> None:
    """The README shows all lines but those with wall times."""
    assert run(["run", "warehouse-scara", "drawer-pull"]) == 0
    printed = [line for line in capsys.readouterr().out.splitlines() if "SIMULATED" not in line]
    assert len(printed) >= 10
    for line in printed:
        assert line.rstrip() in README


def test_it_is_short_and_begins_with_a_moving_picture() -> None:
    """A visitor sees in thirty seconds what it is: at most 130 lines, and a picture of less than 500 kB."""
    lines = README.splitlines()
    assert len(lines) <= 130
    (picture,) = re.findall(r"\]\((docs/pictures/[^)]*\.gif)\)", lines[2])
    assert (ROOT / picture).stat().st_size < 500_000
