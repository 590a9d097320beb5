"""Buses of python-can, for clients and for boards: which interfaces there are, and what they say when they fail."""

from typing import Any

import can

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import BusError


def check_interface(what: str, name: str) -> None:
    """Raise InputError if python-can has no such interface; `what` is how the message calls it."""
    if name not in can.VALID_INTERFACES:
        raise unknown(what, name, sorted(can.VALID_INTERFACES))


def open_python_can_bus(title: str, interface: str, **arguments: Any) -> can.BusABC:
    """Open one; arguments that are None are left to the interface. BusError, under the title, if that fails."""
    given = {name: value for name, value in arguments.items() if value is not None}
    try:
        return can.Bus(interface=interface, **given)
    except Exception as error:  # each driver has its own: kvaser's says NameError where there is no canlib
        raise BusError(f"{title}: {reason(error)}") from error


def reason(error: BaseException) -> str:
    """What an interface says, in one line."""
    text = str(getattr(error, "strerror", None) or error) or type(error).__name__
    return text.splitlines()[0]
