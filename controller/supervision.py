"""What one axis watches while its driver is on: switches, voltage, temperature, following error.

Causes that are a level (e-stop, the driver's Protect pin, voltage, temperature) trip the drive when they appear or when
the driver is switched on, and no fault can be reset while they last. A limit switch trips it only while the axis moves
towards it, so that it can be moved away; the following error once it has lasted for 0x6066.
"""

from collections.abc import Iterator

from steptwin.controller.measurements import Measurements, Monitor
from steptwin.controller.modes import Trip
from steptwin.controller.motion import Motion
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.objects import UNITS_PER_FULL_STEP, WINDOW_OFF

LIMIT_PERIOD_US = 1_000
FOLLOWING_PERIOD_US = 10_000

_LIMITS = DigitalInput.NEGATIVE_LIMIT | DigitalInput.POSITIVE_LIMIT
DRIVER = 1
"""The detail of an excess temperature that is the driver chip's, not the board's."""


class Supervision:
    """Watches one axis and trips its drive."""

    def __init__(
        self,
        axis: int,
        motion: Motion,
        dictionary: ObjectDictionary,
        measurements: Measurements,
        monitor: Monitor,
        trip: Trip,
    ) -> None:
        self._axis = axis
        self._motion = motion
        self._dictionary = dictionary
        self._measurements = measurements
        self._monitor = monitor
        self._trip = trip
        self._lost_at_reference_steps = 0
        self._off_window_us: int | None = None
        """Since when the following error has been out of its window."""
        self._watches_limits = self._watches_following = False
        self.inputs = DigitalInput(0)
        self.due_us: int | None = None
        """When `poll` wants to be called next."""

    # --- causes that are levels

    def causes(self) -> Iterator[tuple[ErrorCode, int]]:
        """What forbids, just now, that the driver is on, with its detail."""
        if self.inputs & DigitalInput.ESTOP:
            yield ErrorCode.ESTOP, 0
        if self.inputs & DigitalInput.DRIVER_PROTECT:
            yield ErrorCode.TEMPERATURE, DRIVER
        supply, get = self._measurements.supply_10mv, self._dictionary.get
        if supply < get(od.SUPPLY_VOLTAGE_MIN):
            yield ErrorCode.UNDERVOLTAGE, supply
        if supply > get(od.SUPPLY_VOLTAGE_MAX):
            yield ErrorCode.OVERVOLTAGE, supply
        if self._measurements.temperature_decidegc > get(od.BOARD_TEMPERATURE_MAX):
            yield ErrorCode.TEMPERATURE, 0

    def check(self) -> None:
        """Trip for whatever forbids that the driver is on."""
        for code, detail in self.causes():
            self._trip(self._axis, code, detail)

    # --- causes that come with motion

    def watch(self, now_us: int, *, switches: bool) -> None:
        """After anything that happened: note what there is to watch from now on, `switches` being among it or not."""
        moving = self._motion.running(self._axis)
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
        """Look at what is watched, if it is time."""
        if self.due_us is None or now_us < self.due_us:
            return
        self.due_us = None
        if self._watches_limits:
            self.check_limits()
        if self._watches_following:
            self._check_following(now_us)

    def check_limits(self) -> None:
        """Trip if the axis is moving towards a limit switch that is active."""
        velocity = self._motion.velocity(self._axis)
        ahead = DigitalInput.POSITIVE_LIMIT if velocity > 0 else DigitalInput.NEGATIVE_LIMIT
        if velocity and self.inputs & ahead:
            self._trip(self._axis, ErrorCode.LIMIT_SWITCH, int(velocity > 0))

    def _check_following(self, now_us: int) -> None:
        if not self.following_error:
            self._off_window_us = None
            return
        self._off_window_us = now_us if self._off_window_us is None else self._off_window_us
        if now_us - self._off_window_us >= 1000 * self._dictionary.get(od.FOLLOWING_ERROR_TIMEOUT_MS):
            self._trip(self._axis, ErrorCode.FOLLOWING_ERROR)

    # --- following error

    def referenced(self) -> None:
        """The axis has just been told where it is: from now on the rotor is where the counter is."""
        self._lost_at_reference_steps = self._monitor(self._axis).lost_steps

    @property
    def lost_units(self) -> int:
        """How far the rotor is behind the step counter since the axis was last told where it is."""
        lost_steps = self._monitor(self._axis).lost_steps - self._lost_at_reference_steps
        return lost_steps * UNITS_PER_FULL_STEP // self._motion.config(self._axis).microsteps

    @property
    def following_error_units(self) -> int:
        """Demand less what the driver has counted."""
        return self._motion.demand_units(self._axis) - self._motion.counter_units(self._axis) + self.lost_units

    @property
    def following_error(self) -> bool:
        """Whether that is out of the window 0x6065."""
        window = self._dictionary.get(od.FOLLOWING_ERROR_WINDOW)
        return window != WINDOW_OFF and abs(self.following_error_units) > window
