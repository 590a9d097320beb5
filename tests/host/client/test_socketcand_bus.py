"""The client of a socketcand server, against servers that behave in every bad way."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.live.socketcand import frame_text
from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.client.links.socketcand_bus import SocketcandBus
from steptwin.host.common.errors import BusError
from steptwin.protocol.frame import Frame
from tests.emulator.live.live_rig import TIMEOUT_S, LiveRig
from tests.end_to_end.served import in_real_time
from tests.messages import refusing

pytestmark = pytest.mark.live

Script = Callable[[socket.socket], object]
LOOPBACK = "127.0.0.1"


@contextmanager
def serving(script: Script) -> Iterator[int]:
    """Serve one client by a script at a free port; its connection is closed after the block."""
    listener = socket.create_server((LOOPBACK, 0))
    over = threading.Event()

    def serve() -> None:
        client, _ = listener.accept()
        with client:
            client.settimeout(TIMEOUT_S)
            script(client)
            over.wait(TIMEOUT_S)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        over.set()
        thread.join(TIMEOUT_S)
        listener.close()


def greet(client: socket.socket) -> None:
    client.sendall(b"< hi >")
    for _ in range(2):
        client.recv(256)
        client.sendall(b"< ok >")


def greet_and(script: Script) -> Script:
    def greet_first(client: socket.socket) -> None:
        greet(client)
        script(client)

    return greet_first


def complaint(port: int) -> str:
    with pytest.raises(BusError) as caught:
        open_bus(Connection("socketcand", None, None, LOOPBACK, port)).shutdown()
    return str(caught.value).removeprefix(f"{LOOPBACK}:{port}: ")


def opened(port: int) -> BusLink:
    title = f"{LOOPBACK}:{port}"
    return BusLink(open_bus(Connection("socketcand", None, None, LOOPBACK, port)), title)


def wait_on(link: BusLink) -> None:
    deadline_s = time.monotonic() + TIMEOUT_S
    with link:
        while time.monotonic() < deadline_s:
            link.wait(0.001)


def until_it_fails(link: BusLink) -> str:
    """Wait on a link until it raises; return the message."""
    with pytest.raises(BusError) as caught:
        wait_on(link)
    return str(caught.value).partition(": ")[2]


class TestGreeting:
    @pytest.mark.parametrize(
        ("said", "told"),
        [
            (b"", "accepts but does not answer within 1 s"),
            (b"< h", "accepts but does not answer within 1 s"),
            (b"< hi >", "accepts but does not answer within 1 s"),
            (
                b"SSH-2.0-OpenSSH_9.2\r\n",
                r"is not a socketcand server: it says SSH-2.0-OpenSSH_9.2\r\n instead of < hi >",
            ),
            (b"< \x1b[2J >", r"is not a socketcand server: it says < \x1b[2J > instead of < hi >"),
            (b"< error 250 clients are connected >", "250 clients are connected"),
            (b"< hi >< error could not open bus >", "could not open bus"),
        ],
    )
    @in_real_time
    def test_a_server_that_says_something_else(self, said: bytes, told: str) -> None:
        with serving(lambda client: client.sendall(said)) as port:
            assert complaint(port) == told

    @in_real_time
    def test_a_server_that_hangs_up(self) -> None:
        with serving(socket.socket.close) as port:
            assert complaint(port) in ("the server has closed the connection", "Connection reset by peer")

    @in_real_time
    def test_in_pieces_and_with_the_first_frame(self) -> None:
        def slowly(client: socket.socket) -> None:
            for piece in (b"<", b" hi >"):
                client.sendall(piece)
                time.sleep(0.01)
            client.recv(256)
            client.sendall(b"< ok >")
            client.recv(256)
            client.sendall(b"< ok >< frame 181 1.5 0102 >< frame 1")

        with serving(slowly) as port, SocketcandBus("vcan0", LOOPBACK, port) as bus:
            message = bus.recv(TIMEOUT_S)
        assert message
        assert message.equals(can.Message(1.5, 0x181, False, data=b"\1\2", channel="vcan0"), timestamp_delta=0)

    def test_a_name_without_an_address(self) -> None:
        with refusing(BusError):
            open_bus(Connection("socketcand", None, None, "no-such-host.invalid", 29536))

    def test_ipv6(self) -> None:
        try:
            listener = socket.create_server(("::1", 0), family=socket.AF_INET6)
        except OSError:
            pytest.skip("this computer has no IPv6")
        with listener:
            port = listener.getsockname()[1]
            title = Connection("socketcand", None, None, "::1", port).title
            assert title == f"[::1]:{port}"
            with pytest.raises(BusError) as caught:
                open_bus(Connection("socketcand", None, None, "::1", port))
        assert str(caught.value) == f"[::1]:{port}: accepts but does not answer within 1 s"


MESSAGE = can.Message(arbitration_id=0x123, data=bytes(8), is_extended_id=False)


def flood(bus: SocketcandBus) -> None:
    for _ in range(1_000_000):
        bus.send(MESSAGE)


class TestAnOpenBus:
    @in_real_time
    def test_a_server_that_hangs_up(self) -> None:
        with serving(greet_and(lambda client: client.shutdown(socket.SHUT_RDWR))) as port:
            assert until_it_fails(opened(port)) == "the server has closed the connection"

    @in_real_time
    def test_a_server_that_says_why(self) -> None:
        def end(client: socket.socket) -> None:
            client.sendall(b"< error too slow >")
            client.shutdown(socket.SHUT_RDWR)

        with serving(greet_and(end)) as port:
            assert until_it_fails(opened(port)) == "the server has closed the connection: too slow"

    def test_a_server_that_falls_silent(self) -> None:
        with serving(greet) as port:
            assert until_it_fails(opened(port)) == "accepts but does not answer within 1 s"

    def test_a_server_that_takes_nothing(self) -> None:
        """Both ends' buffers fill; then the sender is held up for a second at most, and each later one not at all."""
        with serving(greet) as port, SocketcandBus("vcan0", LOOPBACK, port) as bus:
            with refusing(can.CanOperationError):
                flood(bus)
            with pytest.raises(can.CanOperationError):
                bus.send(MESSAGE)

    @in_real_time
    def test_a_quiet_bus_is_not_a_dead_one(self) -> None:
        """The server answers an echo after a second of silence, so the link stays open."""
        echoes = []

        def echo(client: socket.socket) -> None:
            for _ in range(2):
                echoes.append(client.recv(256))
                client.sendall(b"< echo >")
            client.sendall(b"< frame 123 1.0  >")

        with serving(greet_and(echo)) as port, SocketcandBus("vcan0", LOOPBACK, port) as bus:
            message = bus.recv(TIMEOUT_S)
        assert message
        assert message.arbitration_id == 0x123
        assert echoes == [b"< echo >"] * 2

    @in_real_time
    def test_junk_is_dropped_and_counted(self) -> None:
        junk = (b"nonsense", b"< frame 12 1.0 >", b"< frame 123 x 00 >", b"< " + b"x" * 600, b"< stat 1 2 3 4 >")

        def talk(client: socket.socket) -> None:
            for piece in junk:
                client.sendall(piece)
                time.sleep(0.02)
            client.sendall(b"< frame 123 1.0 00 >")

        with serving(greet_and(talk)) as port, SocketcandBus("vcan0", LOOPBACK, port) as bus:
            message = bus.recv(TIMEOUT_S)
            assert message
            assert bytes(message.data) == b"\0"
            assert bus.dropped >= len(junk) - 1  # two that come together may count as one


@given(st.integers(0, 0x7FF), st.binary(max_size=8), st.integers(0, 1 << 51))
def test_it_reads_what_our_server_writes(cob_id: int, data: bytes, time_us: int) -> None:
    from steptwin.host.client.links.socketcand_bus import _FRAME, _message

    frame = _FRAME.fullmatch(frame_text(Frame(cob_id, data), time_us))
    assert frame
    message = _message(frame, "")
    assert (message.arbitration_id, bytes(message.data), message.is_extended_id) == (cob_id, data, False)
    assert message.timestamp == pytest.approx(time_us / 1e6)


@in_real_time
def test_frames_arrive_both_ways() -> None:
    with LiveRig() as rig, SocketcandBus("vcan0", LOOPBACK, rig.port) as bus:
        other = rig.client()
        bus.send(can.Message(arbitration_id=0x7A1, data=b"\x0a\xff", is_extended_id=False))
        bus.send(can.Message(arbitration_id=0x7A2, is_extended_id=False))
        assert other.frames(2) == ["7A1#0AFF", "7A2#"]
        other.send(b"< send 7A3 1 55 >")
        received = bus.recv(TIMEOUT_S)
        assert received
        assert (received.arbitration_id, bytes(received.data)) == (0x7A3, b"\x55")
