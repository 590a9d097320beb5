"""Pass the step configuration of one axis from its object dictionary to the motion and the driver."""

from dataclasses import replace

from steptwin.controller.motion.step_config import INVERT_DIR, REVERSED, StepConfig
from steptwin.controller.node.axis_context import AxisContext
from steptwin.controller.node.axis_drive import AxisDrive
from steptwin.controller.node.pins import MODE_LEVELS
from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.objects import STEP_ENTRIES

_CHOICES = {
    od.MICROSTEPS: tuple(MODE_LEVELS),
    od.INVERT_MASK: (0, INVERT_DIR),
    od.POLARITY: (0, REVERSED),  # position and velocity can only be reversed together
}
"""The values allowed, for the entries whose range the object table does not give."""


class StepSettings:
    """Passes the step configuration from the dictionary to the motion and to the driver's excitation mode."""

    def __init__(self, context: AxisContext, drive: AxisDrive) -> None:
        self._context = context
        self._drive = drive
        context.dictionary.bind(self)

    def change_at(self, address: int, value: int) -> None:
        """Reconfigure the steps while the driver is off: a TB6560 changes its mode only in reset (page 15).

        Drop the records that wait: they were accepted within the old limits. The speed limit (607Fh) may change while
        the driver is on: from the next set-point on, and for a stream of records or set-points when it has ended.
        """
        if self._drive.energised and address == od.MAX_PROFILE_VELOCITY:
            axis, motion = self._context.axis, self._context.motion
            motion.change_speed_limit(axis, replace(motion.config(axis), velocity_max_units_per_s=value))
            return
        if self._drive.energised:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        if value not in _CHOICES.get(address, (value,)):
            raise SdoAbortError(AbortCode.VALUE_RANGE)
        self._drive.interpolation.discard()
        self.apply({address: value})

    def apply(self, changes: dict[int, int] | None = None) -> None:
        """Configure the motion and the driver as the dictionary says; `changes` holds values that are being written."""
        changes = changes or {}
        axis, motion, get = self._context.axis, self._context.motion, self._context.dictionary.get
        config = StepConfig(*(changes.get(address, get(address)) for address in STEP_ENTRIES))
        if config.microsteps != motion.config(axis).microsteps:
            self._drive.select_microsteps(config.microsteps)
        motion.configure(axis, config)
