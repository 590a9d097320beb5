"""The README's commands and its Python blocks do what the page tells."""

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.pages import ROOT, blocks_of, read_page

README = read_page("README.md")
MOTIONS = read_page("docs/motions.md")
BLOCKS = blocks_of(README)
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


@pytest.mark.parametrize("text", [README, MOTIONS], ids=["README.md", "motions.md"])
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
