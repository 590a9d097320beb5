"""Calculate a time without steps from the stamps of frames; their clock may be set, restarted, or stop.

No clock is read here. The stamps are compared with the frames' arrivals, by a clock that is never set, if the caller
knows them. A frame may arrive late, but not before its stamp. So a stamp that is ahead of all others by that clock
reveals a step.
"""

from typing import Final

BACK_US: Final = 20_000
"""Largest step back of a stamp that is not a step: several programs on a bus may stamp frames late."""
SILENCE_US: Final = 1_000_000
"""Longest silence of a machine at rest, if only stamps are known."""
MOVING_SILENCE_US: Final = 250_000
"""Longest silence of a moving machine: its board sends a PDO each 100 ms."""
AHEAD_US: Final = 20_000
"""Largest lead of a stamp over the others by the caller's clock."""
PACED_US: Final = 500_000
"""Time for which frames must arrive as stamped before the caller's clock is used."""
FOLLOWS_US: Final = 10_000
"""Assumed time between two frames if no clock is known."""
DRIFT: Final = 500e-6
"""Largest relative drift of two clocks: a clock that is being corrected."""


class StampClock:
    """Time of the frames.

    Attributes:
        shift_us: difference of the time to a stamp; None until the next frame determines it.
        now_us: time up to which everything is known.
        step_us: step of the last stamp; 0 if it has not stepped.
    """

    def __init__(self) -> None:
        self.shift_us: int | None = 0
        self.now_us: int = 0
        self.step_us: int = 0
        self._last_us: int | None = None
        """The last stamp."""
        self._arrived_us: int | None = None
        """Arrival of that frame."""
        self._highest_us = 0.0
        """Largest lead of a stamp: stamp minus arrival."""
        self._paced_since_us, self._paced_us = 0, 0.0
        """Time since when frames have arrived as stamped, and the lead of the first of them."""

    def begin(self, us: int, arrived_us: int | None) -> None:
        """Start with a stamp, and the arrival of its frame."""
        self.now_us, self.shift_us = us, 0
        self._note(us, arrived_us, None)

    def end_recording(self, now_us: int) -> None:
        """End a recording at a time: stamps of the next frame may be of another clock."""
        self.now_us, self._last_us, self.shift_us = now_us, None, None

    def pass_time(self, us: int) -> int | None:
        """Return the time of an instant by the stamps' clock; None if it is unknown."""
        if self.shift_us is None:
            return None
        self.now_us = max(self.now_us, us + self.shift_us)
        return us + self.shift_us

    def hear(self, us: int, arrived_us: int | None, *, moving: bool) -> int:
        """Return the time of the next frame; register a step of its stamp.

        Args:
            us: its stamp, in microseconds.
            arrived_us: its arrival by a clock that is never set; None if unknown.
            moving: True if the machine moves.
        """
        passed_us = None if arrived_us is None or self._arrived_us is None else arrived_us - self._arrived_us
        self.step_us = 0
        if self.shift_us is None:
            self.shift_us = self.now_us + FOLLOWS_US - us
        elif self._last_us is not None:
            self.step_us = self._step_us(us, self._last_us, passed_us, moving=moving)
            if self.step_us:
                self.shift_us -= self.step_us
        now_us = us + self.shift_us
        self.now_us = now_us if self._last_us is None else max(self.now_us, now_us)
        self._note(us, arrived_us, passed_us)
        return now_us

    def _step_us(self, us: int, last_us: int, passed_us: int | None, *, moving: bool) -> int:
        """Return the step of a stamp against the time since the last frame; 0 for no step."""
        assert self.shift_us is not None
        rise_us, known_us = us - last_us, self.now_us - self.shift_us
        back = rise_us < -BACK_US or us < known_us - SILENCE_US
        if not back and not self._ahead(us, known_us, passed_us, moving=moving):
            return 0
        due_us = known_us + FOLLOWS_US if passed_us is None else max(last_us + passed_us, known_us)
        return us - due_us

    def _ahead(self, us: int, known_us: int, passed_us: int | None, *, moving: bool) -> bool:
        """Return whether a stamp is in the future."""
        silence_us = MOVING_SILENCE_US if moving else SILENCE_US
        if passed_us is None or self._arrived_us is None or self._last_us is None:
            return us - known_us > silence_us
        rise_us, arrived_us = us - self._last_us, self._arrived_us + passed_us
        ahead_us = us - arrived_us - self._highest_us - DRIFT * passed_us
        limit_us = AHEAD_US if arrived_us - self._paced_since_us >= PACED_US else silence_us
        return min(rise_us - passed_us, ahead_us) > limit_us

    def _note(self, us: int, arrived_us: int | None, passed_us: int | None) -> None:
        """Register the relation of stamps and arrivals."""
        self._last_us = us
        if arrived_us is None:
            return
        ahead_us = float(us - arrived_us)
        self._highest_us += self.step_us
        self._paced_us += self.step_us
        if passed_us is None:
            self._highest_us = ahead_us
        paced_until_us = self._paced_us + AHEAD_US + DRIFT * (arrived_us - self._paced_since_us)
        if passed_us is None or ahead_us > paced_until_us:
            self._paced_since_us, self._paced_us = arrived_us, ahead_us
        self._highest_us = max(self._highest_us - DRIFT * (passed_us or 0), ahead_us)
        self._arrived_us = arrived_us
