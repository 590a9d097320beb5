"""What reaches the libraries of the page's server: packets as a page sends them, and nothing else."""

import asyncio
import json
import logging
import sys
from types import SimpleNamespace
from typing import Any

import pytest
from nicegui import Client
from starlette.types import Message

from steptwin.features.panel.page.guard import is_connection, is_packet, only_packets, packets_of
from steptwin.features.panel.page.server import OneLine

CLIENT = "796e3dbc-de75-4c48-862d-08fc6ca8be89"
SENT: dict[str, dict[str, Any]] = {
    "handshake": {"client_id": CLIENT, "tab_id": "t", "document_id": "d", "old_tab_id": None, "next_message_id": 3},
    "event": {"client_id": CLIENT, "id": 7, "listener_id": "heard", "args": ['{"value": 1}', None]},
    "javascript_response": {"client_id": CLIENT, "request_id": "r", "result": [1]},
    "ack": {"client_id": CLIENT, "next_message_id": 12},
    "log": {"client_id": CLIENT, "level": "error", "message": "x is undefined\n\tat y"},
}


@pytest.fixture(autouse=True)
def _page(monkeypatch: pytest.MonkeyPatch) -> None:
    element = SimpleNamespace(_event_listeners={"heard": None})
    monkeypatch.setitem(Client.instances, CLIENT, SimpleNamespace(elements={7: element}))


def _event(name: str, *data: object, number: str = "") -> str:
    return f"42{number}{json.dumps([name, *data])}"


@pytest.mark.parametrize("name", SENT)
def test_what_a_page_sends_passes(name: str) -> None:
    assert is_packet(_event(name, SENT[name]))
    assert is_packet(_event(name, SENT[name] | {"shown": 3}, number="17"))


@pytest.mark.parametrize("packet", ["1", "2", "2probe", "3", "5", "40", "40{}", "41"])
def test_packets_without_an_event_pass(packet: str) -> None:
    assert is_packet(packet)


def test_a_stop_of_the_panel_is_never_held_back() -> None:
    for data in ((), ("17-x",), (None,), ({"press": 1},)):
        assert is_packet(_event("emergency_stop", *data))


@pytest.mark.parametrize(
    "packet",
    ["", "4", "42", "42[", "42[]", "42{}", "42[1]", "43[]", "44", "45-", "6x", "9", "b!!!", "42/x,[]", '451-["event"]',
     '42["event",NaN]', "42[" + "[" * 5000, '42["event"]', '42["event",1,2,3]', '42["a",1,2]', '42["connect",{}]',
     '42["disconnect"]', "42" + "9" * 20 + '["a"]', '42["log","' + "x" * 1_000_000 + '"]'],
)  # fmt: skip
def test_junk_does_not(packet: str) -> None:
    assert not is_packet(packet)


NAMES: tuple[Any, ...] = (None, True, 1, 0.5, [], {}, "x" * 101)
NUMBERS: tuple[Any, ...] = (None, True, -1, 0.5, 1 << 54, [], {}, "x", "-1")
WRONG: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys(("client_id", "tab_id", "document_id", "listener_id", "request_id"), NAMES),
    "old_tab_id": NAMES[1:],
    "next_message_id": NUMBERS[1:],
    "id": NUMBERS,
    "args": (None, 1, "x", {}, [1], ["{"], ["NaN"], ["[" * 5000]),
    "level": (None, 1, "fatal", [], {}),
    "message": (None, 1, [], "\x1b[31m", "\x00"),
}
"""Values that no page sends."""


@pytest.mark.parametrize(("name", "field"), [(name, field) for name in SENT for field in WRONG if field in SENT[name]])
def test_no_field_may_be_junk(name: str, field: str) -> None:
    for value in WRONG[field]:
        assert not is_packet(_event(name, SENT[name] | {field: value})), value
    if field not in ("old_tab_id", "next_message_id") or name == "ack":
        assert not is_packet(_event(name, {key: value for key, value in SENT[name].items() if key != field}))


def test_an_event_for_another_element_does_not_pass() -> None:
    assert not is_packet(_event("event", SENT["event"] | {"listener_id": "another's"}))
    assert is_packet(_event("event", SENT["event"] | {"id": 8, "listener_id": "another's"}))  # it was just deleted


def test_a_web_socket_receives_packets_only() -> None:
    messages: list[Message] = [
        {"type": "websocket.connect"},
        {"type": "websocket.receive", "text": "42["},
        {"type": "websocket.receive", "bytes": b"\x00"},
        {"type": "websocket.receive", "text": "2"},
        {"type": "websocket.disconnect"},
    ]

    async def receive() -> Message:
        return messages.pop(0)

    async def received() -> list[Message]:
        return [await only_packets(receive)() for _ in range(3)]

    assert [message["type"] for message in asyncio.run(received())] == [
        "websocket.connect",
        "websocket.receive",
        "websocket.disconnect",
    ]


@pytest.mark.parametrize(
    ("parts", "passes"),
    [
        ((b"2\x1e3",), True),
        ((b'42["stop"', b"]\x1e1"), True),
        ((b"2\x1e",), False),
        ((b"\xff",), False),
        ((b"42[",), False),
    ],
)
def test_a_request_brings_packets_only(parts: tuple[bytes, ...], passes: bool) -> None:
    messages: list[Message] = [
        {"type": "http.request", "body": part, "more_body": number < len(parts)} for number, part in enumerate(parts, 1)
    ]

    async def receive() -> Message:
        return messages.pop(0) if messages else {"type": "http.disconnect"}

    async def body() -> bytes | None:
        again = await packets_of(receive)
        return None if again is None else (await again())["body"]

    assert asyncio.run(body()) == (b"".join(parts) if passes else None)


@pytest.mark.parametrize(
    ("query", "is_one"),
    [
        ("EIO=4&transport=websocket", True),
        (f"implicit_handshake=true&client_id={CLIENT}&tab_id=t&document_id=d&next_message_id=0", True),
        (f"implicit_handshake=true&client_id={CLIENT}&tab_id=t&next_message_id=0", False),
        (f"implicit_handshake=true&client_id={CLIENT}&tab_id=t&document_id=d&next_message_id=x", False),
    ],
)
def test_a_connection_has_what_is_read_of_it(query: str, is_one: bool) -> None:
    assert is_connection({"query_string": query.encode()}) is is_one


def test_what_an_event_raises_is_told_in_a_line() -> None:
    try:
        int("x\x1b\n")
    except ValueError:
        record = logging.LogRecord("nicegui", logging.ERROR, "", 0, "%s", ("junk",), sys.exc_info())
    line = OneLine().format(record)
    assert line.startswith("steptwin: panel: ValueError: invalid literal for int()")
    assert "(in test_what_an_event_raises_is_told_in_a_line, test_frames.py:" in line
    assert line.isprintable()
