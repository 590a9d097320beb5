"""Requests in JSON lines: whatever bytes come, in whatever pieces, they are requests, or they end the session."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.live.control_server import LINE_MAX_BYTES, JsonLineSession
from tests.one_example import one_example

NO_OBJECT = 'the line is not a JSON object, such as {"do": "state"}'
PIECES = st.one_of(
    st.binary(max_size=40),
    st.sampled_from([b'{"do": "state"}', b"\n", b"\r\n", b"{", b"[" * 900, b'"' * 2, b"1e999", b"9" * 900, b" " * 500]),
)


def heard(*pieces: bytes) -> tuple[list[dict[str, object]], JsonLineSession]:
    """Return the requests in bytes that come piece by piece, and the session."""
    session = JsonLineSession()
    requests = []
    for piece in pieces:
        session.feed(piece)
        while (request := session.next_request()) is not None:
            requests.append(request)
    return requests, session


def test_a_line_is_a_request() -> None:
    requests, session = heard(b'{"do": "st', b'ate"}\r\n\n  \n{}\n{"a"', b": 1}")
    assert requests == [{"do": "state"}, {}]
    assert not session.closed
    session.answer({"name": "\u00e9\n"})
    assert session.outbox == b'{"name": "\\u00e9\\n"}\n'


@pytest.mark.parametrize(
    "junk",
    [
        b"POST / HTTP/1.1",
        b"< open vcan0 >",
        b"[]",
        b"null",
        b'{"do": NaN}',
        b'{"do": -Infinity}',
        b'{"do": "state"} {}',
        b'{"do": \xff}',
        '{"do": "state"}'.encode("utf-16"),
        b"[" * 1000,
        b'{"a":' * 200,
        b"9" * 1000,
    ],
)
def test_junk_closes_the_session_and_hides_what_follows(junk: bytes) -> None:
    """So the body of an HTTP request is never looked at, whatever a web page puts there."""
    requests, session = heard(junk + b'\nHost: 127.0.0.1\n\n{"do": "estop", "pressed": true}\n', b'{"do": "state"}\n')
    assert requests == []
    assert session.closed
    assert json.loads(session.outbox) == {"error": NO_OBJECT}


@pytest.mark.parametrize(("length", "closed"), [(LINE_MAX_BYTES, False), (LINE_MAX_BYTES + 1, True)])
@pytest.mark.parametrize("end", [b"\n", b""], ids=["whole", "without an end"])
def test_a_line_has_a_greatest_length(length: int, closed: bool, end: bytes) -> None:
    line = b'{"a": "' + b"x" * (length - 9) + b'"}'
    requests, session = heard(line + end)
    assert len(line) == length
    assert session.closed == closed
    assert len(requests) == (bool(end) and not closed)
    if closed:
        assert json.loads(session.outbox) == {"error": "the line has more than 1024 bytes"}


@pytest.mark.slow
@given(st.lists(PIECES, max_size=20))
def test_pieces_do_not_matter(pieces: list[bytes]) -> None:
    apart, one_by_one = heard(*pieces)
    together, at_once = heard(b"".join(pieces))
    assert apart == together
    assert all(isinstance(request, dict) for request in apart)
    assert (one_by_one.closed, one_by_one.outbox) == (at_once.closed, at_once.outbox)
    assert bool(at_once.outbox) == at_once.closed


def test_some_pieces_do_not_matter() -> None:
    one_example(test_pieces_do_not_matter, [b'{"do": ', b'"state"}', b"\r\n", b"[1]\n{", b"}", b"\n\n", b"1e999"])
    one_example(test_pieces_do_not_matter, [b'{"do": "state"}\n', b"[" * 900, b" " * 500, b"\n{}"])
