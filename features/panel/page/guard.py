"""Keep other sites, other machines and oversized uploads away from a page that moves a machine.

A browser sends its cookies and opens web sockets for any site that it shows. So every site that the user visits can
reach a page on 127.0.0.1: by a request of that site (the Origin header tells), or by a name of that site that points to
127.0.0.1 (DNS rebinding; the Host header tells). The guard is pure ASGI, since Starlette's BaseHTTPMiddleware does not
see web sockets.

A page sends engine.io packets, most of them socket.io events with one JSON object each. The libraries accept any packet
as one of their own script, and print a traceback for every other one.
"""

import re
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final
from urllib.parse import parse_qsl, urlencode

from nicegui import Client, json
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SOCKET_PATH: Final = "/_nicegui_ws/"
"""Path of the packets: messages of a web socket, or bodies of requests with several packets in one."""
_BETWEEN_PACKETS: Final = "\x1e"
_CONTROL: Final = frozenset(("1", "2", "2probe", "3", "3probe", "5", "6", "40", "40{}", "41"))
"""Packets without an event: close, ping, pong, upgrade, no operation; connect and disconnect."""
_EVENT: Final = re.compile(r"42\d{0,9}(\[.*\])", re.DOTALL)
"""An event, with or without the number of its acknowledgement."""
_CHARS_MAX: Final = 1_000_000
"""Longest packet in characters; the libraries accept no more."""
_ID_MAX: Final = 1 << 53
_NAME_CHARS_MAX: Final = 100
_RESERVED: Final = ("connect", "disconnect")
"""Names of the libraries' own events."""
_LEVELS: Final = ("debug", "info", "warning", "error")

_Check = Callable[[object], bool]


def _is_name(value: object) -> bool:
    return isinstance(value, str) and len(value) <= _NAME_CHARS_MAX


def _is_number(value: object) -> bool:
    """Return whether a value is a whole number from 0 to _ID_MAX, or its digits, as in a query."""
    if isinstance(value, str):
        return value.isascii() and value.isdecimal() and len(value) <= len(str(_ID_MAX))
    return type(value) is int and 0 <= value <= _ID_MAX


def _is_printed(value: object) -> bool:
    return isinstance(value, str) and all(char.isprintable() or char in "\n\t" for char in value)


def _are_arguments(value: object) -> bool:
    return isinstance(value, list) and all(
        text is None or (isinstance(text, str) and _parsed(text) is not _NO_JSON) for text in value
    )


def _or_nothing(check: _Check, value: object) -> bool:
    return value is None or check(value)


_HANDSHAKE: Final[Mapping[str, _Check]] = {
    "client_id": _is_name,
    "tab_id": _is_name,
    "document_id": _is_name,
    "old_tab_id": partial(_or_nothing, _is_name),
    "next_message_id": partial(_or_nothing, _is_number),
}
_FIELDS: Final[Mapping[str, Mapping[str, _Check]]] = {
    "handshake": _HANDSHAKE,
    "event": {"client_id": _is_name, "id": _is_number, "listener_id": _is_name, "args": _are_arguments},
    "javascript_response": {"client_id": _is_name, "request_id": _is_name},
    "ack": {"client_id": _is_name, "next_message_id": lambda value: type(value) is int and _is_number(value)},
    "log": {"client_id": _is_name, "level": lambda value: value in _LEVELS, "message": _is_printed},
}
"""Fields of each event; a field that may be null may be missing."""

_NO_JSON: Final = object()


def _parsed(text: str) -> Any:
    """Return the value of a JSON text as the libraries parse it; _NO_JSON for any other text."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return _NO_JSON


def is_packet(text: str) -> bool:
    """Return whether a packet is one that a page sends."""
    if text in _CONTROL:
        return True
    event = _EVENT.fullmatch(text) if len(text) <= _CHARS_MAX else None
    match _parsed(event[1]) if event else None:
        case [str(name), dict(data)] if name in _FIELDS:
            fits = all(check(data.get(field)) for field, check in _FIELDS[name].items())
            return fits and (name != "event" or _is_listened_to(data))
        case [str(name)] | [str(name), _]:  # events of the panel itself, such as a stop, must always pass
            return name not in _FIELDS and name not in _RESERVED
    return False


def _is_listened_to(event: Mapping[str, Any]) -> bool:
    """Return whether an event's element waits for it; events of elements just deleted are left to the libraries."""
    client = Client.instances.get(event["client_id"])
    element = None if client is None else client.elements.get(event["id"])
    return element is None or event["listener_id"] in element._event_listeners  # noqa: SLF001 - nothing public tells


def is_connection(scope: Scope) -> bool:
    """Return whether a request for a connection has all values that the server reads."""
    query = dict(parse_qsl(scope["query_string"].decode("latin-1")))
    if query.get("implicit_handshake") != "true":
        return True
    return all(check(query.get(field)) for field, check in _HANDSHAKE.items())


def only_packets(receive: Receive) -> Receive:
    """Return a receive function for a web socket that drops invalid packets."""

    async def receive_packet() -> Message:
        while True:
            message = await receive()
            if message["type"] != "websocket.receive" or is_packet(message.get("text") or ""):
                return message

    return receive_packet


async def packets_of(receive: Receive) -> Receive | None:
    """Read the body of a request; return a function that receives it again, or None if it has invalid packets."""
    body, more = b"", True
    while more:
        message = await receive()
        if message["type"] != "http.request":
            return None
        body, more = body + message.get("body", b""), message.get("more_body", False)
    try:
        packets = body.decode().split(_BETWEEN_PACKETS)
    except UnicodeDecodeError:
        return None
    if not all(map(is_packet, packets)):
        return None
    read = False

    async def receive_again() -> Message:
        nonlocal read
        if read:
            return await receive()
        read = True
        return {"type": "http.request", "body": body}

    return receive_again


BODY_BYTES_MAX: Final = 10_000_000
"""Largest body of a request: an uploaded trajectory or program."""

TOKEN: Final = "token"
"""Name of the query parameter for the token in the printed URL."""

_DIGITS_MAX: Final = 12
"""Most digits of an accepted length; Python refuses to convert thousands of them."""

_HEADERS: Final = (
    (b"x-frame-options", b"DENY"),  # a button in another site's frame could be held by a deceived operator
    (b"content-security-policy", b"frame-ancestors 'none'"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
)


class _TooLargeError(Exception):
    """A body without a length is too large."""


@dataclass(frozen=True, slots=True)
class PageAccess:
    """Access to the page.

    Attributes:
        hosts: accepted values of the Host header, such as "127.0.0.1:8090"; None accepts any, which needs a token.
        token: secret that a browser must have sent once; None where only this machine reaches the page.
        port: TCP port of the page; part of the cookie's name, since cookies do not distinguish ports.
    """

    hosts: frozenset[str] | None
    token: str | None
    port: int

    @property
    def cookie(self) -> str:
        """Name of the cookie that holds the token."""
        return f"steptwin_{self.port}"


def local_access(port: int, *addresses: str) -> PageAccess:
    """Return the access of a page that only this machine reaches, at its loopback addresses."""
    names = {"127.0.0.1", "localhost", "[::1]", *addresses}
    return PageAccess(frozenset(f"{name}:{port}" for name in names), None, port)


def remote_access(port: int) -> PageAccess:
    """Return the access of a page for other machines, with a new random token."""
    return PageAccess(None, secrets.token_urlsafe(24), port)


class Guard:
    """ASGI middleware that refuses requests from elsewhere, on the page, on polling and on the web socket."""

    def __init__(self, app: ASGIApp, access: PageAccess) -> None:
        self.app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, exchange its token for a cookie, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refusal = self._foreign(headers)
        if refusal:
            await _refuse(scope, receive, send, 403, refusal)
        elif scope["type"] == "http" and self._is_token(_query(scope).get(TOKEN, "")):
            await _answer(send, 303, "", [(b"location", _without_token(scope)), (b"set-cookie", self._cookie())])
        elif not self._knows(headers):
            await _refuse(scope, receive, send, 403, "open the address that was printed when the panel was started")
        elif _length(headers) > BODY_BYTES_MAX:
            await _refuse(scope, receive, send, 413, f"more than {BODY_BYTES_MAX} bytes")
        elif scope["path"].startswith(SOCKET_PATH) and not is_connection(scope):
            await _refuse(scope, receive, send, 400, "this is not what a page asks")
        else:
            await self._pass_on(scope, receive, send)

    async def _pass_on(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request to the page; refuse a body that is too large, and a socket's body with invalid packets."""
        if scope["type"] == "websocket":
            await self.app(scope, only_packets(receive), send)
            return
        answered = False

        async def marked(message: Message) -> None:
            nonlocal answered
            if message["type"] == "http.response.start":
                answered = True
                message = {**message, "headers": [*message.get("headers", ()), *_HEADERS]}
            await send(message)

        body: Receive | None = _limited(receive)
        try:
            if scope.get("method") == "POST" and scope["path"].startswith(SOCKET_PATH):
                body = await packets_of(_limited(receive))
            if body is None:
                await _answer(send, 400, "this is not what a page sends")
            else:
                await self.app(scope, body, marked)
        except _TooLargeError:
            if not answered:
                await _answer(send, 413, f"more than {BODY_BYTES_MAX} bytes")

    def _foreign(self, headers: Headers) -> str | None:
        """Return why a request comes from elsewhere; None if it is ours."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if self._access.hosts is not None and host.lower() not in self._access.hosts:
            return "this page has another address"
        if origin is not None and origin.lower() not in (f"http://{host.lower()}", f"https://{host.lower()}"):
            return "the request comes from another site"
        return None

    def _knows(self, headers: Headers) -> bool:
        if self._access.token is None:
            return True
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self._access.cookie)
        except CookieError:
            return False
        return cookie is not None and self._is_token(cookie.value)

    def _is_token(self, given: str) -> bool:
        token = self._access.token
        return token is not None and secrets.compare_digest(given.encode(), token.encode())

    def _cookie(self) -> bytes:
        """Return the cookie; SameSite=Lax lets a link in a mail open the page, but strips other sites' requests."""
        return f"{self._access.cookie}={self._access.token}; Path=/; HttpOnly; SameSite=Lax".encode()


def _length(headers: Headers) -> int:
    text = headers.get("content-length", "0")
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= _DIGITS_MAX else BODY_BYTES_MAX + 1


def _limited(receive: Receive) -> Receive:
    """Return a receive function limited to BODY_BYTES_MAX of a body."""
    received_bytes = 0

    async def receive_limited() -> Message:
        nonlocal received_bytes
        message = await receive()
        received_bytes += len(message.get("body", b""))
        if received_bytes > BODY_BYTES_MAX:
            raise _TooLargeError
        return message

    return receive_limited


def _query(scope: Scope) -> Mapping[str, str]:
    return dict(parse_qsl(scope["query_string"].decode("latin-1")))


def _without_token(scope: Scope) -> bytes:
    """Return the address of a request without its token, which keeps the token out of the browser's history."""
    rest = {name: value for name, value in _query(scope).items() if name != TOKEN}
    path: bytes = scope.get("raw_path") or b"/"
    path = b"/" + path.lstrip(b"/")  # "//host" would lead to another host
    return path + (b"?" + urlencode(rest).encode() if rest else b"")


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "http":
        await _answer(send, status, f"steptwin panel: {reason}\n")
        return
    await receive()  # closing a web socket after its connect message makes the server answer 403
    await send({"type": "websocket.close", "code": 1008, "reason": reason})


async def _answer(send: Send, status: int, text: str, headers: list[tuple[bytes, bytes]] | None = None) -> None:
    body = text.encode()
    fixed = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode()), *_HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": [*fixed, *(headers or [])]})
    await send({"type": "http.response.body", "body": body})
