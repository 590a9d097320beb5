"""Homing mode (CiA 402, section "homing mode"): method 37, the present position is the home position."""

from collections.abc import Callable

from controller.modes import Mode
from controller.motion import Motion
from protocol.cia402 import Control, Status
from protocol.dictionary import ObjectDictionary


class Homing(Mode):
    """Presets the axis to the home offset 0x607C when bit 4 of the controlword rises.

    The offset is in units, finer than a step: the demand may lie between two steps, the counter is the nearest.
    """

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        discard_records: Callable[[], None],
        referenced: Callable[[], None],
    ) -> None:
        super().__init__(axis, motion)
        self._dictionary = dictionary
        self._discard_records = discard_records
        self._referenced = referenced
        self._attained = False

    def control(self, controlword: int, previous: int) -> None:
        """Home on the rising edge of the start bit; a moving axis has no present position to call home."""
        if controlword & ~previous & Control.START and not self._motion.running(self._axis):
            self._discard_records()
            self._motion.preset(self._axis, self._dictionary.get(0x607C))
            self._attained = True
            self._referenced()

    def status_bits(self) -> int:
        """Bit 12, homing attained, since power-up."""
        return Status.HOMING_ATTAINED if self._attained else 0
