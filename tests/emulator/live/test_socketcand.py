"""The dialogue with one client, byte by byte: its commands, the answers, and that no input raises an error."""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest
from can import Message
from can.interfaces.socketcand.socketcand import (
    convert_ascii_message_to_can_message,
    convert_can_message_to_ascii_message,
)
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.live.socketcand import COMMAND_MAX, WINDOW_FRAMES, SessionMode, SocketcandSession, frame_text
from steptwin.emulator.live.tcp_server import BACKLOG_MAX_BYTES, select_files
from steptwin.protocol.frame import REMOTE, Frame
from tests.emulator.live.live_rig import TIMEOUT_S, LiveRig, RawClient, await_true

OPENED = b"< open vcan0 >< rawmode >"
FRAMES = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))
resource = pytest.importorskip("resource", reason="limits the number of files as Unix does")
READ_TYPE = b"< send 610 8 40 0 10 0 0 0 0 0 >"
TYPE = "590#4300100092010400"


def talk(*pieces: bytes) -> tuple[SocketcandSession, list[Frame]]:
    """Feed a session; return it and all frames that it wants to send."""
    session, frames = SocketcandSession(), []
    for piece in pieces:
        session.feed(piece)
        while frame := session.next_frame():
            frames.append(frame)
    return session, frames


class TestDialogue:
    def test_greeting_open_rawmode_send(self) -> None:
        session, frames = talk(b"< open vcan0 >", b"< rawmode >", b"< send 201 8 1 2 a0 0 0 0 0 ff >")
        assert session.outbox == b"< hi >< ok >< ok >"
        assert session.mode is SessionMode.RAW
        assert frames == [Frame(0x201, bytes.fromhex("0102a000000000ff"))]

    @pytest.mark.parametrize(
        ("text", "frame"),
        [
            (b"< send 80 0 >", Frame(0x80, b"")),
            (b"< send 080 0  >", Frame(0x80, b"")),
            (b"<send 7FF 1 0>", Frame(0x7FF, b"\0")),
            (b"<  send\t0\n1  FF >", Frame(0, b"\xff")),
        ],
    )
    def test_ways_to_send(self, text: bytes, frame: Frame) -> None:
        assert talk(OPENED, text)[1] == [frame]

    def test_one_may_send_before_rawmode(self) -> None:
        assert talk(b"< open can0 >", b"< send 1 0 >")[1] == [Frame(1, b"")]

    def test_echo(self) -> None:
        session, _ = talk(OPENED, b"< echo >")
        assert session.outbox.endswith(b"< ok >< echo >")

    def test_blanks_between_commands(self) -> None:
        assert len(talk(b" \r\n< open a >\n\n< rawmode >\t< send 1 0 >\n")[1]) == 1

    @pytest.mark.parametrize(
        "foreign",
        [b"< send 18FF1234 2 1 2 >", b"< sendrtr 18FF1234 0 >", b"< fdsend 123 0 12 0 0 0 0 0 0 0 0 0 0 0 0 >"],
    )
    def test_frames_of_other_kinds_are_dropped_and_counted(self, foreign: bytes) -> None:
        """python-can takes an error message for a broken connection, so it is told nothing."""
        session, frames = talk(OPENED, foreign, b"< send 1 0 >")
        assert session.outbox == b"< hi >< ok >< ok >"
        assert session.foreign_frames == 1
        assert frames == [Frame(1, b"")]

    def test_a_remote_frame(self) -> None:
        """It has the flag and no bytes, whatever length it asks for."""
        session, frames = talk(OPENED, b"< sendrtr 710 1 >")
        assert frames == [Frame(REMOTE | 0x710, b"")]
        assert session.foreign_frames == 0


class TestWhatItIsShown:
    TEXT = b"< frame 181 1700000000.123456 0102A0 >"

    def test_nothing_before_rawmode(self) -> None:
        session, _ = talk(b"< open vcan0 >")
        session.deliver(self.TEXT)
        assert session.outbox == b"< hi >< ok >"

    def test_silence_after_rawmode_until_it_is_broken(self) -> None:
        session, _ = talk(OPENED)
        assert session.silent
        session.deliver(self.TEXT)
        assert session.outbox.endswith(b"< ok >")
        assert session.backlog_bytes == len(session.outbox) + len(self.TEXT)
        session.break_silence()
        assert session.outbox.endswith(b"< ok >" + self.TEXT)
        session.deliver(self.TEXT)
        assert session.outbox.endswith(2 * self.TEXT)
        assert not session.silent

    def test_silence_until_it_sends(self) -> None:
        session, _ = talk(OPENED)
        session.deliver(self.TEXT)
        session.feed(b"< send 1 0 >")
        assert session.next_frame()
        assert session.outbox.endswith(self.TEXT)

    def test_the_text(self) -> None:
        assert frame_text(Frame(0x181, bytes((1, 2, 0xA0))), 1_700_000_000_123_456) == self.TEXT
        assert frame_text(Frame(0x80, b""), 1_000_007) == b"< frame 080 1.000007  >"


class TestJunk:
    @pytest.mark.parametrize(
        ("junk", "complaint"),
        [
            (b"GET / HTTP/1.1\r\n", "commands stand between < and >"),
            (b"\x00", "commands stand between < and >"),
            (b"< >", "unknown command"),
            (b"< bogus >", "unknown command"),
            (b"< open vcan0 >", "unknown command"),
            (b"< send >", "unknown command"),
            (b"< send 800 0 >", "send: the identifier is above 7FF"),
            (b"< send 1234 0 >", "unknown command"),
            (b"< send 12g 0 >", "unknown command"),
            (b"< send 1 2 1 >", "send: the length is not that of the data"),
            (b"< send 1 0 1 >", "send: the length is not that of the data"),
            (b"< send 1 9 1 2 3 4 5 6 7 8 9 >", "unknown command"),
            (b"< send 1 1 100 >", "unknown command"),
            (b"< send 1 1 -1 >", "unknown command"),
            (b"< send 1 < send 1 0 >", "unknown command"),
            (b"<" + b" " * (COMMAND_MAX - 1), "command too long"),
            (b"<" + b" " * COMMAND_MAX + b"send 1 0 >", "command too long"),
        ],
    )
    def test_it_ends_the_session(self, junk: bytes, complaint: str) -> None:
        session, frames = talk(OPENED, junk, b"< send 1 0 >")
        assert frames == []
        assert session.mode is SessionMode.CLOSED
        assert session.complaint == complaint
        assert session.outbox.endswith(f"< error {complaint} >".encode())

    def test_what_came_before_it_counts(self) -> None:
        session, frames = talk(OPENED, b"< send 1 0 >< junk >< send 2 0 >")
        assert frames == [Frame(1, b"")]
        assert session.mode is SessionMode.CLOSED

    @pytest.mark.parametrize("early", [b"< rawmode >", b"< send 1 0 >", b"< echo >"])
    def test_first_a_bus_is_opened(self, early: bytes) -> None:
        assert talk(early)[0].mode is SessionMode.CLOSED

    def test_the_longest_command(self) -> None:
        head, tail = b"< send 1 0", b">"
        text = head + b" " * (COMMAND_MAX - len(head) - len(tail)) + tail
        assert talk(OPENED, text)[1] == [Frame(1, b"")]

    @given(st.lists(st.binary(max_size=40)))
    def test_nothing_raises(self, pieces: list[bytes]) -> None:
        session, _ = talk(OPENED, *pieces)
        assert session.outbox.startswith(b"< hi >< ok >< ok >")

    @given(st.text("<> \nsend0123456789abcdefrtwmoxg", max_size=200))
    def test_nothing_that_looks_like_it_raises(self, text: str) -> None:
        talk(b"< open a >", text.encode("ascii"))


@pytest.mark.slow
@given(st.lists(FRAMES), st.booleans(), st.data())
def test_splitting_changes_nothing(frames: list[Frame], junk: bool, data: st.DataObject) -> None:
    sends = [f"< send {f.cob_id:x} {len(f.data)} {f.data.hex(' ')} >".encode("ascii") for f in frames]
    text = OPENED + b"".join(sends) + (b"< nonsense >" if junk else b"")
    cuts = sorted(data.draw(st.lists(st.integers(0, len(text)))))
    pieces = [text[a:b] for a, b in zip([0, *cuts], [*cuts, len(text)], strict=True)]
    split, whole = talk(*pieces), talk(text)
    assert split[1] == whole[1] == frames
    assert split[0].outbox == whole[0].outbox
    assert split[0].mode is whole[0].mode is (SessionMode.CLOSED if junk else SessionMode.RAW)


@given(st.binary(max_size=600), st.data())
def test_splitting_junk_changes_nothing_either(junk: bytes, data: st.DataObject) -> None:
    cut = data.draw(st.integers(0, len(junk)))
    split, whole = talk(OPENED + junk[:cut], junk[cut:]), talk(OPENED + junk)
    assert split[1] == whole[1]
    assert (split[0].outbox, split[0].complaint) == (whole[0].outbox, whole[0].complaint)


class TestAgainstPythonCan:
    @given(FRAMES)
    def test_we_understand_what_it_sends(self, frame: Frame) -> None:
        message = Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        text = convert_can_message_to_ascii_message(message)
        assert talk(OPENED, text.encode("ascii"))[1] == [frame]

    @given(FRAMES, st.integers(0, 1 << 51))
    def test_it_understands_what_we_send(self, frame: Frame, time_us: int) -> None:
        message = convert_ascii_message_to_can_message(frame_text(frame, time_us).decode("ascii"))
        assert (message.arbitration_id, bytes(message.data)) == frame
        assert not message.is_extended_id
        assert message.timestamp == pytest.approx(time_us / 1e6)


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
    client.send(b"< send 18FF1234 0 >< sendrtr 18FF1234 0 >")
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


@pytest.mark.slow
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


@pytest.mark.slow
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
