"""A CAN bus in virtual time: arbitration by identifier, exact frame lengths, one record of all that passed."""

from array import array
from heapq import heappop, heappush

from controller.motion import COUNTS_PER_SECOND
from emulator.can_timing import INTERMISSION_BITS, frame_bits
from protocol.frame import BITRATES, Frame

_VALID_BEFORE_END_BITS = INTERMISSION_BITS + 1
"""A receiver takes a frame as valid at the last but one bit of EOF (ISO 11898-1)."""


class Bus:
    """The wire between the ports; ports are numbered by whoever connects them.

    Work goes by events: `next_event_counts` says when, `step` does what is due then and returns a frame that has
    reached its receivers.
    """

    def __init__(self, bitrate: int) -> None:
        if bitrate not in BITRATES:
            raise ValueError(f"bit rate {bitrate} is not one of {', '.join(map(str, BITRATES))}")
        self.bitrate = bitrate
        self.bit_counts = COUNTS_PER_SECOND // bitrate
        self.log_counts = array("q")
        """When each frame became valid at its receivers."""
        self.log_frames: list[Frame] = []
        self.busy_bits = 0
        self._waiting: list[tuple[int, int, int, Frame]] = []
        self._submitted = 0
        self._free_counts = 0
        self._sending: tuple[int, int, Frame] | None = None

    def submit(self, port: int, frame: Frame, now_counts: int) -> None:
        """A port wants to send; it takes part in the next arbitration. Equal identifiers go in order of submission."""
        if self._sending is None and not self._waiting:
            self._free_counts = max(self._free_counts, now_counts)
        self._submitted += 1
        heappush(self._waiting, (frame.cob_id, self._submitted, port, frame))

    @property
    def next_event_counts(self) -> int | None:
        """When a frame becomes valid or the next arbitration is held; None while nobody sends."""
        if self._sending:
            return self._sending[0]
        return self._free_counts if self._waiting else None

    def step(self, now_counts: int) -> tuple[int, Frame] | None:
        """Do what is due by now: return (port, frame) of a frame now valid, or hold an arbitration and return None."""
        if self._sending:
            valid_counts, port, frame = self._sending
            if valid_counts > now_counts:
                return None
            self._sending = None
            self.log_counts.append(valid_counts)
            self.log_frames.append(frame)
            return port, frame
        if self._waiting and self._free_counts <= now_counts:
            _, _, port, frame = heappop(self._waiting)
            bits = frame_bits(frame)
            self.busy_bits += bits
            self._sending = (now_counts + (bits - _VALID_BEFORE_END_BITS) * self.bit_counts, port, frame)
            self._free_counts = now_counts + bits * self.bit_counts
        return None
