"""Measure the server of the operator's page as browsers load it: its start, its load, and a board that dies.

A viewer speaks what the page's script speaks, NiceGUI's messages over Socket.IO, at a hundredth of a browser's price.
"""

import asyncio
import os
import re
import signal
import subprocess
import sys
import time
from ast import literal_eval
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event
from typing import Any, Final
from urllib.parse import urlencode
from urllib.request import urlopen
from uuid import uuid4

from steptwin.bench.live.round_trips import move_all
from steptwin.bench.live.server import ROBOT, SERVE, Server, serving
from steptwin.bench.live.streamed_points import cpu_s

VIEWERS: Final = 5
TIMES: Final = 3
_SETTLE_S: Final = 1.0
_MEASURE_S: Final = 2.5
"""Time of which the load is taken; the motion lasts longer."""
_TIMEOUT_S: Final = 30.0
_QUERY: Final = re.compile(r"^ *query: (\{.*\}),$", re.MULTILINE)
"""Where the page holds what its socket must present, as a Python literal."""


class Viewer:
    """A browser's side of the page: opens it and takes what the server sends."""

    def __init__(self) -> None:
        import socketio  # which comes with the extra `panel`, and is not needed for the other benchmarks

        self.ticks = 0
        """Number of messages with numbers so far."""
        self.grey = asyncio.Event()
        """Set when the server has told the page to turn grey."""
        self._ticked = asyncio.Event()
        self._socket = socketio.AsyncClient(reconnection=False)
        self._socket.on("tick", self._tick)
        self._socket.on("update", self._update)

    async def open(self, url: str) -> None:
        """Load the page and wait for its first numbers."""
        page = (await asyncio.to_thread(_page, url)).decode()
        found = _QUERY.search(page)
        assert found, "the page does not say how to connect"
        query = {**literal_eval(found[1]), "document_id": str(uuid4()), "tab_id": str(uuid4())}
        words = {key: str(value).lower() if isinstance(value, bool) else value for key, value in query.items()}
        await self._socket.connect(
            f"{url}?{urlencode(words)}", transports=["websocket"], socketio_path="/_nicegui_ws/socket.io"
        )
        await asyncio.wait_for(self._ticked.wait(), _TIMEOUT_S)

    async def close(self) -> None:
        """Leave the page."""
        await self._socket.disconnect()

    def _tick(self, _text: str) -> None:
        self.ticks += 1
        self._ticked.set()

    def _update(self, elements: dict[str, Any]) -> None:
        changed = (element for element in elements.values() if isinstance(element, dict))
        if any("unseen" in element.get("class", ()) for element in changed):
            self.grey.set()


def _page(url: str) -> bytes:
    with urlopen(url, timeout=_TIMEOUT_S) as answer:
        page: bytes = answer.read()
    return page


class OpenedPanel:
    """A command that opens a panel, until `end`."""

    def __init__(self, *words: str) -> None:
        self.started_s = time.monotonic()
        command = [sys.executable, "-m", "steptwin", *words]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert self.process.stdout
        addresses = (re.match(r"panel: (\S+)", line) for line in self.process.stdout)
        self.url = next(found[1] for found in addresses if found)

    def end(self) -> None:
        """Stop the command and what it has started."""
        self.process.terminate()
        self.process.communicate(timeout=_TIMEOUT_S)


@contextmanager
def panel(*words: str) -> Iterator[OpenedPanel]:
    """Run a command that opens a panel within the block."""
    opened = OpenedPanel(*words)
    try:
        yield opened
    finally:
        opened.end()


def panel_of(server: Server) -> tuple[str, ...]:
    """Return the words that open a panel, at a free port, of a served board of ROBOT."""
    return ("panel", ROBOT, "--connect", f"127.0.0.1:{server.port}", "--port", "0")


@contextmanager
def watched(server: Server) -> Iterator[None]:
    """Let one viewer, in a thread of its own, watch a served board's panel while the block runs."""
    there, gone = Event(), Event()

    async def watch(url: str) -> None:
        viewer = await _opened(url)
        there.set()
        await asyncio.to_thread(gone.wait)
        await viewer.close()

    with panel(*panel_of(server)) as opened, ThreadPoolExecutor(1) as threads:
        watching = threads.submit(lambda: asyncio.run(watch(opened.url)))
        try:
            assert there.wait(_TIMEOUT_S), "the panel shows nothing"
            yield
        finally:
            gone.set()
        watching.result()


async def _opened(url: str) -> Viewer:
    viewer = Viewer()
    await viewer.open(url)
    return viewer


# --- the start


@dataclass(frozen=True)
class Start:
    """Seconds from a command to its page's first answer, and to the first numbers in it."""

    command: str
    page_s: float
    numbers_s: float


def measure_starts(times: int = TIMES) -> list[Start]:
    """Start `panel` beside a board that is served already, and `serve --panel`, several times each."""
    with serving(*SERVE) as server:
        starts = [_start("panel", *panel_of(server)) for _ in range(times)]
    return starts + [_start("serve --panel", "serve", ROBOT, "--panel", "--port", "0") for _ in range(times)]


def _start(name: str, *words: str) -> Start:
    with panel(*words) as opened:
        _page(opened.url)
        page_s = time.monotonic() - opened.started_s

        async def numbers_s() -> float:
            viewer = await _opened(opened.url)
            seconds = time.monotonic() - opened.started_s
            await viewer.close()
            return seconds

        return Start(name, page_s, asyncio.run(numbers_s()))


# --- the load


@dataclass(frozen=True)
class ServerLoad:
    """What the page's server needs while the machine moves.

    Attributes:
        viewers: number of browsers.
        cores: processor time of the server's process a second.
        ticks_per_s: messages with numbers that each browser gets a second.
    """

    viewers: int
    cores: float
    ticks_per_s: float


def measure_load(viewers: int = VIEWERS) -> ServerLoad:
    """Let browsers watch six axes move."""
    with serving(*SERVE) as server, panel(*panel_of(server)) as opened, server.client() as bus:
        return asyncio.run(_load(opened, viewers, lambda: move_all(bus)))


async def _load(opened: OpenedPanel, number: int, move: Callable[[], None]) -> ServerLoad:
    viewers = [await _opened(opened.url) for _ in range(number)]
    moving = asyncio.create_task(asyncio.to_thread(move))
    await asyncio.sleep(_SETTLE_S)
    before = _now(opened, viewers)
    await asyncio.sleep(_MEASURE_S)
    wall_s, used_s, ticks = (after - first for after, first in zip(_now(opened, viewers), before, strict=True))
    await moving
    for viewer in viewers:
        await viewer.close()
    return ServerLoad(number, used_s / wall_s, ticks / number / wall_s)


def _now(opened: OpenedPanel, viewers: list[Viewer]) -> tuple[float, float, int]:
    return time.monotonic(), cpu_s(opened.process.pid), sum(viewer.ticks for viewer in viewers)


# --- a board that dies

DEATHS: Final = {"SIGSTOP": signal.SIGSTOP, "SIGKILL": signal.SIGKILL}
"""How a board's server dies: it falls silent, or its connections end."""


def measure_grey(death: signal.Signals, times: int = TIMES) -> tuple[float, ...]:
    """Let a board's server die several times; return the ms until the page is told to turn grey."""
    return tuple(_after_death_ms(death) for _ in range(times))


def _after_death_ms(death: signal.Signals) -> float:
    with serving(*SERVE) as server, panel(*panel_of(server)) as opened:
        return asyncio.run(_grey_ms(opened.url, lambda: os.kill(server.process.pid, death)))


async def _grey_ms(url: str, die: Callable[[], None]) -> float:
    viewer = await _opened(url)
    await asyncio.sleep(_SETTLE_S)
    died_s = time.monotonic()
    die()
    await asyncio.wait_for(viewer.grey.wait(), _TIMEOUT_S)
    grey_ms = 1000 * (time.monotonic() - died_s)
    await viewer.close()
    return grey_ms
