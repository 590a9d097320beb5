"""Open the place at which other programs reach a live board: a socketcand server, or a bus of python-can."""

from steptwin.host.common import listening as socketcand
from steptwin.host.common.errors import InputError
from steptwin.host.twin.endpoints.endpoint import Endpoint


def open_endpoint(
    host: str | None, port: int | None, interface: str | None, channel: str | None, bitrate: int, *, allow_remote: bool
) -> Endpoint:
    """Listen for socketcand clients, or join the bus of a python-can interface if one is named.

    Raises:
        InputError: the arguments contradict each other, or name no address, port or interface.
        BusError: the port is in use, or the bus cannot be opened.
    """
    if interface is None:
        from steptwin.host.twin.endpoints.endpoint import SocketcandEndpoint

        if channel is not None:
            raise InputError(f"channel={channel}: needs interface=NAME")
        return SocketcandEndpoint(
            host or socketcand.LOOPBACK, socketcand.PORT if port is None else port, allow_remote=allow_remote
        )
    from steptwin.host.client.links.bus_link import Connection
    from steptwin.host.twin.endpoints.endpoint import PythonCanEndpoint

    connection = Connection(interface, channel, bitrate)
    if interface == "socketcand":
        connection = Connection(interface, channel, None, host or socketcand.LOOPBACK, port or socketcand.PORT)
    else:
        for name, value in (("host", host), ("port", port)):
            if value is not None:
                raise InputError(f"{name}={value}: is for a socketcand server, not for interface={interface}")
    if allow_remote:
        raise InputError(f"allow_remote=True: is for listening, not for interface={interface}")
    return PythonCanEndpoint(connection)
