"""What the modes of operation have in common, and the one that does nothing."""

from typing import Protocol

from protocol.cia402 import ErrorCode


class Mode(Protocol):
    """One mode of operation of one axis; it acts only while the drive is in OPERATION ENABLED."""

    def control(self, controlword: int, previous: int) -> None:
        """Obey the mode's bits of a controlword."""
        ...

    def finished(self) -> None:
        """The mode's motion has come to its end, at rest."""
        ...

    def status_bits(self) -> int:
        """The mode's bits of the statusword."""
        ...


class Report(Protocol):
    """How a mode reports an error that is no fault: an EMCY with a detail number."""

    def __call__(self, code: ErrorCode, detail: int) -> None: ...


class NoMode:
    """After power-up, until a mode is chosen."""

    def control(self, controlword: int, previous: int) -> None:
        """There is nothing to obey."""

    def finished(self) -> None:
        """There is no motion to finish."""

    def status_bits(self) -> int:
        """No bit means anything."""
        return 0
