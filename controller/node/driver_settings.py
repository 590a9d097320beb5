"""Apply the driver settings of the object dictionary to the TB6560's static inputs and the motion.

The driver objects (2000h) set excitation mode, torque, decay and standstill torque. Microsteps, step timing (2001h),
speed limit and polarity are the step configuration.
"""

from dataclasses import replace
from typing import Final

from steptwin.controller.modes.interpolation import Interpolation
from steptwin.controller.motion.step_config import INVERT_DIR, REVERSED, StepConfig
from steptwin.controller.node.axis_context import AxisContext
from steptwin.controller.node.pins import DECAY_LEVELS, MODE_LEVELS, TORQUE_LEVELS, Pin
from steptwin.protocol import od
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_STEP_ENTRIES: Final = (
    od.STEPLEN_NS,
    od.STEPSPACE_NS,
    od.DIRSETUP_NS,
    od.DIRHOLD_NS,
    od.MAX_PROFILE_VELOCITY,
    od.POLARITY,
    od.INVERT_MASK,
)
"""Entries of the step configuration, in the order of `StepConfig`'s fields after the microsteps."""
IDLE_AFTER_US: Final = 500_000
"""Time at standstill after which the torque is lowered to the standstill torque (2000h:04)."""
_BYTE_MAX: Final = 255
_CHOICES: Final = {
    od.MICROSTEPS: od.MICROSTEPS_CHOICES,
    od.MICROSTEPS_WORD: od.MICROSTEPS_CHOICES,
    od.INVERT_MASK: (0, INVERT_DIR),
    od.POLARITY: (0, REVERSED),  # position and velocity can only be reversed together
}
"""Values allowed while the driver is off. While it is on, every change is refused because of the drive's state."""


class DriverSettings:
    """Sets the driver's pins and the step configuration of one axis."""

    def __init__(self, context: AxisContext, records: Interpolation) -> None:
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._pins = context.pins
        self._reference = context.reference
        self._records = records
        self._idle = False
        self.due_us: int | None = None
        """Instant when the torque is lowered at standstill; None if it is lowered already, or in motion."""
        context.dictionary.bind(self)

    def change_at(self, address: int, value: int) -> None:
        """Change the step configuration while the driver is off: a TB6560 changes its mode only in reset (page 15).

        Drop the queued records, because they were accepted with the old limits. Only the speed limit (607Fh) may change
        while the driver is on: it acts from the next set-point on; for a stream of records or set-points, after its
        end. A PDO may repeat the same limit: that drops nothing.
        """
        if address == od.MAX_PROFILE_VELOCITY and value == self._dictionary.get(address):
            return
        energised = bool(self._pins.level(Pin.ENABLE))
        if energised and address == od.MAX_PROFILE_VELOCITY:
            config = replace(self._motion.config, velocity_max_units_per_s=value)
            self._motion.change_speed_limit(config)
            return
        if energised:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if value not in _CHOICES.get(address, (value,)):
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        self._records.discard()
        if address == od.MICROSTEPS:
            self._dictionary.set(od.MICROSTEPS_WORD, value)
        elif address == od.MICROSTEPS_WORD:
            self._dictionary.set(od.MICROSTEPS, min(value, _BYTE_MAX))
        self.apply({address: value})

    @property
    def microsteps(self) -> int:
        """Microsteps per full step of the step configuration."""
        return self._motion.config.microsteps

    def apply(self, changes: dict[int, int] | None = None) -> None:
        """Configure motion and driver from the dictionary and `changes`, values that are not stored yet."""
        changes, get = changes or {}, self._dictionary.get
        word = changes.get(od.MICROSTEPS_WORD, self._dictionary.cell(od.MICROSTEPS_WORD).value)
        microsteps = word if word > _BYTE_MAX else changes.get(od.MICROSTEPS, get(od.MICROSTEPS))
        config = StepConfig(microsteps, *(changes.get(address, get(address)) for address in _STEP_ENTRIES))
        if config.microsteps != self._motion.config.microsteps:
            self._select_microsteps(config.microsteps)
        self._motion.configure(config)

    def _select_microsteps(self, microsteps: int) -> None:
        """Select an excitation mode by a reset, which turns the rotor to the mode's initial angle without counting.

        Some microsteps are no modes of a TB6560; they belong to drivers with switches of their own.
        """
        self._pins.set(Pin.RESET, 0)
        self._set(Pin.M2, Pin.M1, MODE_LEVELS.get(microsteps, (0, 0)))
        self._pins.set(Pin.RESET, 1)
        self._reference.lose()

    def settle(self, now_us: int, *, moving: bool) -> None:
        """Set torque and decay at the end of a call: full torque in motion, standstill torque after IDLE_AFTER_US."""
        get = self._dictionary.get
        if moving:
            self._idle, self.due_us = False, None
        elif not self._idle and self.due_us is None and get(od.REST_TORQUE_PERCENT) != get(od.TORQUE_PERCENT):
            self.due_us = now_us + IDLE_AFTER_US
        self._set(Pin.TQ2, Pin.TQ1, TORQUE_LEVELS[get(od.REST_TORQUE_PERCENT if self._idle else od.TORQUE_PERCENT)])
        self._set(Pin.DCY2, Pin.DCY1, DECAY_LEVELS[get(od.FAST_DECAY_PERCENT)])

    def poll(self, now_us: int) -> None:
        """Select the standstill torque if it is due; `settle` then sets the pins."""
        if self.due_us is not None and self.due_us <= now_us:
            self._idle, self.due_us = True, None

    def _set(self, high: Pin, low: Pin, levels: tuple[int, int]) -> None:
        self._pins.set(high, levels[0])
        self._pins.set(low, levels[1])
