"""Set the TB6560's static inputs by the driver objects (2000h): excitation mode, torque, decay, rest torque."""

from collections.abc import Callable
from typing import Final

from steptwin.controller.node.pins import DECAY_LEVELS, MODE_LEVELS, TORQUE_LEVELS, Pin
from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary

IDLE_AFTER_US: Final = 500_000
"""Time that an axis must stand before its torque is lowered to the rest torque (2000h:04)."""


class DriverSettings:
    """Sets the driver's torque and decay pins, and its excitation mode when the step configuration changes."""

    def __init__(self, dictionary: ObjectDictionary, set_pin: Callable[[Pin, int], None]) -> None:
        self._dictionary = dictionary
        self._set_pin = set_pin
        self._idle = False
        self.due_us: int | None = None
        """Time when a standing axis' torque is lowered; None if that has happened or does not apply."""

    def set_microsteps(self, microsteps: int) -> None:
        """Select the excitation mode. The chip takes a new one only in reset (page 15), which also resets its angle."""
        self._set_pin(Pin.RESET, 0)
        self._set(Pin.M2, Pin.M1, MODE_LEVELS[microsteps])
        self._set_pin(Pin.RESET, 1)

    def settle(self, now_us: int, *, moving: bool) -> None:
        """Set torque and decay at the end of a call; full torque while moving, rest torque after IDLE_AFTER_US."""
        get = self._dictionary.get
        if moving:
            self._idle, self.due_us = False, None
        elif not self._idle and self.due_us is None and get(od.REST_TORQUE_PERCENT) != get(od.TORQUE_PERCENT):
            self.due_us = now_us + IDLE_AFTER_US
        self._set(Pin.TQ2, Pin.TQ1, TORQUE_LEVELS[get(od.REST_TORQUE_PERCENT if self._idle else od.TORQUE_PERCENT)])
        self._set(Pin.DCY2, Pin.DCY1, DECAY_LEVELS[get(od.FAST_DECAY_PERCENT)])

    def poll(self, now_us: int) -> None:
        """Choose the rest torque if it is due; `settle` then sets the pins."""
        if self.due_us is not None and self.due_us <= now_us:
            self._idle, self.due_us = True, None

    def _set(self, high: Pin, low: Pin, levels: tuple[int, int]) -> None:
        self._set_pin(high, levels[0])
        self._set_pin(low, levels[1])
