"""Served boards as processes, and tests that talk to them in real time on a computer that may be busy."""

import functools
import json
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, Final, ParamSpec

from steptwin.host.cli.app import run
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.command_line import PROGRAM
from tests.messages import forget
from tests.repeats import count_repeat
from tests.turns import alone

LATE_MS: Final = 100.0
"""Lateness from which on a failure may be the computer's: an axis misses its host's heartbeat after 350 ms."""
ATTEMPTS: Final = 8
TOGETHER: Final = 2
"""Attempts beside the tests of other workers; in the further ones these wait."""
_SLOWNESS: Final = re.compile(r"steptwin: warning: computer too slow: .*\n")
_P = ParamSpec("_P")


class ComputerTooSlowError(AssertionError):
    """A test in real time failed while this computer was too slow for real time."""


def start_program(*words: str) -> subprocess.Popen[str]:
    """Start a command as a process."""
    return subprocess.Popen([*PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


class Server:
    """A `steptwin serve` on a free port.

    Attributes:
        process: the program.
        banner: the lines that it printed first, up to the one that says how it ends.
        port: where it listens.
        slowness: the warnings at its end that the computer is too slow, which tests of other things do not expect.
    """

    def __init__(self, robot: str, *options: str) -> None:
        self.process = subprocess.Popen(
            [*PROGRAM, "serve", robot, "--port", "0", *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        printed = self.process.stderr if "--json" in options else self.process.stdout
        assert printed
        self.banner = [printed.readline().rstrip()]
        while self.banner[-1] not in ("", "Ctrl-C ends it"):
            self.banner.append(printed.readline().rstrip())
        port = re.search(r"port=(\d+)", self.banner[1])
        assert port, self.banner
        self.port = int(port[1])
        self.slowness: list[str] = []

    def connected(self, *words: str) -> list[str]:
        """Return the words of a command for this board."""
        return [*words, "--connect", f"127.0.0.1:{self.port}"]

    def run(self, *words: str) -> int:
        """Run a command on this board, in this process; return its exit code."""
        return run(self.connected(*words))

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Start a command on this board as a process."""
        return start_program(*self.connected(*words))

    def json(self, *words: str) -> dict[str, Any]:
        """Run a command on this board, in this process, which must succeed in silence; return its document."""
        with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
            code = self.run(*words, "--json")
        assert (code, err.getvalue()) == (0, "")
        document: dict[str, Any] = json.loads(out.getvalue())
        return document

    def end(self, number: signal.Signals) -> tuple[int, str, str]:
        """Send a signal; return exit code, stdout and stderr without `slowness`."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=TIMEOUT_S)
        self.slowness = _SLOWNESS.findall(err)
        return self.process.returncode, out, _SLOWNESS.sub("", err)

    @contextmanager
    def held_up(self) -> Iterator[None]:
        """Hold the process up while the block runs, as a computer does that has no time for it."""
        self.process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self.process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        """End the server at once, whatever has become of it."""
        self.process.kill()
        self.process.communicate()

    def late_ms(self) -> float:
        """End the server; return by how many milliseconds it was late at most, as its report says."""
        return late_ms_of(self.end(signal.SIGTERM)[1])


def late_ms_of(report: str) -> float:
    """Return for how many milliseconds at most a server was late or its clock stood, by its report in text or JSON."""
    in_ms = re.findall(r"late, ms \(p50 p99 max\): \S+ \S+ ([\d.]+)", report)
    in_us = re.findall(r'"late_us_max": ([\d.]+)', report)
    stood_texts = re.findall(r'longest (\d+) ms|"longest_ms": ([\d.]+)', report)
    stood = [float(text or number) for text, number in stood_texts]
    return max([float(text) for text in in_ms] + [float(text) / 1000 for text in in_us] + stood)


@contextmanager
def serving(robot: str, *options: str) -> Iterator[Server]:
    """Serve a robot's board while the block runs; a failure in the block says how late the server was."""
    server = Server(robot, *options)
    try:
        with explained(server):
            yield server
    finally:
        server.kill()


_KEPT: Final[dict[str, Server]] = {}
"""The servers that blocks of `kept_serving` have left, by their robots."""


@contextmanager
def kept_serving(robot: str) -> Iterator[Server]:
    """Serve as `serving` does, by the server that the block before has left: to start one takes a second's computing.

    The machine is reset then. A failure ends its server, so that the next block has a new one; a test that may fail on
    a busy computer is repeated. `kept_servers` ends what is left.
    """
    server = _KEPT.pop(robot, None)
    if server is None:
        server = Server(robot)
    elif server.run("reset", robot) != 0:
        server.kill()
        server = Server(robot)
    try:
        with explained(server):
            yield server
    except BaseException:
        server.kill()
        raise
    _KEPT[robot] = server


@contextmanager
def kept_servers() -> Iterator[None]:
    """End, after the block, the servers that were kept in it."""
    try:
        yield
    finally:
        while _KEPT:
            _KEPT.popitem()[1].kill()


@contextmanager
def explained(server: Server) -> Iterator[None]:
    """Let a failure in the block say how late the server was, which ends it."""
    try:
        yield
    except Exception as error:
        if server.process.poll() is None:
            explain(error, server.late_ms())
        raise


def _waited_ms() -> float:
    """Return for how many ms any process has waited for a processor since the start of this computer.

    This is Linux' pressure stall information; 0 on systems that do not have it.
    """
    pressure = Path("/proc/pressure/cpu")
    waited_us = re.search(r"^some .* total=(\d+)", pressure.read_text()) if pressure.exists() else None
    return int(waited_us[1]) / 1000 if waited_us else 0.0


def in_real_time(test: Callable[_P, None]) -> Callable[_P, None]:
    """Repeat a test that fails while this computer is too slow for real time; let any other failure stand.

    So a busy computer makes the test slow, not red. A stream that runs dry, or a missed heartbeat or answer, says
    nothing about StepTwin when processes had to wait for a processor. After TOGETHER attempts the tests of other
    workers wait meanwhile. Fixtures are made once, so each attempt needs a folder of its own in `tmp_path`.
    """

    @functools.wraps(test)
    def repeated(*args: _P.args, **kwargs: _P.kwargs) -> None:
        for attempt in range(1, ATTEMPTS + 1):
            before_ms = _waited_ms()
            forget()
            try:
                with alone() if attempt > TOGETHER else nullcontext():
                    test(*args, **kwargs)
                return
            except ComputerTooSlowError:
                if attempt == ATTEMPTS:
                    raise
            except Exception as error:
                waited_ms = _waited_ms() - before_ms
                if waited_ms < LATE_MS or attempt == ATTEMPTS:
                    error.add_note(f"processes waited for a processor for {waited_ms:.0f} ms, attempt {attempt}")
                    raise
            count_repeat()

    return repeated


def explain(error: Exception, late_ms: float) -> None:
    """Note how late the server was; raise ComputerTooSlowError if that may be why the test failed."""
    note = f"the server was late by {late_ms:.0f} ms at most"
    if late_ms >= LATE_MS:
        raise ComputerTooSlowError(f"{note}, the computer was too slow for real time: {error}") from error
    error.add_note(note)
