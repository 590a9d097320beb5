"""Run programs that need a terminal in a pseudo terminal, and keep everything that they write."""

import os
import select
import signal
import subprocess
import time
from pathlib import Path

from tests.emulator.live.live_rig import TIMEOUT_S

_INTERRUPT_EVERY_S = 5.0


class Terminal:
    """A program with a terminal of its own; a context manager, after which the program has ended.

    Args:
        words: the program and its arguments.
        cwd: where it runs.
        variables: of its environment, beside those that there are.
    """

    def __init__(self, words: list[str], cwd: Path, **variables: str) -> None:
        self._terminal, slave = os.openpty()
        self._process = subprocess.Popen(
            words,
            cwd=cwd,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "120", "LINES": "40", **variables},
        )
        os.close(slave)
        self.written = ""
        """Everything written so far."""

    def __enter__(self) -> "Terminal":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._terminal)

    def await_text(self, text: str) -> None:
        """Read until the program has written this text."""
        deadline_s = time.monotonic() + TIMEOUT_S
        while text not in self.written:
            assert time.monotonic() < deadline_s, f"not within {TIMEOUT_S:g} s: {text!r} in {self.written!r}"
            self._read()

    def type(self, keys: str) -> None:
        """Send keys, as a user does."""
        os.write(self._terminal, keys.encode())

    def interrupt(self) -> None:
        """Press Ctrl-C until the program has ended: Python drops an interrupt that comes during a finalizer."""
        while self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            self._await_exit(_INTERRUPT_EVERY_S)

    def await_exit(self) -> int:
        """Read what the program writes until it ends; return its exit code."""
        self._await_exit(TIMEOUT_S)
        assert self._process.returncode is not None, f"did not end after {self.written!r}"
        return self._process.returncode

    def _await_exit(self, timeout_s: float) -> None:
        deadline_s = time.monotonic() + timeout_s
        while self._process.poll() is None and time.monotonic() < deadline_s:
            self._read()

    def _read(self) -> None:
        """Read what comes within 50 ms. Linux reports an error when the program has closed its end."""
        if select.select([self._terminal], [], [], 0.05)[0]:
            try:
                self.written += os.read(self._terminal, 1 << 16).decode(errors="replace")
            except OSError:
                assert self._process.wait(TIMEOUT_S) is not None
