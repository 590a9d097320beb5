"""Supervise one axis while its driver is on: switches, voltage, temperature, following error.

Some causes are levels: e-stop, Protect pin or fault output of the driver, voltage, temperature. They trip the drive
when they appear or when the driver is switched on; while they last, no fault can be reset. A limit switch trips the
drive only while the axis moves towards it; the axis may move away from it. The following error trips the drive after
its time-out (6066h).
"""

from collections.abc import Iterator
from typing import Final

from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode
from steptwin.protocol.od import WINDOW_OFF

LIMIT_PERIOD_US: Final = 1_000
FOLLOWING_PERIOD_US: Final = 10_000

_LIMITS: Final = DigitalInput.NEGATIVE_LIMIT | DigitalInput.POSITIVE_LIMIT
DRIVER: Final = 1
"""Detail of the error TEMPERATURE for the driver chip; 0 is the board."""


class Supervision:
    """Supervises one axis and trips its drive."""

    def __init__(self, context: AxisContext) -> None:
        self._motion = context.motion
        self._dictionary = context.dictionary
        self._measurements = context.board.measurements
        self._trip = context.trip
        self._reference = context.reference
        self._off_window_us: int | None = None
        """Instant when the following error left its window; None while it is within."""
        self._watches_limits = self._watches_following = False
        self.inputs: DigitalInput = DigitalInput(0)
        """Present input levels of the axis."""
        self.torque_off = False
        """True while safe torque off (STO) is requested."""
        self.due_us: int | None = None
        """Time of the next call of `poll`; None if there is nothing to supervise."""
        context.dictionary.bind(self)

    # --- causes that are levels

    def causes(self) -> Iterator[tuple[ErrorCode, int]]:
        """Yield each present error that keeps the driver off, with its detail."""
        if self.inputs & DigitalInput.ESTOP:
            yield ErrorCode.ESTOP, 0
        if self.inputs & DigitalInput.DRIVER_PROTECT:
            yield ErrorCode.TEMPERATURE, DRIVER
        if self.inputs & DigitalInput.DRIVER_FAULT:
            yield ErrorCode.OUTPUT_STAGE, 0
        supply, get = self._measurements.supply_10mv, self._dictionary.get
        if not self.supplied:
            yield ErrorCode.UNDERVOLTAGE, supply
        if supply > get(od.SUPPLY_VOLTAGE_MAX):
            yield ErrorCode.OVERVOLTAGE, supply
        if self._measurements.temperature_decidegc > get(od.BOARD_TEMPERATURE_MAX):
            yield ErrorCode.TEMPERATURE, 0

    @property
    def supplied(self) -> bool:
        """True while the motor supply is at least the lowest voltage allowed (2002h:03)."""
        return self._measurements.supply_10mv >= self._dictionary.get(od.SUPPLY_VOLTAGE_MIN)

    def check(self) -> None:
        """Trip the drive for every cause that is present."""
        for code, detail in self.causes():
            self._trip(code, detail)

    # --- causes that come with motion

    def watch(self, now_us: int, *, switches: bool) -> None:
        """Schedule the next check at the end of a call; `switches`: True if limit switches are faults."""
        moving = self._motion.running
        self._watches_limits = moving and switches and bool(self.inputs & _LIMITS)
        self._watches_following = moving and self._dictionary.get(od.FOLLOWING_ERROR_WINDOW) != WINDOW_OFF
        if not self._watches_following:
            self._off_window_us = None
        period_us = LIMIT_PERIOD_US if self._watches_limits else FOLLOWING_PERIOD_US
        if not (self._watches_limits or self._watches_following):
            self.due_us = None
        elif self.due_us is None or self.due_us > now_us + period_us:
            self.due_us = now_us + period_us

    def poll(self, now_us: int) -> None:
        """Make the checks that are due: limit switches, following error, or both."""
        if self.due_us is None or now_us < self.due_us:
            return
        self.due_us = None
        if self._watches_limits:
            self.check_limits()
        if self._watches_following:
            self._check_following(now_us)

    def check_limits(self) -> None:
        """Trip if the axis moves towards an active limit switch."""
        velocity = self._motion.velocity
        ahead = DigitalInput.POSITIVE_LIMIT if velocity > 0 else DigitalInput.NEGATIVE_LIMIT
        if velocity and self.inputs & ahead:
            self._trip(ErrorCode.LIMIT_SWITCH, int(velocity > 0))

    def _check_following(self, now_us: int) -> None:
        if not self.following_error:
            self._off_window_us = None
            return
        self._off_window_us = now_us if self._off_window_us is None else self._off_window_us
        if now_us - self._off_window_us >= 1000 * self._dictionary.get(od.FOLLOWING_ERROR_TIMEOUT_MS):
            self._trip(ErrorCode.FOLLOWING_ERROR)

    @property
    def following_error(self) -> bool:
        """True while the following error is out of its window (6065h)."""
        window = self._dictionary.get(od.FOLLOWING_ERROR_WINDOW)
        return window != WINDOW_OFF and abs(self._reference.following_error_units) > window
