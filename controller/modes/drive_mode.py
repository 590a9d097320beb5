"""The interface of a mode of operation."""

from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol.cia402 import DigitalInput


class DriveMode:
    """One mode of operation of one axis, which acts only in OPERATION ENABLED.

    This base class does nothing. It is the mode after power-up, before the host selects one.
    """

    def __init__(self, context: AxisContext) -> None:
        self._context = context
        self._motion = context.motion
        self._dictionary = context.dictionary

    @property
    def coordinated(self) -> bool:
        """True while the axis moves together with others, which must stop with it."""
        return False

    @property
    def seeks_switches(self) -> bool:
        """True while the mode reacts to limit switches itself, so they are not faults."""
        return False

    @property
    def switches_at(self) -> int:
        """Axis whose inputs have the mode's switches; by default, this axis."""
        return self._context.axis

    @property
    def due_us(self) -> int | None:
        """Time of the next call of `poll`; None if nothing is due."""
        return None

    def poll(self, now_us: int) -> None:
        """Do the work that is due."""

    def control(self, controlword: int, previous: int) -> None:
        """Obey the mode's own bits of a controlword."""

    def on_sync(self) -> None:
        """Handle a SYNC, after its latched process data have been written."""

    def inputs_changed(self, inputs: DigitalInput) -> None:
        """Handle new input levels, read at the end of the last tick."""

    def finished(self) -> None:
        """Handle the end of a motion: the axis is at standstill."""

    def interrupted(self) -> None:
        """Abandon the motion, because the drive stops it, leaves OPERATION ENABLED or changes the mode."""

    def target_reached(self) -> bool:
        """Return bit 10 of the statusword; by default, standstill."""
        return not self._motion.running

    def status_bits(self) -> int:
        """Return the mode's other bits of the statusword."""
        return 0
