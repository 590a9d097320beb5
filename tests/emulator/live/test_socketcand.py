"""The dialogue with one client, byte by byte: its commands, the answers, and that no input raises an error."""

import pytest
from can import Message
from can.interfaces.socketcand.socketcand import (
    convert_ascii_message_to_can_message,
    convert_can_message_to_ascii_message,
)
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.live.socketcand import COMMAND_MAX, SessionMode, SocketcandSession, frame_text
from steptwin.protocol.frame import Frame

OPENED = b"< open vcan0 >< rawmode >"
FRAMES = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))


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
        "foreign", [b"< send 18FF1234 2 1 2 >", b"< sendrtr 123 0 >", b"< fdsend 123 0 12 0 0 0 0 0 0 0 0 0 0 0 0 >"]
    )
    def test_frames_of_other_kinds_are_dropped_and_counted(self, foreign: bytes) -> None:
        """python-can takes an error message for a broken connection, so it is told nothing."""
        session, frames = talk(OPENED, foreign, b"< send 1 0 >")
        assert session.outbox == b"< hi >< ok >< ok >"
        assert session.foreign_frames == 1
        assert frames == [Frame(1, b"")]


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
