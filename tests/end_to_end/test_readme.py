"""The README's commands and its Python do what it says."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from host.cli.app import run

README = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)
COMMANDS = [
    line for language, block in BLOCKS if not language for line in block.splitlines() if line.startswith("steptwin ")
]


@pytest.mark.parametrize("line", COMMANDS)
def test_command(line: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each ends with 0, the one whose host dies with 3."""
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line.split(">", maxsplit=1)[0], comments=True)
    assert run(words[1:]) == (3 if "--cut-stream" in words else 0)


def test_there_are_commands() -> None:
    assert len(COMMANDS) >= 8


def test_python() -> None:
    (code,) = [block for language, block in BLOCKS if language == "python"]
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, cwd="/")


def test_it_shows_what_the_demo_prints(capsys: pytest.CaptureFixture[str]) -> None:
    """All lines but those with wall times or a place."""
    assert run(["run", "warehouse-scara", "drawer-pull"]) == 0
    printed = [line for line in capsys.readouterr().out.splitlines() if "SIMULATED" not in line]
    assert len(printed) >= 10
    for line in printed:
        assert line.rstrip() in README
