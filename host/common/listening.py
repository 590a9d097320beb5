"""Listen at a TCP port for clients that drive a board: of this machine, or of others if that is allowed."""

import errno
import socket
from ipaddress import ip_address
from typing import Final

from steptwin.host.common.errors import BusError, InputError

PORT: Final = 29536
"""Default TCP port of socketcand."""
CHANNEL: Final = "vcan0"
"""Name of a served board's bus; a real socketcand server uses the names of its interfaces."""
LOOPBACK: Final = "127.0.0.1"
"""Default address of a served board, which only programs on the same machine can reach."""


_PORTS: Final = range(1024, 1 << 16)
_BACKLOG: Final = 64


def listen(host: str, port: int, parameter: str = "port", *, allow_remote: bool = False) -> socket.socket:
    """Return a socket that listens at an address of this machine; port 0 selects a free one.

    Args:
        host: name or address.
        port: TCP port.
        parameter: name of the port's parameter in messages.
        allow_remote: allow an address that other machines reach.

    Raises:
        InputError: the host or the port does not exist, or other machines reach the host and may not.
        BusError: the port is in use.
    """
    if port and port not in _PORTS:
        raise InputError(f"{parameter}={port}: is neither 0 nor from {_PORTS.start} to {_PORTS.stop - 1}")
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:
        raise InputError(f"host={host}: is not an address of this machine") from error
    if not allow_remote and not is_loopback(str(address[0])):
        raise InputError(f"host={host}: other machines could drive this board; allow_remote=True permits it")
    try:
        return socket.create_server(address[:2], family=family, backlog=_BACKLOG)
    except OSError as error:
        reasons = {
            errno.EADDRINUSE: f"is in use; {parameter}=0 takes a free one",
            errno.EADDRNOTAVAIL: "is not an address of this machine",
        }
        raise BusError(f"{host}:{port} {reasons.get(error.errno or 0, error.strerror)}") from error


def is_loopback(address: str) -> bool:
    """Return whether only programs on this machine reach an address."""
    return ip_address(address.partition("%")[0]).is_loopback
