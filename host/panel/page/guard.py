"""Keep other sites, other machines and oversized uploads away from a page that moves a machine.

A browser sends its cookies and opens web sockets for any site that it shows, so a page on 127.0.0.1 is within reach of
every site that its user visits: by a request of that site (the Origin header tells), or by a name of that site that
points to 127.0.0.1 (DNS rebinding; the Host header tells). The guard is pure ASGI, since Starlette's BaseHTTPMiddleware
lets web sockets pass unseen.
"""

import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Final
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

BODY_BYTES_MAX: Final = 10_000_000
"""Largest body of a request: an uploaded trajectory or program."""

TOKEN: Final = "token"
"""Name of the query's parameter that holds the token, in the URL that the command prints."""

_DIGITS_MAX: Final = 12
"""More digits than any length that is accepted; Python refuses to convert thousands of them."""

_HEADERS: Final = (
    (b"x-frame-options", b"DENY"),  # a button in another site's frame could be held by a deceived operator
    (b"content-security-policy", b"frame-ancestors 'none'"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
)


class _TooLargeError(Exception):
    """A body without a length turned out to be too large."""


@dataclass(frozen=True, slots=True)
class Access:
    """Who may use the page.

    Attributes:
        hosts: values of the Host header that are ours, such as "127.0.0.1:8090"; None accepts any, which needs a token.
        token: secret that a browser must have brought once; None where only this machine reaches the page.
        port: TCP port of the page. Cookies do not tell ports apart, so the cookie's name does.
    """

    hosts: frozenset[str] | None
    token: str | None
    port: int

    @property
    def cookie(self) -> str:
        """Name of the cookie that holds the token."""
        return f"steptwin_{self.port}"


def local_access(port: int, *addresses: str) -> Access:
    """Return the access of a page that only this machine reaches, at its loopback addresses."""
    names = {"127.0.0.1", "localhost", "[::1]", *addresses}
    return Access(frozenset(f"{name}:{port}" for name in names), None, port)


def remote_access(port: int) -> Access:
    """Return the access of a page that other machines reach, by a new random token."""
    return Access(None, secrets.token_urlsafe(24), port)


class Guard:
    """ASGI middleware that refuses requests from elsewhere, on the page, on polling and on the web socket."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
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
        elif self._brings_token(scope):
            await _answer(send, 303, "", [(b"location", _without_token(scope)), (b"set-cookie", self._cookie())])
        elif not self._knows(headers):
            await _refuse(scope, receive, send, 403, "open the address that was printed when the panel was started")
        elif _length(headers) > BODY_BYTES_MAX:
            await _refuse(scope, receive, send, 413, f"more than {BODY_BYTES_MAX} bytes")
        else:
            await self._pass_on(scope, receive, send)

    async def _pass_on(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await self.app(scope, receive, send)
            return
        answered = False

        async def marked(message: Message) -> None:
            nonlocal answered
            if message["type"] == "http.response.start":
                answered = True
                message = {**message, "headers": [*message.get("headers", ()), *_HEADERS]}
            await send(message)

        try:
            await self.app(scope, _limited(receive), marked)
        except _TooLargeError:
            if not answered:
                await _answer(send, 413, f"more than {BODY_BYTES_MAX} bytes")

    def _foreign(self, headers: Headers) -> str | None:
        """Return why a request comes from elsewhere; None if it does not."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if self._access.hosts is not None and host.lower() not in self._access.hosts:
            return "this page has another address"
        if origin is not None and origin.lower() not in (f"http://{host.lower()}", f"https://{host.lower()}"):
            return "the request comes from another site"
        return None

    def _brings_token(self, scope: Scope) -> bool:
        given = _query(scope).get(TOKEN)
        return scope["type"] == "http" and given is not None and self._is_token(given)

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
        """Return the cookie; with SameSite=Lax a link in a mail opens the page, but other sites' requests are bare."""
        return f"{self._access.cookie}={self._access.token}; Path=/; HttpOnly; SameSite=Lax".encode()


def _length(headers: Headers) -> int:
    """Return the length that a request gives for its body, 0 without one."""
    text = headers.get("content-length", "0")
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= _DIGITS_MAX else BODY_BYTES_MAX + 1


def _limited(receive: Receive) -> Receive:
    """Return a function that receives as the given one, up to BODY_BYTES_MAX of a body."""
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
    """Return the address of a request without its token, so that the token does not stay in the browser's history."""
    rest = {name: value for name, value in _query(scope).items() if name != TOKEN}
    path: bytes = scope.get("raw_path") or b"/"
    path = b"/" + path.lstrip(b"/")  # "//host" would lead elsewhere
    return path + (b"?" + urlencode(rest).encode() if rest else b"")


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "http":
        await _answer(send, status, f"steptwin panel: {reason}\n")
        return
    await receive()  # a web socket is closed after its connect message, which the server answers by 403
    await send({"type": "websocket.close", "code": 1008, "reason": reason})


async def _answer(send: Send, status: int, text: str, headers: list[tuple[bytes, bytes]] | None = None) -> None:
    body = text.encode()
    fixed = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode()), *_HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": [*fixed, *(headers or [])]})
    await send({"type": "http.response.body", "body": body})
