"""Connect to a rosbridge server by a WebSocket (RFC 6455).

The extra is `websockets`, not `roslibpy`: that one offers no actions, and brings Twisted and autobahn.
"""

from importlib.util import find_spec
from typing import Final

from steptwin.host.client.links.bus_link import reason
from steptwin.host.client.links.connecting import ANSWER_S, address_text
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import MIB
from steptwin.host.operate.rosbridge.bridge import RosbridgeLostError

PORT: Final = 9090
"""Port of rosbridge_server's WebSocket."""
_MESSAGE_BYTES_MAX: Final = 16 * MIB
"""A goal of six joints with 10 000 points has some 6 MB."""
_PING_S: Final = 1.0
"""Time from one ping to the next; a server that is silent for twice as long is lost."""

_CLOSE_S: Final = 0.2
"""Longest time that a lost connection takes to end: a stream that is not tended meanwhile lasts half a second."""


def require_websockets() -> None:
    """Raise InputError, with the remedy, unless the extra `ros2` is installed."""
    if find_spec("websockets") is None:
        raise InputError("the bridge to ROS is not installed: pip install 'steptwin[ros2]'")


class RosbridgeSocket:
    """A connection to a rosbridge server; a context manager that closes it at its end."""

    def __init__(self, host: str, port: int) -> None:
        """Connect; raise RosbridgeLostError if no server answers there."""
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect

        self._title = f"rosbridge at {address_text(host, port)}"
        try:
            self._connection = connect(
                f"ws://{address_text(host, port)}",
                open_timeout=ANSWER_S,
                close_timeout=_CLOSE_S,
                ping_interval=_PING_S,
                ping_timeout=2 * _PING_S,
                max_size=_MESSAGE_BYTES_MAX,
                max_queue=None,  # a cancellation must not wait behind other messages
                compression=None,
                proxy=None,
            )
        except (OSError, WebSocketException) as error:
            raise RosbridgeLostError(f"{self._title}: {reason(error)}: is rosbridge_server running?") from error

    def send(self, text: str) -> None:
        """Send a message; raise RosbridgeLostError if the connection has ended."""
        from websockets.exceptions import ConnectionClosed

        try:
            self._connection.send(text)
        except (OSError, ConnectionClosed) as error:
            raise self._lost() from error

    def received(self) -> list[str | bytes]:
        """Return the messages that have come, without waiting; raise RosbridgeLostError as `send`."""
        from websockets.exceptions import ConnectionClosed

        messages: list[str | bytes] = []
        try:
            while True:
                messages.append(self._connection.recv(timeout=0))
        except TimeoutError:
            return messages
        except (OSError, ConnectionClosed) as error:
            raise self._lost() from error

    def _lost(self) -> RosbridgeLostError:
        return RosbridgeLostError(f"{self._title}: the connection has ended; a motion that was under way has stopped")

    def __enter__(self) -> "RosbridgeSocket":
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self._connection.close()
