"""Repeat the embedded host's periodic frames in simulated time, as the timer of a bus interface does in real time."""

from dataclasses import dataclass

import can

from steptwin.emulator.simulation import Simulation
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_US


def whole_us_counts(dt_s: float) -> int:
    """Return a duration in counts, rounded to whole microseconds and at least one, unless it is 0."""
    return max(round(dt_s * 1_000_000), 1 if dt_s > 0 else 0) * COUNTS_PER_US


@dataclass(slots=True)
class _Repeated:
    """A frame that is repeated until `stop`."""

    frame: Frame
    period_counts: int
    due_counts: int
    stopped: bool = False

    def stop(self) -> None:
        self.stopped = True


class RepeatedFrames:
    """Keeps the frames and their next instants; takes the place of python-can's bus in the library's periodic tasks."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._repeated: list[_Repeated] = []
        self.due_counts: int | None = None
        """Instant at which the next frame is due, even if it has been stopped meanwhile; None without frames."""

    def send_periodic(self, message: can.Message, period_s: float) -> _Repeated:
        """Repeat a frame from now on, until `stop` of the object returned."""
        frame = Frame(message.arbitration_id, bytes(message.data))
        repeated = _Repeated(frame, whole_us_counts(period_s), self._simulation.now_counts)
        self._repeated.append(repeated)
        self.due_counts = repeated.due_counts
        return repeated

    def take_due(self) -> list[Frame]:
        """Return the frames that are due by now, each once; missed repetitions are not made up for."""
        now_counts = self._simulation.now_counts
        if self.due_counts is None or self.due_counts > now_counts:
            return []
        self._repeated = [repeated for repeated in self._repeated if not repeated.stopped]
        due = [repeated for repeated in self._repeated if repeated.due_counts <= now_counts]
        for repeated in due:
            passed = (now_counts - repeated.due_counts) // repeated.period_counts
            repeated.due_counts += (passed + 1) * repeated.period_counts
        self.due_counts = min((repeated.due_counts for repeated in self._repeated), default=None)
        return [repeated.frame for repeated in due]
