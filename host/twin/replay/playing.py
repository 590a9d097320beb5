"""Let the hosts of a recording send their frames to a simulated bus, at their recorded instants.

On the board's clock the instant at which a frame became valid is exact, so its beginning on the wire is, too: a length
of the frame earlier. The frame takes part in the arbitration at that instant, as it did. A frame that began right after
another one had waited for it, and waits again.

By a computer's clock, time stamps tell when a program saw the frames. A host's frame is sent at its stamp, but a
request not before the answers that its host had seen have come.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Final

from steptwin.emulator.can_timing import VALID_BEFORE_END_BITS, frame_bits
from steptwin.emulator.simulation import Simulation
from steptwin.host.record.recorded_bus import RecordedFrame, Sender
from steptwin.protocol.frame import COB_SDO_REQUEST, COB_SDO_RESPONSE, NODE_ID_MAX, Frame
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND, COUNTS_PER_US

LEAD_COUNTS: Final = 10 * COUNTS_PER_MS
"""Time from power-up to the first frame of a recording that does not tell it: the boards have sent their boot-ups."""
_ANSWER_COUNTS: Final = 100 * COUNTS_PER_MS
"""Longest time for which a request waits for the answers before it; the board takes less than 2 ms."""
_REST_COUNTS: Final = COUNTS_PER_SECOND // 10
"""Time after the last frame, and after the last motion, until which answers come."""
_MOTION_S_MAX: Final = 3600
"""Longest time for which a motion is followed that goes on after the recording."""


class Player:
    """Sends the hosts' frames of a recording, in their order; the frames go to the hosts' one interface."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def play_exactly(self, frames: Sequence[RecordedFrame], senders: Sequence[Sender], until_counts: int) -> None:
        """Play a recording on the board's clock, and go on to an instant."""
        for recorded, sender in zip(frames, senders, strict=True):
            if sender is not Sender.BOARD:  # other nodes take their time of the bus, too
                self._send_as_recorded(recorded.us * COUNTS_PER_US, recorded.frame)
        self._simulation.run_until(until_counts)

    def _send_as_recorded(self, valid_counts: int, frame: Frame) -> None:
        """Send a frame so that it becomes valid at an instant."""
        begin_counts = valid_counts - self._length_counts(frame)
        self._go_on(lambda: self._simulation.bus.free_counts >= begin_counts, begin_counts)
        self._simulation.host.send(frame, self._simulation.now_counts)

    def _length_counts(self, frame: Frame) -> int:
        """Return the time from the beginning of a frame until it is valid."""
        return (frame_bits(frame) - VALID_BEFORE_END_BITS) * self._simulation.bus.bit_counts

    def _go_on(self, until: Callable[[], bool], until_counts: int) -> None:
        """Let time pass event by event until something is so, or up to an instant."""
        simulation = self._simulation
        while not until() and simulation.now_counts < until_counts:
            event_counts = max(simulation.next_event_counts(until_counts), simulation.now_counts + COUNTS_PER_US)
            simulation.run_until(min(event_counts, until_counts))

    def play_by_wall_clock(self, frames: Sequence[RecordedFrame], senders: Sequence[Sender]) -> None:
        """Play a recording by a computer's clock, and go on until the machine rests.

        A request that waits for an answer delays what follows, unless the machine moves, which nothing delays.
        """
        answered: Counter[int] = Counter()
        seen: Counter[int] = Counter()
        simulation = self._simulation

        def count(frame: Frame, _: int) -> None:
            answered[frame.cob_id] += 1

        simulation.bus.also_log(count)
        first_counts = LEAD_COUNTS - frames[0].us * COUNTS_PER_US
        for (us, frame, _), sender in zip(frames, senders, strict=True):
            if sender is Sender.BOARD:
                seen[frame.cob_id] += 1
            elif sender is Sender.HOST:
                due_counts = first_counts + us * COUNTS_PER_US - self._length_counts(frame)
                simulation.run_until(due_counts)
                if frame.cob_id & ~NODE_ID_MAX == COB_SDO_REQUEST:
                    cob_id = COB_SDO_RESPONSE + (frame.cob_id & NODE_ID_MAX)
                    self._await(answered, seen, cob_id)
                    if not self._moving:
                        first_counts += max(simulation.now_counts - due_counts, 0)
                simulation.host.send(frame, simulation.now_counts)
        simulation.run_until(first_counts + frames[-1].us * COUNTS_PER_US)
        self._come_to_rest()

    def _await(self, answered: Counter[int], seen: Counter[int], cob_id: int) -> None:
        give_up_counts = self._simulation.now_counts + _ANSWER_COUNTS
        self._go_on(lambda: answered[cob_id] >= seen[cob_id], give_up_counts)

    def _come_to_rest(self) -> None:
        simulation = self._simulation
        give_up_counts = simulation.now_counts + _MOTION_S_MAX * COUNTS_PER_SECOND
        simulation.run_until(simulation.now_counts + _REST_COUNTS)
        while self._moving and simulation.now_counts < give_up_counts:
            simulation.run_until(simulation.now_counts + _REST_COUNTS)

    @property
    def _moving(self) -> bool:
        return any(board.moving for board in self._simulation.boards)
