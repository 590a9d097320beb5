"""The worker's link: every frame and every wait asks first whether a stop was asked for."""

from collections.abc import Callable
from threading import get_ident

import can

from steptwin.host.client.bus_link import BusLink
from steptwin.host.client.bus_network import BusNetwork
from steptwin.host.panel.desk.stops import StopRequests


class StoppableNetwork(BusNetwork):
    """A network on which the thread that has opened it sends no frame after a stop was asked for; others may."""

    def __init__(self, bus: can.BusABC, title: str, stops: StopRequests) -> None:
        super().__init__(bus, title)
        self._stops = stops
        self._worker = get_ident()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; raise StopAskedError in the worker's thread if it must stop, BusError if the bus fails."""
        if get_ident() != self._worker:
            super().send_message(can_id, data, remote)
            return
        with self._stops.sending():
            super().send_message(can_id, data, remote)


class DeskLink(BusLink):
    """A BusLink on which any function of `host/operate` publishes telemetry and ends when a stop is asked for."""

    def __init__(self, bus: can.BusABC, title: str, stops: StopRequests, publish: Callable[[], None]) -> None:
        """Open the link in the worker's thread; `publish` is called in every wait."""
        super().__init__(bus, title, network=lambda: StoppableNetwork(bus, title, stops))
        self._stops = stops
        self._publish = publish

    def wait(self, dt_s: float) -> None:
        """Sleep and publish; raise StopAskedError if the worker must stop, BusError if the bus has failed."""
        super().wait(dt_s)
        self._publish()
        self._stops.check()
