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
from contextlib import AbstractContextManager, contextmanager, nullcontext
from statistics import median
from threading import Event
from typing import Any, Final, Self
from urllib.parse import urlencode
from urllib.request import urlopen
from uuid import uuid4

from steptwin.bench.live_server import ROBOT, SERVE, Server, cpu_s, move_all, silence_python_can

VIEWERS: Final = 5
TIMES: Final = 3
LATENESS_RATIO_MAX: Final = 1.5
CORES_MAX: Final = 0.25
START_MAX_S: Final = 4.0
_SETTLE_S: Final = 1.0
_MEASURE_S: Final = 2.5
"""Time for the measurement of the load; the motion lasts longer."""
_TIMEOUT_S: Final = 30.0
_QUERY: Final = re.compile(r"^ *query: (\{.*\}),$", re.MULTILINE)
"""The place where the page holds what its socket must present, as a Python literal."""


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
    """A command that opens a panel, until its block is left."""

    def __init__(self, *words: str) -> None:
        self.started_s = time.monotonic()
        command = [sys.executable, "-m", "steptwin", *words]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert self.process.stdout
        addresses = (re.match(r"panel: (\S+)", line) for line in self.process.stdout)
        self.url = next(found[1] for found in addresses if found)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.communicate(timeout=_TIMEOUT_S)


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

    with OpenedPanel(*panel_of(server)) as opened, ThreadPoolExecutor(1) as threads:
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


def start_texts() -> Iterator[str]:
    """Start `panel` beside a board that is served already, and `serve --panel`, several times each.

    Yield the seconds from each command to its page's first answer, and to the first numbers in it.
    """
    with Server(*SERVE) as server:
        yield _start_text("panel", *panel_of(server))
    yield _start_text("serve --panel", "serve", ROBOT, "--panel", "--port", "0")


def _start_text(command: str, *words: str) -> str:
    page_s, numbers_s = map(median, zip(*(_start(*words) for _ in range(TIMES)), strict=True))
    return (
        f"{command}: the page is there {page_s:.1f} s after the command, with numbers in it after {numbers_s:.1f} s"
        f" (medians of {TIMES}; limit {START_MAX_S:g} s)"
    )


def _start(*words: str) -> tuple[float, float]:
    with OpenedPanel(*words) as opened:
        _page(opened.url)
        page_s = time.monotonic() - opened.started_s

        async def numbers_s() -> float:
            viewer = await _opened(opened.url)
            seconds = time.monotonic() - opened.started_s
            await viewer.close()
            return seconds

        return page_s, asyncio.run(numbers_s())


# --- the load


def load_text() -> str:
    """Return what the page's server needs while browsers watch six axes move."""
    with Server(*SERVE) as server, OpenedPanel(*panel_of(server)) as opened, server.client() as bus:
        cores, ticks_per_s = asyncio.run(_load(opened, lambda: move_all(bus)))
    return (
        f"The page's server with {VIEWERS} browsers, each with {ticks_per_s:.0f} updates a second:"
        f" {cores:.0%} of a core (limit {CORES_MAX:.0%})"
    )


async def _load(opened: OpenedPanel, move: Callable[[], None]) -> tuple[float, float]:
    """Return the processor time of the server's process a second, and the messages with numbers a browser gets."""
    viewers = [await _opened(opened.url) for _ in range(VIEWERS)]
    moving = asyncio.create_task(asyncio.to_thread(move))
    await asyncio.sleep(_SETTLE_S)
    before = _now(opened, viewers)
    await asyncio.sleep(_MEASURE_S)
    wall_s, used_s, ticks = (after - first for after, first in zip(_now(opened, viewers), before, strict=True))
    await moving
    for viewer in viewers:
        await viewer.close()
    return used_s / wall_s, ticks / VIEWERS / wall_s


def _now(opened: OpenedPanel, viewers: list[Viewer]) -> tuple[float, float, int]:
    return time.monotonic(), cpu_s(opened.process.pid), sum(viewer.ticks for viewer in viewers)


def lateness_text(times: int = TIMES) -> str:
    """Move a board without a panel, then another one with a panel that a browser shows, in turns."""
    silence_python_can()
    pairs = [(_tick_late_us(lambda _server: nullcontext()), _tick_late_us(watched)) for _ in range(times)]
    alone_us, watched_us = map(median, zip(*pairs, strict=True))
    return (
        "99th percentile of the served board's tick lateness while six axes move, medians of"
        f" {times} runs: {watched_us:.0f} us with a panel that a browser shows,"
        f" {alone_us:.0f} us without: x {watched_us / alone_us:.2f} (limit {LATENESS_RATIO_MAX:g})"
    )


def _tick_late_us(company: Callable[[Server], AbstractContextManager[None]]) -> float:
    with Server(*SERVE) as server:
        with company(server), server.client() as bus:
            move_all(bus)
        late_us: float = server.end()["real_time"]["ticks"]["late_us_p99"]
    return late_us


# --- a board that dies

DEATHS: Final = {"SIGSTOP": signal.SIGSTOP, "SIGKILL": signal.SIGKILL}
"""The ways that a board's server dies: it falls silent, or its connections end."""


def measure_grey(death: signal.Signals, times: int = TIMES) -> tuple[float, ...]:
    """Let a board's server die several times; return the ms until the page is told to turn grey."""
    return tuple(_after_death_ms(death) for _ in range(times))


def _after_death_ms(death: signal.Signals) -> float:
    with Server(*SERVE) as server, OpenedPanel(*panel_of(server)) as opened:
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
