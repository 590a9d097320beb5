"""Commands in this process, and what they print."""

import json
import sys
from typing import Any, Final

import pytest

from steptwin.host.cli.app import run
from tests.messages import refused_with

PROGRAM: Final = [sys.executable, "-m", "steptwin"]
"""The command line as a process of its own."""


def run_json(capsys: pytest.CaptureFixture[str], *words: str, exit_code: int = 0) -> dict[str, Any]:
    """Run a command with --json; return its document after a check of its exit code."""
    capsys.readouterr()
    assert run([*words, "--json"]) == exit_code
    document = json.loads(capsys.readouterr().out)
    assert isinstance(document, dict)
    return document


def refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Run a command with bad input; return the one line on stderr, without the program's name.

    The golden file has this line.
    """
    capsys.readouterr()
    assert run([*words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("steptwin: ")
    return refused_with(line.removeprefix("steptwin: "))
