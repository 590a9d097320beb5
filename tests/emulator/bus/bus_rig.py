"""A bus with stations that the test controls."""

from collections.abc import Iterable
from dataclasses import dataclass

from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.bus.can_controller import CanController
from steptwin.emulator.bus.frame_filter import FrameFilter, StrikeEffect
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.frame import Frame


@dataclass(frozen=True)
class SenderOff:
    """A filter that puts the sender of one frame into bus-off."""

    cob_ids: tuple[int, ...]
    do: str = "sender-off"
    rate: float = 1.0
    skip: int = 0
    count: int | None = 1

    def effect(self) -> StrikeEffect:
        return StrikeEffect(sender_off=True)


class BusRig:
    """A bus whose stations note each frame that they receive, as (counts, frame)."""

    def __init__(self, bitrate: int = 1_000_000, stations: int = 2, faults: Iterable[FrameFilter] = ()) -> None:
        self.bus = Bus(bitrate)
        for fault in faults:
            self.bus.filters.begin(fault)
        self.heard: list[list[tuple[int, Frame]]] = [[] for _ in range(stations)]
        self.errors: list[tuple[int, int, ErrorCode, bool]] = []
        """Reported errors as (counts, station, code, active)."""
        self.stations = [self._station(number) for number in range(stations)]

    def _station(self, number: int) -> CanController:
        station = self.controller(number)
        self.bus.attach(station)
        return station

    def controller(self, number: int) -> CanController:
        """Return a controller that notes the frames and errors of a station."""

        def note_error(code: ErrorCode, counts: int, *, active: bool) -> None:
            self.errors.append((counts, number, code, active))

        return CanController(lambda frame, counts: self.heard[number].append((counts, frame)), note_error)

    def run(self, until_counts: int = 72_000_000) -> None:
        """Step through all events up to an instant."""
        while (now := self.bus.next_event_counts) is not None and now <= until_counts:
            self.bus.step(now)

    def bits(self, count: int) -> int:
        """Return the duration of a number of bits in counts."""
        return count * self.bus.bit_counts
