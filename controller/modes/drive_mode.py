"""The interface of a mode of operation, as the drive uses it."""

from steptwin.controller.node.axis_context import AxisContext
from steptwin.protocol.cia402 import DigitalInput


class DriveMode:
    """One mode of operation of one axis. It acts only while the drive is in OPERATION ENABLED.

    This base class does nothing: it is the mode after power-up, until the host selects one.
    """

    def __init__(self, context: AxisContext) -> None:
        self._context = context
        self._motion = context.motion
        self._dictionary = context.dictionary

    @property
    def coordinated(self) -> bool:
        """True while the axis moves in step with others, which must stop with it."""
        return False

    @property
    def seeks_switches(self) -> bool:
        """True while the mode itself reacts to limit switches, so that they are not faults."""
        return False

    @property
    def switches_at(self) -> int:
        """The axis of the board at whose inputs the mode's switches are; by default, its own."""
        return self._context.axis

    @property
    def due_us(self) -> int | None:
        """Time of the next call of `poll`; None if the mode waits for nothing."""
        return None

    def poll(self, now_us: int) -> None:
        """Do the work that is due."""

    def control(self, controlword: int, previous: int) -> None:
        """Obey the mode's own bits of a controlword."""

    def on_sync(self) -> None:
        """Handle a SYNC, after the process data latched with it has been written."""

    def inputs_changed(self, inputs: DigitalInput) -> None:
        """Handle new input levels, as of the end of the last tick."""

    def finished(self) -> None:
        """Handle the end of a motion: the axis is at rest."""

    def interrupted(self) -> None:
        """Abandon the mode's motion: the drive stops it, leaves OPERATION ENABLED or changes to another mode."""

    def target_reached(self) -> bool:
        """Return bit 10 of the statusword; by default, standstill."""
        return not self._motion.running

    def status_bits(self) -> int:
        """Return the mode's other bits of the statusword."""
        return 0
