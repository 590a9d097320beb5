"""The link in real time, on python-can's bus in memory and on a socket."""

import socket
import threading

import can
import pytest

from steptwin.host.cli.app import run
from steptwin.host.client.bus_link import BusLink, Connection, open_bus
from steptwin.host.common.errors import BusError

VIRTUAL = Connection("virtual", "test-bus-link")


def test_frames_go_both_ways() -> None:
    heard = []
    with can.Bus(interface="virtual", channel="test-bus-link") as other, BusLink(open_bus(VIRTUAL), "virtual") as link:
        link.network.send_message(0x123, b"\x01\x02")
        sent = other.recv(5.0)
        assert sent is not None
        assert (sent.arbitration_id, sent.is_extended_id, bytes(sent.data)) == (0x123, False, b"\x01\x02")
        arrived = threading.Event()

        def hear(_cob_id: int, data: bytearray, _time_s: float) -> None:
            heard.append(bytes(data))
            arrived.set()

        link.network.subscribe(0x234, hear)
        other.send(can.Message(arbitration_id=0x234, data=b"\x03", is_extended_id=False))
        assert arrived.wait(5.0)
        before_s = link.now_s()
        link.wait(0.001)
        assert link.now_s() >= before_s + 0.001
    assert heard == [b"\x03"]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
    return port


def test_a_refused_connection(capsys: pytest.CaptureFixture[str]) -> None:
    """The error comes at once, not after python-can's ten seconds of retries."""
    port = free_port()
    with pytest.raises(BusError, match=rf"^127\.0\.0\.1:{port}: Connection refused$"):
        open_bus(Connection("socketcand", None, None, "127.0.0.1", port))
    assert run(["doctor", "warehouse-scara", "--connect", f"127.0.0.1:{port}"]) == 4
    assert capsys.readouterr().out == f"[FAIL] bus: 127.0.0.1:{port}: Connection refused\n"


def test_an_interface_that_cannot_be_opened() -> None:
    with pytest.raises(BusError, match=r"^socketcan no-such-can0: "):
        open_bus(Connection("socketcan", "no-such-can0", 500_000))


class Server:
    """A socketcand server that lets one client in, then closes the connection."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self.hang_up = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        self._server.accept()[0].close()  # the client's test whether the port is open
        client, _ = self._server.accept()
        with client:
            client.sendall(b"< hi >")
            for _ in range(2):
                client.recv(256)
                client.sendall(b"< ok >")
            self.hang_up.wait(10.0)

    def close(self) -> None:
        self.hang_up.set()
        self._thread.join()
        self._server.close()


def test_a_server_that_hangs_up() -> None:
    """The link raises an error; python-can itself would wait for frames without end."""
    server = Server()
    try:
        bus = open_bus(Connection("socketcand", None, None, "127.0.0.1", server.port))
        with pytest.raises(BusError, match=rf"^127\.0\.0\.1:{server.port}: the server has closed the connection$"):
            _wait_for_ever(BusLink(bus, f"127.0.0.1:{server.port}"), server)
    finally:
        server.close()


def _wait_for_ever(link: BusLink, server: Server) -> None:
    with link:
        server.hang_up.set()
        for _ in range(10_000):
            link.wait(0.001)
