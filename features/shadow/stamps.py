"""Make a time that never steps of the stamps of frames, whose clock may be set, restarted, or stand.

No clock is read here. What the stamps say is held against the times when the frames came, by a clock that is never
set, where the caller knows them. A frame may come late, but not before it was stamped: a stamp that is ahead of all
others by that clock tells of a step.
"""

from typing import Final

BACK_US: Final = 20_000
"""Time by which a stamp may be before the last one: several programs on a bus may stamp frames late."""
SILENCE_US: Final = 1_000_000
"""Silence of a machine at rest that the stamps alone tell."""
MOVING_SILENCE_US: Final = 250_000
"""Silence of a machine that moves: its board sends a PDO each 100 ms."""
AHEAD_US: Final = 20_000
"""Time by which a stamp may be ahead of the others by the caller's clock."""
PACED_US: Final = 500_000
"""Time for which frames have to come as they are stamped before the caller's clock is relied on."""
FOLLOWS_US: Final = 10_000
"""Time from a frame to the next one where no clock tells it."""
DRIFT: Final = 500e-6
"""Most by which two clocks drift apart, in parts of the time: a clock that is being corrected."""


class StampClock:
    """The time of the frames.

    Attributes:
        shift_us: added to a stamp, it gives the time; None until the next frame tells it.
        now_us: the time up to which all is known.
        step_us: by how much the last stamp has stepped, 0 if it has not.
    """

    def __init__(self) -> None:
        self.shift_us: int | None = 0
        self.now_us: int = 0
        self.step_us: int = 0
        self._last_us: int | None = None
        """The last stamp."""
        self._arrived_us: int | None = None
        """When that frame came."""
        self._highest_us = 0.0
        """The stamp that was farthest ahead of its coming, less the time when it came."""
        self._paced_since_us, self._paced_us = 0, 0.0
        """Since when frames have come as they are stamped, and how far ahead the first of them was."""

    def begin(self, us: int, arrived_us: int | None) -> None:
        """Begin with a stamp, and when its frame came."""
        self.now_us, self.shift_us = us, 0
        self._note(us, arrived_us, None)

    def end_recording(self, now_us: int) -> None:
        """Let the next frame follow a recording that has ended at a time: its stamps may be of another clock."""
        self.now_us, self._last_us, self.shift_us = now_us, None, None

    def pass_time(self, us: int) -> int | None:
        """Return the time of an instant by the stamps' clock; None if that is not known yet."""
        if self.shift_us is None:
            return None
        self.now_us = max(self.now_us, us + self.shift_us)
        return us + self.shift_us

    def hear(self, us: int, arrived_us: int | None, *, moving: bool) -> int:
        """Return the time of the next frame; note if its stamp has stepped.

        Args:
            us: its stamp, in microseconds.
            arrived_us: when it came, by a clock that is never set; None if that is not known.
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
        """Return by how much a stamp is beside the one that the time since the last frame would give; 0 for no step."""
        assert self.shift_us is not None
        rise_us, known_us = us - last_us, self.now_us - self.shift_us
        back = rise_us < -BACK_US or us < known_us - SILENCE_US
        if not back and not self._ahead(us, known_us, passed_us, moving=moving):
            return 0
        due_us = known_us + FOLLOWS_US if passed_us is None else max(last_us + passed_us, known_us)
        return us - due_us

    def _ahead(self, us: int, known_us: int, passed_us: int | None, *, moving: bool) -> bool:
        """Return whether a stamp is of a time that has not come yet."""
        silence_us = MOVING_SILENCE_US if moving else SILENCE_US
        if passed_us is None or self._arrived_us is None or self._last_us is None:
            return us - known_us > silence_us
        rise_us, arrived_us = us - self._last_us, self._arrived_us + passed_us
        ahead_us = us - arrived_us - self._highest_us - DRIFT * passed_us
        limit_us = AHEAD_US if arrived_us - self._paced_since_us >= PACED_US else silence_us
        return min(rise_us - passed_us, ahead_us) > limit_us

    def _note(self, us: int, arrived_us: int | None, passed_us: int | None) -> None:
        """Note how stamps and arrivals are to each other."""
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
