"""A user's own firmware, compiled for this computer, on an emulated board: the C interface and who calls it.

The firmware of a board has a process of its own: it may hang or crash, and that ends with a sentence.
"""

import select
import signal
import subprocess
import sys
import weakref
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from steptwin.emulator.native import library

HEADER: Final = "steptwin_firmware.h"
_FILES: Final = (HEADER, "steptwin_hal.h", "steptwin_hal.c", "example.c")
HANGS_S: Final = 5.0
"""Wall time after which a call that has not returned is given up; each is for at most 0.1 s of the board's time."""
_LOADS_S: Final = 60.0
"""The same of the process' start, which takes long on a busy computer."""


def interface_files() -> dict[str, str]:
    """Return the text of each file by its name: the interface, the hardware layer over it, and an example."""
    folder = files(__name__)
    return {name: (folder / name).read_text(encoding="utf-8") for name in _FILES}


class FirmwareError(Exception):
    """A user's firmware cannot be loaded, has crashed or hangs, or has broken the interface; one sentence says it."""


class FirmwareProcess:
    """A process that has loaded a library. It ends with `close`, or with this object."""

    def __init__(self, path: Path) -> None:
        """Load a library; raise FirmwareError if that is impossible."""
        self._path = path
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", library.__file__, str(path.resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # Ctrl-C is for the program, which ends this process itself
        )
        assert self._process.stdin
        assert self._process.stdout
        self._requests, self._answers = self._process.stdin.fileno(), self._process.stdout.fileno()
        self.close: weakref.finalize[..., object] = weakref.finalize(self, _end, self._process)
        """End the process; the flash is lost."""
        unusable = self._answer("loading", _LOADS_S)
        if unusable is not None:
            self.close()
            raise FirmwareError(f"{path}: {unusable}")

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a method of `NativeLibrary`; raise FirmwareError if it does not return."""
        try:
            library.write(self._requests, (name, *arguments))
        except BrokenPipeError:
            raise self._ended(name) from None
        return self._answer(name, HANGS_S)

    def _answer(self, name: str, within_s: float) -> Any:
        if not select.select([self._answers], [], [], within_s)[0]:
            self.close()
            raise FirmwareError(f"{self._path}: {_C_NAMES[name]} has not returned for {within_s:g} s: does it loop?")
        try:
            return library.read(self._answers)
        except EOFError:
            raise self._ended(name) from None

    def _ended(self, name: str) -> FirmwareError:
        code = self._process.wait()
        self.close()
        how = f"crashed: {signal.Signals(-code).name}" if code < 0 else f"ended the process, with exit code {code}"
        return FirmwareError(f"{self._path}: {_C_NAMES[name]} {how}")


_C_NAMES: Final = {
    "loading": "loading it",
    "boot": "st_boot",
    "receive": "st_receive",
    "inputs": "st_inputs",
    "run": "st_run",
    "flash": "st_flash",
}


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    for stream in (process.stdin, process.stdout):
        if stream:
            stream.close()
    process.wait()
