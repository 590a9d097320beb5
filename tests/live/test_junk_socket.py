"""Junk at the socket of a panel's server: no traceback, and the page is served as before."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from websockets.sync.client import ClientConnection, connect

from tests.emulator.live.live_rig import TIMEOUT_S
from tests.junk import JUNK

PANEL = [sys.executable, "-m", "steptwin", "panel", "lab-scara", "--connect", "127.0.0.1:1", "--port", "0"]
"""A panel waits for its board: no board is needed here."""
VALUES = [junk for junk in JUNK if isinstance(junk, bool | int | float | str | list | dict | None)]
NAMES = ("event", "javascript_response", "ack", "log", "handshake", "connect", "disconnect", "nosuch", "")


@contextmanager
def _opened(url: str) -> Iterator[tuple[str, ClientConnection]]:
    """Open the page as a browser does, for the block, with its HTML and its socket."""
    with urlopen(url, timeout=TIMEOUT_S) as answer:
        html = answer.read().decode()
    (client,) = re.findall(r"client_id['\"]?:\s*['\"]([0-9a-f-]{36})", html)[:1]
    query = f"client_id={client}&document_id=d&tab_id=t&next_message_id=0&implicit_handshake=true"
    address = url.replace("http", "ws") + f"_nicegui_ws/socket.io/?EIO=4&transport=websocket&{query}"
    with connect(address, max_size=None) as socket:
        assert str(socket.recv(TIMEOUT_S)).startswith("0")
        socket.send("40")
        assert str(socket.recv(TIMEOUT_S)).startswith("40")
        yield html, socket


def _junk(html: str) -> Iterator[str]:
    """Yield packets of junk, and junk in events that elements of the page wait for."""
    (client,) = re.findall(r"client_id['\"]?:\s*['\"]([0-9a-f-]{36})", html)[:1]
    yield from ("", "4", "42[", "43", "44", "45-", "9", "b!!!", '451-["event",{"_placeholder":true,"num":5}]')
    usual: dict[str, Any] = {"client_id": client, "id": 5, "args": [], "listener_id": "x", "request_id": "r"}
    usual |= {"next_message_id": 0, "level": "info", "message": "m", "tab_id": "t", "document_id": "d"}
    for name in NAMES:
        yield f"42{json.dumps([name])}"
        yield f"42{json.dumps([name, 1, 2, 3])}"
        for value in VALUES:
            yield f"42{json.dumps([name, value])}"
            yield from (f"42{json.dumps([name, usual | {field: value}])}" for field in usual)
    for element in (element for element in _elements(html) if not element[2].startswith("sub_pages")):
        number, listener, _ = element
        for value in VALUES:
            event = usual | {"id": number, "listener_id": listener, "args": [json.dumps(value)]}
            yield f"42{json.dumps(['event', event])}"


def _elements(html: str) -> list[tuple[int, str, str]]:
    """Return the number of each element of the page, with the listener and the type of each of its events."""
    (text,) = re.findall(r"parseElements\(String\.raw`(.*?)`\)", html, re.DOTALL)[:1]
    for sign, written in (
        ("&quot;", '"'),
        ("&#36;", "$"),
        ("&#96;", "`"),
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&amp;", "&"),
    ):
        text = text.replace(sign, written)
    elements: dict[str, Any] = json.loads(text)
    return [
        (int(number), event["listener_id"], event["type"])
        for number, element in elements.items()
        for event in element.get("events", ())
    ]


def test_no_junk_ends_in_a_traceback(tmp_path: Path) -> None:
    told = tmp_path / "stderr"
    with told.open("w") as file, subprocess.Popen(PANEL, stdout=subprocess.PIPE, stderr=file, text=True) as process:
        try:
            assert process.stdout
            url = process.stdout.readline().removeprefix("panel: ").strip()
            with _opened(url) as (html, socket):
                packets = list(_junk(html))
                for packet in packets:
                    socket.send(packet)
            with _opened(url):
                before_the_end = told.read_text(encoding="utf-8").splitlines()
        finally:
            process.terminate()  # on a slow computer the server then tells of requests that it has cancelled
            process.wait(TIMEOUT_S)
    assert len(packets) > 2000
    assert [line for line in before_the_end if not line.startswith("steptwin: ")] == []
    assert "Traceback" not in told.read_text(encoding="utf-8")
