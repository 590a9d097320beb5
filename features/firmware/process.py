"""Process of a user's firmware on an emulated board.

The firmware of a board has a process of its own, with all of its children. If it hangs, crashes or writes junk, it ends
with an error.
"""

import os
import select
import signal
import subprocess
import sys
import time
import weakref
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.firmware import library

HEADER: Final = "steptwin_firmware.h"
_FILES: Final = (HEADER, "steptwin_hal.h", "steptwin_hal.c", "example.c")
HANGS_S: Final = 5.0
"""Wall time after which a call that has not returned is aborted; each covers at most 0.1 s of board time."""
_LOADS_S: Final = 60.0
"""Longest wall time of the process' start on a busy computer."""
_ENDS_S: Final = 2.0
"""Wall time for a process to end after it has closed its pipes or was killed."""
_LOOK_S: Final = 0.1
"""Wall time after which a long exchange is checked."""
_SENTENCE_BYTES: Final = 500


def interface_files() -> dict[str, str]:
    """Return the text of each file by its name: the interface, the hardware layer over it, and an example."""
    folder = files(__package__)
    return {name: (folder / name).read_text(encoding="utf-8") for name in _FILES}


class FirmwareProcess:
    """A process with a loaded library. It ends with `close` or with this object, and so do its children."""

    def __init__(self, path: Path) -> None:
        """Load a library; raise FirmwareError if that is impossible."""
        self._path = path
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", library.__file__, str(path.resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # a group of its own: Ctrl-C is for this program, which ends the group itself
        )
        assert self._process.stdin
        assert self._process.stdout
        self._requests, self._answers = self._process.stdin.fileno(), self._process.stdout.fileno()
        self._to_write, self._to_read = select.poll(), select.poll()
        self._to_write.register(self._requests, select.POLLOUT)
        self._to_read.register(self._answers, select.POLLIN)
        os.set_blocking(self._requests, False)
        self.close: weakref.finalize[..., object] = weakref.finalize(self, _end, self._process)
        """End the process and its group; the flash is lost."""
        self._exchange("loading", b"", _LOADS_S)

    def call(self, name: str, *arguments: Any) -> library.Answer:
        """Call a method of `NativeLibrary` that does work; raise FirmwareError if it does not return."""
        reached, due, edges, frames = self._exchange(name, library.request(name, *arguments), HANGS_S, library.WORK)
        return reached, due, edges, frames

    def flash(self) -> bytes:
        """Return the flash content; raise FirmwareError as `call`."""
        return self._exchange("flash", library.request("flash"), HANGS_S)[2]

    def _exchange(self, name: str, request: bytes, within_s: float, kind: int = library.DATA) -> library.Answer:
        """Send a request and return its answer, which must come in time and be of this kind."""
        deadline_s = time.monotonic() + within_s
        try:
            self._write(request, deadline_s)
            return self._read(kind, deadline_s)
        except TimeoutError:
            why = f"{_C_NAMES[name]} has not returned for {within_s:g} s: does it loop?"
        except (EOFError, BrokenPipeError):
            why = f"{_C_NAMES[name]} {self._fate()}"
        except _JunkError:
            why = f"{_C_NAMES[name]} has written into the pipe of its answers"
        except library.UnusableLibraryError as error:
            why = str(error)
        self.close()
        raise FirmwareError(f"{self._path}: {why}")

    def _write(self, data: bytes, deadline_s: float) -> None:
        while data:
            try:
                data = data[os.write(self._requests, data) :]
            except BlockingIOError:
                self._wait(self._to_write, deadline_s)

    def _read(self, kind: int, deadline_s: float) -> library.Answer:
        data, size, head = b"", library.HEADER.size, None
        while len(data) < size:
            self._wait(self._to_read, deadline_s)
            part = os.read(self._answers, 1 << 16)
            if not part:
                raise EOFError
            data += part
            if head is None and len(data) >= size:
                mark, *head = library.HEADER.unpack_from(data)
                bodies = head[3] + head[4]
                if mark != library.MARK or head[0] not in (kind, library.COMPLAINT) or bodies > library.BODIES_MAX:
                    raise _JunkError
                size += bodies
        if head is None or len(data) > size:
            raise _JunkError
        given, reached, due, first, _ = head
        middle = library.HEADER.size + first
        if given == library.COMPLAINT:
            raise library.UnusableLibraryError(_sentence(data[library.HEADER.size : middle]))
        return reached, due, data[library.HEADER.size : middle], data[middle:]

    def _wait(self, ready: select.poll, deadline_s: float) -> None:
        """Wait until a pipe is ready.

        Raises:
            TimeoutError: the time is over.
            EOFError: the process has ended; a child of it may still hold the pipe open.
        """
        while time.monotonic() < deadline_s:
            if ready.poll(1000.0 * _LOOK_S):
                return
            if self._process.poll() is not None and not ready.poll(0):
                raise EOFError
        raise TimeoutError

    def _fate(self) -> str:
        """Return why a process has closed its end of a pipe."""
        try:
            code = self._process.wait(_ENDS_S)
        except subprocess.TimeoutExpired:
            return "has closed the pipes of its process"
        return f"crashed: {_signal_name(-code)}" if code < 0 else f"ended the process, with exit code {code}"


class _JunkError(Exception):
    """An answer does not have our format."""


_C_NAMES: Final = {
    "loading": "loading it",
    "boot": "st_boot",
    "receive": "st_receive",
    "inputs": "st_inputs",
    "run": "st_run",
    "flash": "st_flash",
}


def _signal_name(number: int) -> str:
    """Return a signal's name; the real-time signals between the first and the last have none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _sentence(text: bytes) -> str:
    """Return an error text as one line; a firmware may have forged it."""
    return " ".join(text[:_SENTENCE_BYTES].decode(errors="replace").split())


def _end(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process and its group, even if it has already ended."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    for stream in (process.stdin, process.stdout):
        if stream:
            stream.close()
    with suppress(subprocess.TimeoutExpired):
        process.wait(_ENDS_S)
