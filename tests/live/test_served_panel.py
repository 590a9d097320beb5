"""The panel of `serve --panel`: it waits for its words, and ends when its server has ended."""

import json
import subprocess
import sys

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from tests.emulator.live_rig import TIMEOUT_S

MODULE = [sys.executable, "-m", "steptwin.host.cli.served_panel"]
WORDS = ["panel", "lab-scara", "--connect", "127.0.0.1:1", "--port", "0"]
"""A panel waits for its board: no board is needed here."""


def test_it_ends_with_its_server_however_that_ends() -> None:
    """A killed server leaves nothing but the end of the panel's standard input."""
    with subprocess.Popen(MODULE, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin
        assert process.stdout
        process.stdin.write(json.dumps(WORDS) + "\n")
        process.stdin.flush()
        assert process.stdout.readline().startswith("panel: http://127.0.0.1:")
        assert process.stdout.readline() == "Ctrl-C ends it\n"
        process.stdin.close()
        assert process.wait(TIMEOUT_S) == 0
        assert process.stdout.read() == ""


def test_it_ends_without_words() -> None:
    assert subprocess.run(MODULE, stdin=subprocess.DEVNULL, check=False, timeout=TIMEOUT_S).returncode == 0
