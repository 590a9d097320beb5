"""Figures of a served board, by its control port: how busy its bus is, how late it is, how often its clock stands."""

import time
from collections import deque
from threading import Event as Flag
from threading import Thread
from typing import Final

from steptwin.host.client.control_client import ControlClient
from steptwin.host.common.errors import StepTwinError
from steptwin.host.common.processes import ClockStood, Slowness
from steptwin.host.panel.desk.history import EventLog
from steptwin.host.panel.desk.state import DeskState

_PERIOD_S: Final = 0.5
_RECENT: Final = 10
"""Number of answers over which it is told which part of the time the board's clock has stood: five seconds."""


class BoardFigures:
    """Asks a control port twice a second, in a thread of its own; without an answer the figures are unknown."""

    def __init__(self, host: str, port: int, state: DeskState) -> None:
        self._client = ControlClient(host, port)
        self._state = state
        self._clock = ClockWatch(state.events)
        self._closing = Flag()
        self._thread = Thread(target=self._run, name="desk figures", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and the connection."""
        self._closing.set()
        self._thread.join()
        self._client.close()

    def _run(self) -> None:
        while not self._closing.is_set():
            self._ask()
            self._closing.wait(_PERIOD_S)

    def _ask(self) -> None:
        desk = self._state
        try:
            board = self._client.state()
        except StepTwinError:
            desk.bus_load_percent = desk.late_ms = desk.stood_percent = None
        else:
            desk.bus_load_percent, desk.late_ms = board.bus_load_percent, board.ticks.late_us_p99 / 1000
            desk.stood_percent = self._clock.percent(time.monotonic(), board.stood)


class ClockWatch:
    """Watches how a served board's clock stands since the computer is too slow, and tells of it in the events."""

    def __init__(self, events: EventLog) -> None:
        self._events = events
        self._slowness = Slowness()
        self._recent: deque[tuple[float, float]] = deque(maxlen=_RECENT + 1)
        """The instant of each answer in seconds, and for how long the clock had stood by then in ms."""

    def percent(self, now_s: float, stood: ClockStood) -> float:
        """Return in percent for how much of the last seconds the clock has stood, 0 at the first answer."""
        if self._recent and stood.total_ms < self._recent[-1][1]:  # another board
            self._recent.clear()
            self._slowness = Slowness()
        if self._slowness.worth_telling(stood):
            self._events.warning(str(stood))
        self._recent.append((now_s, stood.total_ms))
        begin_s, begin_ms = self._recent[0]
        return 0.1 * (stood.total_ms - begin_ms) / (now_s - begin_s) if now_s > begin_s else 0.0
