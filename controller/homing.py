"""Homing mode (CiA 402, section "homing mode"): method 37, the present position is the home position."""

from collections.abc import Callable

from controller.motion import Motion
from protocol.cia402 import Control, Status
from protocol.dictionary import ObjectDictionary


class Homing:
    """Presets the axis to the home offset 0x607C when bit 4 of the controlword rises.

    The offset is in units, finer than a step: the demand may lie between two steps, the counter is the nearest.
    """

    def __init__(
        self, axis: int, motion: Motion, dictionary: ObjectDictionary, discard_records: Callable[[], None]
    ) -> None:
        self._axis = axis
        self._motion = motion
        self._dictionary = dictionary
        self._discard_records = discard_records
        self._attained = False

    def control(self, controlword: int, previous: int) -> None:
        """Home on the rising edge of the start bit; a moving axis has no present position to call home."""
        if controlword & ~previous & Control.START and not self._motion.running(self._axis):
            self._discard_records()
            self._motion.preset(self._axis, self._dictionary.get(0x607C))
            self._attained = True

    def finished(self) -> None:
        """Method 37 makes no motion."""

    def interrupted(self) -> None:
        """There is no motion to interrupt."""

    def target_reached(self) -> bool:
        """Standstill."""
        return not self._motion.running(self._axis)

    def status_bits(self) -> int:
        """Bit 12, homing attained, since power-up."""
        return Status.HOMING_ATTAINED if self._attained else 0
