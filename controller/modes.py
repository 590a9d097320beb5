"""What the modes of operation have in common."""

from typing import Protocol

from steptwin.controller.motion import Motion
from steptwin.protocol.cia402 import DigitalInput, ErrorCode


class Report(Protocol):
    """How a mode reports an error that is no fault: an EMCY with a detail number."""

    def __call__(self, code: ErrorCode, detail: int) -> None: ...


class Trip(Protocol):
    """How an axis asks for the fault reaction, of its whole group perhaps; it begins when the caller has returned."""

    def __call__(self, axis: int, code: ErrorCode, detail: int = 0) -> None: ...


class Mode:
    """One mode of operation of one axis; it acts only while the drive is in OPERATION ENABLED.

    As it stands it does nothing: the mode after power-up, until one is chosen.
    """

    def __init__(self, axis: int, motion: Motion) -> None:
        self._axis = axis
        self._motion = motion

    @property
    def coordinated(self) -> bool:
        """Whether the axis is moving in step with others, which must stop with it."""
        return False

    @property
    def seeks_switches(self) -> bool:
        """Whether the mode itself reacts to the limit switches now, which else are faults."""
        return False

    @property
    def due_us(self) -> int | None:
        """When `poll` wants to be called next."""
        return None

    def poll(self, now_us: int) -> None:
        """Do what is due."""

    def control(self, controlword: int, previous: int) -> None:
        """Obey the mode's bits of a controlword."""

    def on_sync(self) -> None:
        """A SYNC has come, and latched process data with it."""

    def inputs_changed(self, inputs: DigitalInput) -> None:
        """The axis' inputs have changed to these levels in the tick just over."""

    def finished(self) -> None:
        """The mode's motion has come to its end, at rest."""

    def interrupted(self) -> None:
        """The drive stops the mode's motion or leaves OPERATION ENABLED, or another mode takes over."""

    def target_reached(self) -> bool:
        """Bit 10 of the statusword: here, standstill."""
        return not self._motion.running(self._axis)

    def status_bits(self) -> int:
        """The mode's other bits of the statusword."""
        return 0
