"""The panel of `serve --panel`: it waits for its words, and ends when its server has ended."""

import json
import os
import signal
import subprocess
import sys

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.host.common.listening import listen
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.command_line import PROGRAM
from tests.features.panel.page.browser import children_of

MODULE = [sys.executable, "-m", "steptwin.features.panel.served"]
WORDS = ["panel", "lab-scara", "--connect", "127.0.0.1:1", "--port", "0"]
"""A panel waits for its board: no board is needed here."""
SERVE = [*PROGRAM, "serve", "lab-scara", "--port", "0"]


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


def test_serve_says_that_its_panel_has_ended() -> None:
    """Killed: its page, which shows an emergency stop, cannot say it."""
    with subprocess.Popen(
        [*SERVE, "--panel", "--panel-port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        assert process.stderr
        try:
            assert any(line.startswith("panel: ") for line in process.stdout)
            (panel,) = children_of(process.pid)
            os.kill(panel, signal.SIGKILL)
            told = process.stderr.readline()
            assert told.startswith(
                "steptwin: warning: the panel has ended by SIGKILL: its page and its E-STOP are dead; "
                "the board goes on; `steptwin panel lab-scara --connect 127.0.0.1:"
            )
            assert told.endswith("` opens it again\n")
            assert process.poll() is None
        finally:
            process.terminate()
            assert process.wait(TIMEOUT_S) == 0
            assert process.stderr.read() == ""


def test_serve_chooses_the_pages_port() -> None:
    with listen("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
        taken = subprocess.run(
            [*SERVE, "--panel-port", str(port)], capture_output=True, text=True, check=False, timeout=TIMEOUT_S
        )
    assert (taken.returncode, taken.stdout) == (4, "")  # said before the board is served
    assert taken.stderr == f"steptwin: 127.0.0.1:{port} is in use; --panel-port 0 takes a free one\n"
    with subprocess.Popen([*SERVE, "--panel-port", str(port)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        try:
            assert any(line == f"panel: http://127.0.0.1:{port}/\n" for line in process.stdout)
        finally:
            process.terminate()
            process.wait(TIMEOUT_S)


def test_a_port_that_no_page_can_have_is_bad_input() -> None:
    asked = [*SERVE, "--panel-port", "80"]
    refused = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    assert (refused.returncode, refused.stderr) == (
        2,
        "steptwin: --panel-port 80: is neither 0 nor from 1024 to 65535\n",
    )
