"""Links to a bus: the interface between client and bus, and TCP connections with a time limit.

A link is a CANopen network and the board's clock. `bus_link` is a link in real time, `socketcand_bus` a bus of a
server.
"""

import socket
import threading
import time
from typing import Any, Final, Protocol

import canopen

ANSWER_S: Final = 1.0
"""Time limit for a server to accept and greet a client, answer it, and accept sent bytes."""
SILENT: Final = f"accepts but does not answer within {ANSWER_S:g} s"
"""Message about a server that exceeds ANSWER_S."""


class Clock(Protocol):
    """A clock, simulated or real."""

    def now_s(self) -> float:
        """Return the seconds on the board's clock."""
        ...

    def wait(self, dt_s: float) -> None:
        """Wait: advance the simulated clock, or sleep."""
        ...


class Link(Clock, Protocol):
    """A connection to a bus, in virtual or real time."""

    @property
    def held_up_s(self) -> float:
        """Longest delay of this program in a `wait`, caused by a slow computer."""
        ...

    @property
    def network(self) -> canopen.Network:
        """Network of the nodes."""
        ...


def in_url(host: str) -> str:
    """Return a host as in URLs: an IPv6 address in brackets (RFC 3986)."""
    return f"[{host}]" if ":" in host else host


def address_text(host: str, port: int) -> str:
    """Return HOST:PORT as in URLs."""
    return f"{in_url(host)}:{port}"


def connected(host: str, port: int, until_s: float) -> socket.socket:
    """Connect to the first address of a host that accepts before `until_s` on the monotonic clock.

    Raises:
        OSError: no address accepts in time, or the host has none.
    """
    failure: OSError = TimeoutError(f"does not answer within {ANSWER_S:g} s")
    for family, kind, protocol, _, address in _addresses(host, port, until_s):
        connecting = socket.socket(family, kind, protocol)
        connecting.settimeout(max(0.001, until_s - time.monotonic()))
        try:
            connecting.connect(address)
        except TimeoutError:
            connecting.close()
        except OSError as error:
            connecting.close()
            failure = error
        else:
            connecting.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return connecting
    raise failure


def _addresses(host: str, port: int, until_s: float) -> list[Any]:
    """Return a host's addresses, as `getaddrinfo` does; a thread runs it, because it has no time limit."""
    found: list[Any] = []
    errors: list[OSError] = []

    def look_up() -> None:
        try:
            found.extend(socket.getaddrinfo(host, port, type=socket.SOCK_STREAM))
        except (OSError, UnicodeError) as error:
            errors.append(error if isinstance(error, OSError) else OSError(f"{host} is not a host's name"))

    looking = threading.Thread(target=look_up, name=f"address of {host}", daemon=True)
    looking.start()
    looking.join(max(0.0, until_s - time.monotonic()))
    if errors:
        raise errors[0]
    if looking.is_alive():
        raise TimeoutError(f"no name server knows {host} within {ANSWER_S:g} s")
    return list(found)
