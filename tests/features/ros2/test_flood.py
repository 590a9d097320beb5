"""A server that sends faster than its messages are read holds up no turn of the bridge."""

from typing import Any

from steptwin.features.ros2.bridge import RosbridgeSocket


class Flood:
    """A connection in which there is always another message."""

    def recv(self, timeout: float) -> str:
        assert timeout == 0
        return "{}"


def test_a_turn_reads_some_of_many_messages() -> None:
    socket: Any = object.__new__(RosbridgeSocket)
    socket._connection = Flood()  # noqa: SLF001 - a connection without a server
    assert len(socket.received()) == 100
