"""Figures of a served board, by its control port: how busy its bus is and how late it is."""

from threading import Event as Flag
from threading import Thread
from typing import Final

from steptwin.host.client.control_client import ControlClient
from steptwin.host.common.errors import StepTwinError
from steptwin.host.panel.desk.publisher import Known

_PERIOD_S: Final = 0.5


class Figures:
    """Asks a control port twice a second, in a thread of its own; without an answer the figures are unknown."""

    def __init__(self, host: str, port: int, known: Known) -> None:
        self._client = ControlClient(host, port)
        self._known = known
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
        try:
            state = self._client.state()
        except StepTwinError:
            self._known.bus_load_percent = self._known.late_ms = None
        else:
            self._known.bus_load_percent, self._known.late_ms = state.bus_load_percent, state.ticks.late_us_p99 / 1000
