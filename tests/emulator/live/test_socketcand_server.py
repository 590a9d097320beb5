"""A real server on the loopback with several clients: faulty ones do not disturb the others."""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from steptwin.emulator.live.socketcand_server import WINDOW_FRAMES
from steptwin.emulator.live.tcp_server import BACKLOG_MAX_BYTES, select_files
from tests.emulator.live.live_rig import TIMEOUT_S, LiveRig, RawClient, await_true

resource = pytest.importorskip("resource", reason="limits the number of files as Unix does")
READ_TYPE = b"< send 610 8 40 0 10 0 0 0 0 0 >"
TYPE = "590#4300100092010400"


@pytest.fixture
def rig() -> Iterator[LiveRig]:
    with LiveRig() as rig:
        yield rig


def ask(client: RawClient) -> None:
    """Read the device type (1000h) of the first axis."""
    client.send(READ_TYPE)
    assert client.frames(1) == [TYPE]


def test_a_question_and_its_answer(rig: LiveRig) -> None:
    ask(rig.client())


def test_clients_see_each_others_frames_and_not_their_own(rig: LiveRig) -> None:
    one, two, three = (rig.client() for _ in range(3))
    one.send(b"< send 123 2 ab cd >")
    assert two.frames(1) == three.frames(1) == ["123#ABCD"]
    two.send(READ_TYPE)
    assert two.frames(1) == [TYPE]
    assert one.frames(2) == three.frames(2) == ["610#4000100000000000", TYPE]


def test_an_empty_frame_has_two_spaces(rig: LiveRig) -> None:
    one, two = rig.client(), rig.client()
    one.send(b"< send 80 0 >")
    assert two.expect(b" >").endswith(b" ")


def test_a_burst_keeps_its_order(rig: LiveRig) -> None:
    """More than fit into the window, with identifiers that would change places in mailboxes."""
    one, two = rig.client(), rig.client()
    identifiers = [0x700 - 7 * i % 0x123 for i in range(20 * WINDOW_FRAMES)]
    one.send(b"".join(f"< send {identifier:x} 1 {i & 0xFF:x} >".encode() for i, identifier in enumerate(identifiers)))
    expected = [f"{identifier:03X}#{i & 0xFF:02X}" for i, identifier in enumerate(identifiers)]
    assert two.frames(len(expected)) == expected


def test_a_client_that_hangs_up_has_sent_what_it_has_sent(rig: LiveRig) -> None:
    one, two = rig.client(), rig.client()
    count = 20 * WINDOW_FRAMES
    one.send(b"".join(f"< send 123 2 {i >> 8:x} {i & 0xFF:x} >".encode() for i in range(count)))
    one.close()
    assert two.frames(count) == [f"123#{i:04X}" for i in range(count)]


def test_a_client_that_is_killed_in_mid_stream(rig: LiveRig) -> None:
    """The connection is reset, half a command has come."""
    one, two = rig.client(), rig.client()
    one.send(READ_TYPE * 5 + b"< send 12")
    one._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # noqa: SLF001
    one.close()
    await_true(lambda: rig.server.clients == 1, "the dead client is forgotten")
    two.send(b"< send 7ff 0 >< send 611 8 40 0 10 0 0 0 0 0 >")
    two.expect(b"< frame 591 ")


@pytest.mark.parametrize(
    "junk", [b"GET / HTTP/1.1\r\n\r\n", b"< bogus >", b"\xff" * 5000, b"< send 123 1 " + b"0" * 2_000_000]
)
def test_junk_ends_that_connection_only(rig: LiveRig, junk: bytes) -> None:
    rude, polite = rig.client(), rig.client()
    with suppress(ConnectionError):  # it is hung up on before it has said everything
        rude.send(junk)
    rude.until_hung_up()
    ask(polite)
    assert rig.server.disconnected == {"junk": 1}
    assert rig.server.clients == 1


def test_a_reason_is_given(rig: LiveRig) -> None:
    rude = rig.client()
    rude.send(b"< bogus >")
    assert rude.until_hung_up().endswith(b"< error unknown command >")


def test_half_a_command_is_waited_for(rig: LiveRig) -> None:
    slow, other = rig.client(), rig.client()
    slow.send(READ_TYPE[:11])
    ask(other)
    slow.send(READ_TYPE[11:])
    slow.expect(TYPE[4:].encode())


def test_frames_of_other_kinds_are_counted(rig: LiveRig) -> None:
    client = rig.client()
    client.send(b"< send 18FF1234 0 >< sendrtr 610 0 >")
    ask(client)
    assert rig.server.foreign_frames == 2
    client.close()
    await_true(lambda: rig.server.clients == 0, "the client is forgotten")
    assert rig.server.foreign_frames == 2


def test_fifty_clients(rig: LiveRig) -> None:
    clients = [rig.client() for _ in range(50)]
    assert rig.server.clients == rig.server.served == 50
    clients[17].send(b"< send 123 1 55 >")
    assert {tuple(client.frames(1)) for i, client in enumerate(clients) if i != 17} == {("123#55",)}
    for client in clients[::2]:
        client.close()
    await_true(lambda: rig.server.clients == 25, "half of the clients are gone")
    clients[1].send(READ_TYPE)
    assert {tuple(client.frames(2)) for client in clients[3::2]} == {("610#4000100000000000", TYPE)}


def test_one_more_than_there_may_be(rig: LiveRig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("steptwin.emulator.live.tcp_server.CLIENTS_MAX", 2)
    first, _ = rig.client(), rig.client()
    with socket.create_connection(("127.0.0.1", rig.port), timeout=TIMEOUT_S) as third:
        assert third.recv(100) == b"< error 2 clients are connected, no more are served >"
        assert third.recv(100) == b""
    assert rig.server.disconnected == {"too many clients": 1}
    ask(first)


def test_out_of_files_it_waits_without_work(rig: LiveRig) -> None:
    """A client that cannot be accepted does not keep the loop awake; it is served once there is a file for it."""
    first = rig.client()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with socket.socket() as second:
        second.settimeout(TIMEOUT_S)
        resource.setrlimit(resource.RLIMIT_NOFILE, (second.fileno() + 1, hard))
        try:
            second.connect(("127.0.0.1", rig.port))
            ask(first)
            cpu_s, wall_s = time.process_time(), time.monotonic()
            time.sleep(1.0)
            busy = (time.process_time() - cpu_s) / (time.monotonic() - wall_s)
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert busy < 0.5
        assert rig.server.served == 1
        assert second.recv(100) == b"< hi >"


def test_a_file_beyond_those_of_select(rig: LiveRig, monkeypatch: pytest.MonkeyPatch) -> None:
    """`select` raises for such a file, which would end the loop for all."""
    first = rig.client()
    monkeypatch.setattr("steptwin.emulator.live.tcp_server._SELECT_FILES", 3)
    with socket.create_connection(("127.0.0.1", rig.port), timeout=TIMEOUT_S) as second:
        assert second.recv(100) == b"< error 1 clients are connected, no more are served >"
    ask(first)


@pytest.mark.parametrize(("system", "answer"), [("posix", b"< error 0 clients"), ("nt", b"< hi >")])
def test_windows_handles_are_no_numbers_of_files(
    rig: LiveRig, monkeypatch: pytest.MonkeyPatch, system: str, answer: bytes
) -> None:
    """There a socket's number may be 5000 while `select` waits for three: here every number is beyond the bound."""
    monkeypatch.setattr("steptwin.emulator.live.tcp_server._SELECT_FILES", select_files(system) - 1024)
    with socket.create_connection(("127.0.0.1", rig.port), timeout=TIMEOUT_S) as client:
        assert client.recv(100).startswith(answer)


def test_one_that_does_not_read_is_disconnected_and_no_one_else() -> None:
    """A fast bus fills its buffers: what the operating systems holds, and then what the server does."""
    with LiveRig(speed=50) as rig:
        sleeper = rig.client(receive_buffer_bytes=4096)
        talker, listener = rig.client(), rig.client()
        command = b"< send 123 8 1 2 3 4 5 6 7 8 >"
        sent = 0
        while not rig.server.disconnected:
            talker.send(command * 1000)
            sent += 1000
            assert listener.frames(1000) == ["123#0102030405060708"] * 1000
            assert sent < 100 * BACKLOG_MAX_BYTES / len(command)
        assert rig.server.disconnected == {"reads too slowly": 1}
        assert len(sleeper.until_hung_up()) < 20 * BACKLOG_MAX_BYTES
        talker.send(READ_TYPE)
        for client in (talker, listener):
            client.expect(TYPE[4:].encode())


def test_passed_frames_are_not_kept_in_memory() -> None:
    """Neither the bus nor the server keeps them."""
    with LiveRig(speed=50) as rig:
        one, two = rig.client(), rig.client()
        for _ in range(10):
            one.send(b"< send 123 1 2 >" * 500)
            two.frames(500)
        assert rig.bus.frames >= 5000
        assert not rig.bus.log_frames
        assert not rig.bus.log_counts
        assert not rig.live._senders  # noqa: SLF001
        assert not rig.live._incoming  # noqa: SLF001


def test_after_closing_no_client_is_connected() -> None:
    with LiveRig() as rig:
        client = RawClient(rig.port)
    assert client.until_hung_up() == b""
    client.close()
    with pytest.raises(ConnectionError):
        socket.create_connection(("127.0.0.1", rig.port)).close()
