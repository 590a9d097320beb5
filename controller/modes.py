"""What the modes of operation have in common, and the one that does nothing."""

from typing import Protocol

from controller.motion import Motion
from protocol.cia402 import ErrorCode


class Mode(Protocol):
    """One mode of operation of one axis; it acts only while the drive is in OPERATION ENABLED."""

    def control(self, controlword: int, previous: int) -> None:
        """Obey the mode's bits of a controlword."""
        ...

    def finished(self) -> None:
        """The mode's motion has come to its end, at rest."""
        ...

    def interrupted(self) -> None:
        """The drive stops the mode's motion or leaves OPERATION ENABLED, or another mode takes over."""
        ...

    def target_reached(self) -> bool:
        """Bit 10 of the statusword."""
        ...

    def status_bits(self) -> int:
        """The mode's other bits of the statusword."""
        ...


class Report(Protocol):
    """How a mode reports an error that is no fault: an EMCY with a detail number."""

    def __call__(self, code: ErrorCode, detail: int) -> None: ...


class NoMode:
    """After power-up, until a mode is chosen."""

    def __init__(self, axis: int, motion: Motion) -> None:
        self._axis = axis
        self._motion = motion

    def control(self, controlword: int, previous: int) -> None:
        """There is nothing to obey."""

    def finished(self) -> None:
        """There is no motion to finish."""

    def interrupted(self) -> None:
        """There is no motion to interrupt."""

    def target_reached(self) -> bool:
        """Standstill."""
        return not self._motion.running(self._axis)

    def status_bits(self) -> int:
        """No bit means anything."""
        return 0
