"""A user's firmware as a shared library, and its process: `python library.py FILE` is one board's.

This file runs alone in that process, so it imports only the standard library. Output of the library goes to stderr. A
request is a name with its arguments, by `marshal`. An answer is a header and two bodies of bytes. The firmware may also
write into that pipe, so its bytes are not trusted.
"""

import ctypes
import marshal
import os
import struct
import sys
from typing import Any, Final

ABI: Final = 1
NEVER: Final = (1 << 64) - 1
TICK_COUNTS: Final = 18_000
EDGE_BYTES = FRAME_BYTES = 16
FUNCTIONS: Final = (
    "st_abi",
    "st_set_flash",
    "st_boot",
    "st_receive",
    "st_inputs",
    "st_next_due",
    "st_run",
    "st_take_edges",
    "st_take_frames",
    "st_flash",
)
"""Required functions of a library (steptwin_firmware.h)."""
_ROOM: Final = 4096
"""Number of edges and frames fetched in one call."""
_TAKEN_MAX: Final = 1 << 20
"""Largest number of them in one answer."""
_FLASH_MAX: Final = 1 << 20
_AXES_MAX: Final = 8

Answer = tuple[int, int, bytes, bytes]
"""Instant reached, next instant when a frame may leave, and the new edges and frames in C's layout."""


HEADER: Final = struct.Struct("<4sIQQII")
"""Header of an answer: `MARK`, its kind, two instants, and the sizes of its bodies."""
MARK: Final = b"STfw"
WORK, DATA, COMPLAINT = range(3)
"""Kinds of answers: an `Answer`, bytes, and an error text about the library."""
BODIES_MAX: Final = _TAKEN_MAX * (EDGE_BYTES + FRAME_BYTES)


class UnusableLibraryError(Exception):
    """The file is no library, or violates the interface; a sentence without the file's name."""


class NativeLibrary:
    """A loaded library; its firmware starts with `boot`."""

    def __init__(self, path: str) -> None:
        """Load a library; raise UnusableLibraryError if it does not have the interface."""
        try:
            library = ctypes.CDLL(path)
        except OSError as error:
            raise UnusableLibraryError(f"cannot be loaded: {error}") from error
        for name in FUNCTIONS:
            if not hasattr(library, name):
                raise UnusableLibraryError(f"has no function {name} (steptwin_firmware.h)")
        if (abi := library.st_abi()) != ABI:
            raise UnusableLibraryError(f"is made for interface {abi}, and this is {ABI}")
        self._run, self._due = library.st_run, library.st_next_due
        self._edges, self._frames = library.st_take_edges, library.st_take_frames
        self._run.argtypes, self._run.restype = [ctypes.c_uint64], ctypes.c_uint64
        self._due.restype = ctypes.c_uint64
        for take in (self._edges, self._frames):
            take.argtypes, take.restype = [ctypes.c_void_p, ctypes.c_uint32], ctypes.c_uint32
        library.st_boot.argtypes = [ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint64]
        library.st_receive.argtypes = library.st_inputs.argtypes = [ctypes.c_char_p, ctypes.c_uint64]
        library.st_flash.argtypes, library.st_flash.restype = [ctypes.c_void_p, ctypes.c_uint32], ctypes.c_uint32
        library.st_set_flash.argtypes = [ctypes.c_char_p, ctypes.c_uint32]
        self._library = library
        self._edge_room = ctypes.create_string_buffer(_ROOM * EDGE_BYTES)
        self._frame_room = ctypes.create_string_buffer(_ROOM * FRAME_BYTES)
        self._edge_place = ctypes.addressof(self._edge_room)
        self._frame_place = ctypes.addressof(self._frame_room)
        self._reached = 0

    def boot(self, axes: int, node: int, flash: bytes, now: int) -> Answer:
        """Power up with a flash content."""
        self._library.st_set_flash(flash, len(flash))
        self._library.st_boot(axes, node, now)
        return self._answer(now)

    def receive(self, frame: bytes, now: int) -> Answer:
        """Receive a frame in C's layout."""
        self._library.st_receive(frame, now)
        return self._answer(now)

    def inputs(self, levels: bytes, now: int) -> Answer:
        """Set the levels of all axes in C's layout."""
        self._library.st_inputs(levels, now)
        return self._answer(now)

    def run(self, until: int, resting: int) -> Answer:
        """Let time pass; return at the end of the servo tick in which an axis of the mask `resting` moves a pin."""
        if not resting:
            return self._answer(self._run(until))
        edges = b""
        while True:
            end = min(until, (self._reached + 1) // TICK_COUNTS * TICK_COUNTS + TICK_COUNTS - 1)
            reached, due, new, frames = self._answer(self._run(end))
            edges += new
            if reached > end:  # later than requested; the caller sees it by its own instant
                return min(until + reached - end, NEVER), due, edges, frames
            woken = any(resting >> new[at] & 1 and new[at + 2] < 2 for at in range(8, len(new), EDGE_BYTES))
            if woken or frames or reached != end or reached >= until:
                return reached, due, edges, frames

    def flash(self) -> bytes:
        """Return the flash content."""
        room = ctypes.create_string_buffer(_FLASH_MAX)
        return room.raw[: min(self._library.st_flash(room, _FLASH_MAX), _FLASH_MAX)]

    def _answer(self, reached: int) -> Answer:
        self._reached = reached
        edges = self._taken("st_take_edges", self._edges, self._edge_place, EDGE_BYTES)
        frames = self._taken("st_take_frames", self._frames, self._frame_place, FRAME_BYTES)
        return reached, self._due(), edges, frames

    @staticmethod
    def _taken(name: str, take: Any, place: int, size: int) -> bytes:
        count = take(place, _ROOM)
        if not count:
            return b""
        taken = bytearray()
        while True:
            if count > _ROOM:
                raise UnusableLibraryError(f"{name} says that it gives {count}, where room is for {_ROOM}")
            taken += ctypes.string_at(place, count * size)
            if count < _ROOM:
                return bytes(taken)
            if len(taken) >= _TAKEN_MAX * size:
                raise UnusableLibraryError(f"{name} gives more than {_TAKEN_MAX} at once")
            count = take(place, _ROOM)


def request(name: str, *arguments: Any) -> bytes:
    """Return a request's bytes."""
    body = marshal.dumps((name, *arguments))
    return len(body).to_bytes(4, "little") + body


def _requested(stream: int) -> Any:
    """Read a request from a file descriptor; raise EOFError at its end."""
    data, size = b"", 4
    while len(data) < size:
        part = os.read(stream, 1 << 16)
        if not part:
            raise EOFError
        data += part
        if len(data) >= 4:
            size = 4 + int.from_bytes(data[:4], "little")
    return marshal.loads(data[4:])


def _answer(stream: int, kind: int, reached: int, due: int, *bodies: bytes) -> None:
    data = HEADER.pack(MARK, kind, reached, due, *map(len, bodies)) + b"".join(bodies)
    while data:
        data = data[os.write(stream, data) :]


def main() -> None:
    """Serve one board's firmware until the other end closes."""
    requests, answers = os.dup(0), os.dup(1)
    os.dup2(2, 1)
    try:
        library = NativeLibrary(sys.argv[1])
        calls = {each.__name__: each for each in (library.boot, library.receive, library.inputs, library.run)}
        _answer(answers, DATA, 0, 0, b"", b"")
        while True:
            name, *arguments = _requested(requests)
            if name == library.flash.__name__:
                _answer(answers, DATA, 0, 0, library.flash(), b"")
            else:
                _answer(answers, WORK, *calls[name](*arguments))
    except UnusableLibraryError as error:
        _answer(answers, COMPLAINT, 0, 0, str(error).encode(), b"")
    except (EOFError, OSError):  # the other end has closed
        return


if __name__ == "__main__":
    main()
