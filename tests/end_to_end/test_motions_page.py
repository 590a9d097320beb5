"""docs/motions.md: its files run, and its commands print what it shows."""

import re
import shlex
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.end_to_end.pages import ROOT

TEXT = (ROOT / "docs" / "motions.md").read_text(encoding="utf-8")
FILES = re.findall(r"This is `([^`]+)`.*?```csv\n(.*?)```", TEXT, re.DOTALL)
SESSIONS = "".join(re.findall(r"```console\n(.*?)```", TEXT, re.DOTALL))
COMMANDS = [command.split("\n") for command in SESSIONS.removeprefix("$ ").rstrip("\n").split("\n$ ")]


def test_there_are_files_and_commands() -> None:
    assert [name for name, _ in FILES] == ["pick.csv", "square.csv", "sweep.csv"]
    assert len(COMMANDS) == 5


@pytest.mark.slow
@pytest.mark.parametrize("lines", COMMANDS, ids=lambda lines: lines[0])
def test_a_command_prints_what_the_page_shows(
    lines: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The page leaves out the report."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES:
        Path(name).write_text(text, encoding="utf-8")
    command, *shown = lines
    refused = shown[0].startswith("steptwin: ")
    assert run(shlex.split(command)[1:]) == (2 if refused else 0)
    captured = capsys.readouterr()
    on_stderr = [line for line in shown if line.startswith("steptwin: ")]
    on_stdout = [line for line in shown if line not in on_stderr]
    assert captured.err.splitlines() == on_stderr
    assert captured.out.splitlines()[: len(on_stdout)] == on_stdout
    assert refused or "PASSED" in captured.out
