"""Open any bus that python-can knows, for a client or for a board, with errors in one line."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import can
from canopen.objectdictionary import ObjectDictionary, eds

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import BusError, StepTwinError
from steptwin.protocol.eds import render_eds
from steptwin.protocol.frame import FIRST_NODE_ID


@cache
def object_dictionary() -> ObjectDictionary:
    """Return the dictionary; it is made once, since that takes 40 ms, and nothing writes to it."""
    dictionary: ObjectDictionary = eds.import_eds(io.StringIO(render_eds()), FIRST_NODE_ID)  # type: ignore[no-untyped-call]
    return dictionary


def check_interface(what: str, name: str) -> None:
    """Raise InputError if python-can has no interface of this name; the message calls the name `what`."""
    if name not in can.VALID_INTERFACES:
        raise unknown(what, name, sorted(can.VALID_INTERFACES))


def open_python_can_bus(title: str, interface: str, **arguments: Any) -> can.BusABC:
    """Open a bus, with defaults for arguments that are None; raise BusError, headed by `title`, if it fails."""
    given = {name: value for name, value in arguments.items() if value is not None}
    with bus_errors(title):
        return can.Bus(interface=interface, **given)


@contextmanager
def bus_errors(title: str) -> Iterator[None]:
    """Turn every error of an interface into a BusError, headed by `title`."""
    try:
        yield
    except StepTwinError:
        raise
    except Exception as error:  # each driver raises its own: kvaser's a NameError if canlib is missing
        raise BusError(f"{title}: {reason(error)}") from error


def reason(error: BaseException) -> str:
    """Return the first line of an interface's error."""
    text = str(getattr(error, "strerror", None) or error) or type(error).__name__
    return text.splitlines()[0]
