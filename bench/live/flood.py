"""Pass frames from one client to another as fast as the server can, and watch how much memory it uses.

The simulated bus is too fast to limit the rate, and both clients are plain sockets: the server is measured, not
python-can.
"""

import socket
import time
from dataclasses import dataclass
from pathlib import Path
from selectors import EVENT_READ, EVENT_WRITE, DefaultSelector
from typing import Final

from steptwin.bench.live.server import SERVE, serving

SPEED: Final = 100.0
"""Simulated seconds per second: at 100 a bus of 1 Mbit/s takes 800 000 frames/s."""
_COMMAND: Final = b"< send 123 8 1 2 3 4 5 6 7 8 >"
_CHUNK: Final = 1000
_READ_BYTES: Final = 1 << 18


@dataclass(frozen=True)
class FloodFigures:
    """Figures over all frames; memory is the server's resident set after a tenth of the frames and after all."""

    frames: int
    frames_per_s: float
    memory_mb_early: float
    memory_mb_late: float


def measure(frames: int) -> FloodFigures:
    """Send and count `frames` frames; raise AssertionError if some are lost."""
    early, memory_mb_early = frames // 10, 0.0
    with serving(*SERVE, "--speed", str(SPEED)) as server, _raw(server.port) as sender, _raw(server.port) as receiver:
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
    """Return the next bytes to send when `left_bytes` of all commands are left; they may begin within a command."""
    whole = min(_CHUNK, -(-left_bytes // len(_COMMAND)))
    return (_COMMAND * whole)[-left_bytes % len(_COMMAND) :]


def _raw(port: int) -> socket.socket:
    """Connect a client in raw mode; it returns when the server has begun to show it frames."""
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
    """Return the resident set of a process (Linux: VmRSS of proc(5), in KiB)."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0]) * 1024 / 1e6
