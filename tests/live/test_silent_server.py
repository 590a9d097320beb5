"""A server that falls silent or dies: each command ends with exit code 4 and one line, which says what is unknown."""

import re
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest

from steptwin.host.cli.app import run
from tests.emulator.live.live_rig import TIMEOUT_S, RawClient
from tests.end_to_end.served import Server, in_real_time, serving

ROBOT = "warehouse-scara"
HOME = "0 0 100 0 60 30"
UNSURE = "; nobody knows whether the machine has stopped: use its own e-stop"
LONG_RUN = ["run", ROBOT, "pull-line", "--approach", "-o", "duration_s=120"]
COMMANDS = [
    *(
        [name, ROBOT]
        for name in ("status", "doctor", "monitor", "outputs", "pause", "resume", "stop", "estop", "reset")
    ),
    ["home", ROBOT],
    ["move", ROBOT, "th1=5"],
    ["jog", ROBOT, "th1", "5deg/s"],
    ["run", ROBOT, "pull-line"],
]
STOPPING = ("pause", "stop", "estop")
CONNECTING = ("status", "doctor", "estop", "run")
"""Commands of each kind of message; all connect in the same way."""


@pytest.fixture
def mute_port() -> Iterator[int]:
    """A port at which the operating system accepts connections, and nobody greets."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


@pytest.mark.parametrize("words", [words for words in COMMANDS if words[0] in CONNECTING], ids=" ".join)
def test_it_accepts_and_never_greets(words: list[str], mute_port: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*words, "--connect", f"127.0.0.1:{mute_port}"]) == 4
    out, err = capsys.readouterr()
    told = f"127.0.0.1:{mute_port}: accepts but does not answer within 1 s"
    if words[0] == "doctor":
        assert (out, err) == (f"[FAIL] bus: {told}\n", "")
    else:
        assert (out, err) == ("", f"steptwin: {told}{UNSURE if words[0] in STOPPING else ''}\n")


@in_real_time
def test_estop_of_a_server_that_fell_silent(capsys: pytest.CaptureFixture[str]) -> None:
    """The operating system still accepts for the server; one second is all the time that this may cost."""
    with serving(ROBOT) as server:
        with server.held_up():
            assert server.run("estop", ROBOT) == 4
        told = f"127.0.0.1:{server.port}: accepts but does not answer within 1 s"
        assert capsys.readouterr().err == f"steptwin: {told}{UNSURE}\n"
        assert server.run("estop", ROBOT) == 0


class Deaf:
    """A server that greets one client and then neither reads nor answers; a context manager."""

    def __enter__(self) -> "Deaf":
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._listener.settimeout(TIMEOUT_S)
        self._greeting = threading.Thread(target=self._greet)
        self._greeting.start()
        return self

    def _greet(self) -> None:
        """Accept the client; it is disconnected at the end."""
        self._client, _ = self._listener.accept()
        self._client.sendall(b"< hi >")
        for _ in range(2):
            self._client.recv(100)
            self._client.sendall(b"< ok >")

    def __exit__(self, *_: object) -> None:
        self._greeting.join()
        self._client.close()
        self._listener.close()


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
@in_real_time
def test_it_greets_and_never_answers(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with Deaf() as deaf:
        assert run([*words, "--connect", f"127.0.0.1:{deaf.port}"]) == 4
    out, err = capsys.readouterr()
    if words[0] == "doctor":
        assert re.search(r"(?m)^\[FAIL\] sx node 0x10: does not answer", out)
        assert "[FAIL] nodes: none answers" in out
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


def _moving(server: Server, _program: subprocess.Popen[str]) -> None:
    """Return when an axis moves: the statusword in its report (CiA 402) loses "target reached", its bit 10."""
    with closing(RawClient(server.port)) as witness:
        while True:
            witness.expect(b"< frame 1")
            node, _time, data = witness.expect(b" >").decode().split(" ")
            if node[0] in "9A" and not int(data[2:4], 16) & 0x04:
                return


MIDDLES = [
    (["status", ROBOT, "--watch"], _printed, ""),
    (["monitor", ROBOT], _printed, ""),
    (["jog", ROBOT, "th1", "1deg/s"], _moving, UNSURE),
    (["move", ROBOT, "th1=60", "--speed", "5"], _moving, UNSURE),
    (["home", ROBOT], _moving, UNSURE),
    (LONG_RUN, _moving, UNSURE),
]


@pytest.mark.parametrize(
    ("words", "ready", "told", "blow"),
    [*((*middle, signal.SIGSTOP) for middle in MIDDLES), *((*middle, signal.SIGKILL) for middle in MIDDLES[1::4])],
    ids=lambda value: value[0] if isinstance(value, list) else getattr(value, "name", ""),
)
@in_real_time
def test_in_the_middle(
    words: list[str], ready: Callable[[Server, subprocess.Popen[str]], None], told: str, blow: signal.Signals
) -> None:
    err = _after(words, ready, blow)
    assert re.fullmatch(rf"(?:.*\r)?steptwin: [^\n]+{re.escape(told)}\n", err), err
    assert "Traceback" not in err
