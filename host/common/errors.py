"""Exceptions of the host, each with the exit code of the command line."""

from typing import ClassVar, Self


class StepTwinError(Exception):
    """Base of the errors that the command line reports in one line before it ends with their `exit_code`.

    Some have a second text for an operator of the machine, who knows joints and buttons but neither bus nor commands.
    """

    exit_code: ClassVar[int] = 1
    _plain: str | None = None

    def plainly(self, text: str) -> Self:
        """Set the text for an operator; return the error, to be raised."""
        self._plain = text
        return self

    @property
    def plain(self) -> str:
        """Text for an operator: the event and the remedy; the message, if `plainly` has set no other text."""
        return self._plain or str(self)


class NotVerifiedError(StepTwinError):
    """A stored run contradicts itself and cannot be verified; the message names file and key."""


class RecordingError(StepTwinError):
    """A file of a recording could not be written; the message names the file and the end of the recording."""


class InputError(StepTwinError):
    """The input is wrong; the message names the value, the limit and the nearest valid choice.

    Attributes:
        messages: one message for each error, at least one; the first is the text of this exception.
    """

    exit_code = 2

    def __init__(self, message: str, *others: str) -> None:
        super().__init__(message)
        self.messages: tuple[str, *tuple[str, ...]] = (message, *others)


class DeviceFaultError(StepTwinError):
    """A drive is in fault or has refused a command; the message names the axis and the CiA error code."""

    exit_code = 3


class WaitTimeoutError(DeviceFaultError):
    """An input did not reach its level in time: an external event is missing; the machine is at standstill."""


class BusError(StepTwinError):
    """The bus or the connection has failed: no answer, no such interface, no such node."""

    exit_code = 4
