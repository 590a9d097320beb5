"""docs/live-session.md: its commands, typed in its terminals, print what the page shows."""

import doctest
import re
import shlex
import signal
import subprocess
import time
from itertools import pairwise
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple

import can

from steptwin.protocol.frame import COB_RPDO, FIRST_NODE_ID
from tests.end_to_end.command_line import PROGRAM
from tests.end_to_end.pages import blocks_of, read_page
from tests.end_to_end.served import explain, in_real_time, late_ms_of

PAGE = read_page("docs/live-session.md")
PORT_SHOWN = "29536"
CONNECT = "--connect 127.0.0.1"
COB_RECORDS = COB_RPDO[3] + FIRST_NODE_ID
COMMAND_TIMEOUT_S = 120.0
SERVER = 1
"""The terminal in which the board is served."""
LIKE_SHOWN = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


class Step(NamedTuple):
    """A command, the number of its terminal, and the output that the page shows."""

    terminal: int
    command: str
    shown: str


STEPS = [
    Step(int(terminal), command, shown)
    for language, block in blocks_of(PAGE)
    if language == "console"
    for terminal, command, shown in re.findall(r"^(\d)\$ (.*)\n((?:(?!\d\$ ).*\n)*)", block, flags=re.MULTILINE)
]


class Terminals:
    """Runs each terminal's commands one after the other, on a free port instead of the one that the page shows.

    A context manager, after which all commands have ended; a failure says how late the server was.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        script = folder / "steptwin"
        script.write_text(f'#!/bin/sh\nexec {shlex.join(PROGRAM)} "$@"\n', encoding="utf-8")
        script.chmod(0o755)
        self._running: dict[int, tuple[Step, subprocess.Popen[str]]] = {}
        self._exit_codes: dict[int, int] = {}
        self._port = PORT_SHOWN

    def start(self, step: Step) -> None:
        command = step.command.replace(CONNECT, f"{CONNECT}:{self._port}").replace("steptwin ", "exec ./steptwin ", 1)
        if command == "echo $?":
            command = f"echo {self._exit_codes[step.terminal]}"
        process = subprocess.Popen(
            command, shell=True, cwd=self._folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self._running[step.terminal] = step, process

    def serve(self, step: Step) -> None:
        """Start the server on a free port, which its second line shows."""
        self.start(step._replace(command=f"{step.command} --port 0"))
        _, process = self._running[step.terminal]
        assert process.stdout
        banner = "".join(process.stdout.readline() for _ in step.shown.splitlines())
        self._port = re.findall(r"port=(\d+)", banner)[0]
        self._compare(step, banner)
        self._running[step.terminal] = step, process

    def interrupt(self, step: Step) -> None:
        """Press Ctrl-C; the page shows the output after it."""
        _, process = self._running[step.terminal]
        process.send_signal(signal.SIGINT)
        self._running[step.terminal] = step, process

    def finish(self, terminal: int) -> None:
        """Wait until the command there has ended."""
        step, process = self._running.pop(terminal)
        printed, _ = process.communicate(timeout=COMMAND_TIMEOUT_S)
        self._exit_codes[terminal] = process.returncode
        self._compare(step, printed)

    def _compare(self, step: Step, printed: str) -> None:
        shown = step.shown.replace(f":{PORT_SHOWN}", f":{self._port}").replace(f"={PORT_SHOWN}", f"={self._port}")
        alike = doctest.OutputChecker().check_output(shown, printed, LIKE_SHOWN)
        assert alike, f"{step.terminal}$ {step.command}\n{printed}"

    def is_running(self, terminal: int) -> bool:
        return terminal in self._running

    def await_records(self, terminal: int) -> None:
        """Listen on the bus until the command in this terminal sends PVT records to the first axis."""
        step, process = self._running[terminal]
        deadline_s = time.monotonic() + COMMAND_TIMEOUT_S
        with can.Bus(interface="socketcand", channel="vcan0", host="127.0.0.1", port=int(self._port)) as bus:
            while (message := bus.recv(timeout=1.0)) is None or message.arbitration_id != COB_RECORDS:
                assert process.poll() is None, f"{step.terminal}$ {step.command}\n{process.communicate()[0]}"
                assert time.monotonic() < deadline_s, step.command

    def __enter__(self) -> "Terminals":
        return self

    def __exit__(self, _type: object, error: object, _traceback: object) -> None:
        server = self._running.pop(SERVER, None)
        for _, process in self._running.values():
            process.kill()
            process.communicate()
        if server is None:
            return
        server[1].send_signal(signal.SIGTERM)
        try:
            report, _ = server[1].communicate(timeout=COMMAND_TIMEOUT_S)
        finally:
            server[1].kill()
            server[1].wait()
        if isinstance(error, Exception):
            explain(error, late_ms_of(report))


@in_real_time
def test_the_session(tmp_path: Path) -> None:
    with Terminals(Path(mkdtemp(dir=tmp_path))) as terminals:
        play(terminals)


def play(terminals: Terminals) -> None:
    """Type the page's commands; each runs on while commands in terminals of higher numbers are typed, and no longer."""
    for step, following in pairwise([*STEPS, Step(0, "", "")]):
        if step.command == "^C":
            terminals.interrupt(step)
        elif " serve " in step.command:
            terminals.serve(step)
        else:
            if terminals.is_running(step.terminal):
                terminals.finish(step.terminal)
            terminals.start(step)
        if following.terminal > step.terminal:
            if step.terminal == 2:
                terminals.await_records(step.terminal)
        else:
            terminals.finish(step.terminal)


def test_the_page_shows_every_command_that_it_should() -> None:
    shown = {step.command.split()[1] for step in STEPS if step.command.startswith("steptwin ")}
    wanted = "serve doctor status home move jog positions run monitor pause resume stop verify trace"
    assert shown == set(wanted.split())
