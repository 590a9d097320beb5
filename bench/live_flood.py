"""Frames from one client to another as fast as the server passes them, and what it needs of memory meanwhile.

The simulated bus is so fast that it is no limit, and both clients are plain sockets, so that the server is measured and
not python-can.
"""

import socket
import time
from dataclasses import dataclass
from pathlib import Path
from selectors import EVENT_READ, EVENT_WRITE, DefaultSelector
from typing import Final

from steptwin.bench.live_server import serving

SPEED: Final = 100.0
"""Times real time: a bus of 1 Mbit/s takes 800 000 frames/s then."""
_COMMAND: Final = b"< send 123 8 1 2 3 4 5 6 7 8 >"
_CHUNK: Final = 1000
_READ_BYTES: Final = 1 << 18


@dataclass(frozen=True)
class FloodFigures:
    """Of all frames; memory is the server's resident set after a tenth of them and after all."""

    frames: int
    frames_per_s: float
    memory_mb_early: float
    memory_mb_late: float


def measure(frames: int) -> FloodFigures:
    """Send and count; raises AssertionError if frames are lost."""
    early, memory_mb_early = frames // 10, 0.0
    with serving("--speed", str(SPEED)) as server, _raw(server.port) as sender, _raw(server.port) as receiver:
        with DefaultSelector() as selector:
            selector.register(sender, EVENT_WRITE)
            selector.register(receiver, EVENT_READ)
            left, arrived = frames * len(_COMMAND), 0
            started_s = time.perf_counter()
            while arrived < frames:
                for key, _ in selector.select():
                    if key.fileobj is receiver:
                        data = receiver.recv(_READ_BYTES)
                        assert data, f"disconnected after {arrived} frames"
                        arrived += data.count(b">")
                    else:
                        left -= sender.send(_rest(left))
                        if not left:
                            selector.unregister(sender)
                if not memory_mb_early and arrived >= early:
                    memory_mb_early = _memory_mb(server.process.pid)
            frames_per_s = frames / (time.perf_counter() - started_s)
        memory_mb_late = _memory_mb(server.process.pid)
        assert server.end()["bus"]["frames"] >= frames
    return FloodFigures(frames, frames_per_s, memory_mb_early, memory_mb_late)


def _rest(left_bytes: int) -> bytes:
    """The next commands, of which so many bytes are left altogether: it may begin within one."""
    whole = min(_CHUNK, -(-left_bytes // len(_COMMAND)))
    return (_COMMAND * whole)[-left_bytes % len(_COMMAND) :]


def _raw(port: int) -> socket.socket:
    """A client in raw mode that is shown frames already."""
    sock = socket.create_connection(("127.0.0.1", port))
    text = b""
    for command, answer in ((b"", b"< hi >"), (b"< open vcan0 >", b"< ok >"), (b"< rawmode >", b"< ok >")):
        sock.sendall(command)
        while not text.endswith(answer):
            text += sock.recv(_READ_BYTES)
    time.sleep(0.2)  # longer than the silence after `rawmode`
    sock.setblocking(False)
    return sock


def _memory_mb(pid: int) -> float:
    """The resident set of a process, Linux: VmRSS of proc(5), which counts in KiB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0]) * 1024 / 1e6
