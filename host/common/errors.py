"""One exception tree for all that can go wrong on the host, each with the command line's exit code."""

from typing import ClassVar


class StepTwinError(Exception):
    """Base of every error that the command line reports in one line; `exit_code` is what it ends with."""

    exit_code: ClassVar[int] = 1


class NotVerifiedError(StepTwinError):
    """A stored run contradicts itself, so that there is nothing to verify; the message names file and key."""

    exit_code = 1


class InputError(StepTwinError):
    """Bad input or usage: the message names the value, the limit and the nearest valid choice."""

    exit_code = 2


class DeviceFaultError(StepTwinError):
    """A drive is in fault or refused a command; the message names axis and CiA error code."""

    exit_code = 3


class BusError(StepTwinError):
    """The bus or the connection failed: no answer, no such interface, no such node."""

    exit_code = 4
