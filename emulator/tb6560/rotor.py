"""Follow the field by an ideal rotor: its position in sixteenths of a full step, whatever modes the chip has had.

A counted step turns the field by the step of the mode at that instant. A change of mode outside reset leads the field
to the new mode's own angle that is equal or next below, and the rotor with it. In reset the field goes to the initial
angle, but this rotor stays. A real one turns by up to two full steps to the nearest place with that electrical angle,
uncounted: so the firmware does not know the position after a change of mode.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from steptwin.emulator.edges import Int8Array, Int64Array
from steptwin.emulator.tb6560.excitation import CYCLE_SIXTEENTHS, Excitation


class ModeChange(NamedTuple):
    """From an instant on, the pins select this mode; `live` is False while the chip is in reset or without VDD."""

    counts: int
    excitation: Excitation
    live: int


class Rotor:
    """The position of one motor's rotor since power-up, which grows with steps at which DIR is high."""

    def __init__(self) -> None:
        self.position_sixteenths = 0
        """Position in sixteenths of a full step."""
        self.excitation = Excitation.TWO_PHASE
        self._zero_sixteenths = self.excitation.initial_sixteenths
        """Angle of the field at the position 0; the angle grows with steps at which DIR is low."""

    def follow(
        self, counts: Int64Array, signs: Int8Array, changes: Sequence[ModeChange]
    ) -> tuple[Int64Array, Int8Array]:
        """Follow counted steps and changes of mode, both in order of time.

        Returns:
            Instant of each move, and the move in sixteenths of a full step, 1 to 16 with its sign.
        """
        if not changes:
            return counts, self._step(signs)
        instants, moves, first = [], [], 0
        for change in changes:
            last = int(np.searchsorted(counts, change.counts))
            instants += [counts[first:last], np.array([change.counts], dtype=np.int64)]
            moves += [self._step(signs[first:last]), np.array([self._change(change)], dtype=np.int8)]
            first = last
        instant, move = np.concatenate([*instants, counts[first:]]), np.concatenate([*moves, self._step(signs[first:])])
        return instant[move != 0], move[move != 0]

    def _step(self, signs: Int8Array) -> Int8Array:
        moves = signs * np.int8(self.excitation.step_sixteenths)
        self.position_sixteenths += int(moves.sum(dtype=np.int64))
        return moves

    def _change(self, change: ModeChange) -> int:
        """Take the mode; return the move that it causes."""
        self.excitation = change.excitation
        if not change.live:
            self._zero_sixteenths = change.excitation.initial_sixteenths + self.position_sixteenths
            return 0
        angle = (self._zero_sixteenths - self.position_sixteenths) % CYCLE_SIXTEENTHS
        move = (angle - change.excitation.nearest_state(angle)) % CYCLE_SIXTEENTHS
        self.position_sixteenths += move
        return move
