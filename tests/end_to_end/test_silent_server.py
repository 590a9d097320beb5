"""A server that falls silent or dies: each command ends with exit code 4 and one line, which says what is unknown."""

import re
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator

import pytest

from steptwin.host.cli.app import run
from tests.emulator.live_rig import TIMEOUT_S
from tests.end_to_end.served import Server, in_real_time, serving, start_program

ROBOT = "warehouse-scara"
HOME = "0 0 100 0 60 30"
UNSURE = "; nobody knows whether the machine has stopped: use its own e-stop"
LONG_RUN = ["run", ROBOT, "drawer-pull", "--approach", "-o", "duration_s=120"]
COMMANDS = [
    *(
        [name, ROBOT]
        for name in ("status", "doctor", "monitor", "outputs", "pause", "resume", "stop", "estop", "reset")
    ),
    ["home", ROBOT],
    ["move", ROBOT, "th1=5"],
    ["jog", ROBOT, "th1", "5deg/s"],
    ["run", ROBOT, "drawer-pull"],
]
STOPPING = ("pause", "stop", "estop")


@pytest.fixture
def mute_port() -> Iterator[int]:
    """A port at which the operating system accepts connections, and nobody greets."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_it_accepts_and_never_greets(words: list[str], mute_port: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*words, "--connect", f"127.0.0.1:{mute_port}"]) == 4
    out, err = capsys.readouterr()
    told = f"127.0.0.1:{mute_port}: accepts but does not answer within 1 s"
    if words[0] == "doctor":
        assert (out, err) == (f"[FAIL] bus: {told}\n", "")
    else:
        assert (out, err) == ("", f"steptwin: {told}{UNSURE if words[0] in STOPPING else ''}\n")


@in_real_time
def test_estop_ends_within_two_seconds_whenever_the_server_fell_silent() -> None:
    """The limit is for the command itself, not for the start of Python."""
    with serving(ROBOT) as server, socket.create_server(("127.0.0.1", 0)) as mute:
        server.process.send_signal(signal.SIGSTOP)
        for port in (server.port, mute.getsockname()[1]):
            before_s = time.monotonic()
            assert run(["estop", ROBOT, "--connect", f"127.0.0.1:{port}"]) == 4
            assert time.monotonic() - before_s < 2.0
        server.process.send_signal(signal.SIGCONT)
        assert server.run("estop", ROBOT) == 0


class Deaf:
    """A server that greets one client and then neither reads nor answers; a context manager."""

    def __enter__(self) -> "Deaf":
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._listener.settimeout(TIMEOUT_S)
        return self

    def greet(self) -> None:
        """Accept the next client; it is disconnected at the end."""
        self._client, _ = self._listener.accept()
        self._client.sendall(b"< hi >")
        for _ in range(2):
            self._client.recv(100)
            self._client.sendall(b"< ok >")

    def __exit__(self, *_: object) -> None:
        self._client.close()
        self._listener.close()


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_it_greets_and_never_answers(words: list[str]) -> None:
    with Deaf() as deaf:
        connected = start_program(*words, "--connect", f"127.0.0.1:{deaf.port}")
        deaf.greet()
        begun_s = time.monotonic()
        out, err = connected.communicate(timeout=TIMEOUT_S)
        assert time.monotonic() - begun_s < TIMEOUT_S / 4
    assert connected.returncode == 4
    if words[0] == "doctor":
        assert re.search(r"(?m)^\[FAIL\] sx node 0x10: sx: node 0x10 does not answer", out)
    else:
        assert out == ""
        assert re.fullmatch(rf"steptwin: .*does not answer.*{UNSURE if words[0] in STOPPING else ''}\n", err)


def _after(words: list[str], ready: Callable[[Server, subprocess.Popen[str]], None], blow: signal.Signals) -> str:
    """Start a command on a homed machine, signal the server in the middle of it; return what it says on stderr."""
    with serving(ROBOT) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        program = server.start(*words)
        ready(server, program)
        server.process.send_signal(blow)
        _, err = program.communicate(timeout=TIMEOUT_S)
        assert program.returncode == 4, err
    return err


def _printed(_: Server, program: subprocess.Popen[str]) -> None:
    assert program.stdout
    assert program.stdout.readline()


def _moving(server: Server, program: subprocess.Popen[str]) -> None:
    while not any(axis["moving"] for axis in server.json("status", ROBOT)["axes"]):
        assert program.poll() is None, program.communicate()


MIDDLES = [
    (["status", ROBOT, "--watch"], _printed, ""),
    (["monitor", ROBOT], _printed, ""),
    (["jog", ROBOT, "th1", "1deg/s"], _moving, UNSURE),
    (["move", ROBOT, "th1=60", "--speed", "5"], _moving, UNSURE),
    (["home", ROBOT], _moving, UNSURE),
    (LONG_RUN, _moving, UNSURE),
]


@pytest.mark.parametrize("blow", [signal.SIGSTOP, signal.SIGKILL], ids=["stopped", "killed"])
@pytest.mark.parametrize(("words", "ready", "told"), MIDDLES, ids=[words[0] for words, _, _ in MIDDLES])
@in_real_time
def test_in_the_middle(
    words: list[str], ready: Callable[[Server, subprocess.Popen[str]], None], told: str, blow: signal.Signals
) -> None:
    err = _after(words, ready, blow)
    assert re.fullmatch(rf"(?:.*\r)?steptwin: [^\n]+{re.escape(told)}\n", err), err
    assert "Traceback" not in err
