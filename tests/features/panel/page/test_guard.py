"""The guard before the page: who is let in on the page, on polling and on the web socket, and how much is read."""

import asyncio
from collections.abc import Iterable

import pytest
from starlette.types import Message, Receive, Scope, Send

from steptwin.features.panel.page.guard import BODY_BYTES_MAX, Guard, PageAccess, local_access, remote_access

LOCAL = local_access(8090)
OURS = ("127.0.0.1:8090", "localhost:8090", "[::1]:8090", "LOCALHOST:8090")
FOREIGN = ("evil.example:8090", "127.0.0.1:8091", "127.0.0.1", "", "127.0.0.1.evil.example:8090")
PATHS = (("http", "/"), ("http", "/_nicegui_ws/socket.io/"), ("websocket", "/_nicegui_ws/socket.io/"))


class App:
    """An application that reads the whole body and answers 200; it remembers what has reached it."""

    def __init__(self) -> None:
        self.scopes: list[Scope] = []
        self.bytes = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.scopes.append(scope)
        if scope["type"] == "websocket":
            await send({"type": "websocket.accept"})
            return
        more = True
        while more:
            message = await receive()
            self.bytes += len(message.get("body", b""))
            more = message.get("more_body", False)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"the page"})


def answer_of(
    access: PageAccess,
    kind: str = "http",
    path: str = "/",
    query: str = "",
    body: Iterable[bytes] = (b"",),
    **headers: str,
) -> tuple[Message, App]:
    """Return the first message with which the guard answers, and the application behind it."""
    app, sent, parts = App(), list[Message](), list(body)
    received = [{"type": "http.request", "body": part, "more_body": i < len(parts) - 1} for i, part in enumerate(parts)]
    if kind == "websocket":
        received = [{"type": "websocket.connect"}]

    async def receive() -> Message:
        return received.pop(0)

    async def send(message: Message) -> None:
        sent.append(message)

    scope = {
        "type": kind,
        "path": path,
        "raw_path": path.encode(),
        "query_string": query.encode(),
        "headers": [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()],
    }
    asyncio.run(Guard(app, access)(scope, receive, send))
    return sent[0], app


def let_in(message: Message) -> bool:
    return message["type"] == "websocket.accept" or message.get("status") == 200


def header(message: Message, name: bytes) -> bytes:
    headers: dict[bytes, bytes] = dict(message["headers"])
    return headers[name]


@pytest.mark.parametrize(("kind", "path"), PATHS)
class TestOnThisMachine:
    @pytest.mark.parametrize("host", OURS)
    def test_its_own_addresses_are_let_in(self, kind: str, path: str, host: str) -> None:
        assert let_in(answer_of(LOCAL, kind, path, host=host)[0])
        assert let_in(answer_of(LOCAL, kind, path, host=host, origin=f"http://{host}")[0])

    @pytest.mark.parametrize("host", FOREIGN)
    def test_another_name_is_refused(self, kind: str, path: str, host: str) -> None:
        """A name of another site that points to 127.0.0.1, as in DNS rebinding."""
        message, app = answer_of(LOCAL, kind, path, host=host, origin=f"http://{host}")
        assert not let_in(message)
        assert not app.scopes

    @pytest.mark.parametrize(
        "origin", ["http://evil.example", "null", "http://127.0.0.1:8091", "https://127.0.0.1", ""]
    )
    def test_another_site_is_refused(self, kind: str, path: str, origin: str) -> None:
        message, app = answer_of(LOCAL, kind, path, host="127.0.0.1:8090", origin=origin)
        assert not let_in(message)
        assert not app.scopes


class TestFromOtherMachines:
    ACCESS = remote_access(8090)
    HOST = "robot.lab:8090"

    @pytest.mark.parametrize(("kind", "path"), PATHS)
    def test_the_token_opens_by_a_cookie(self, kind: str, path: str) -> None:
        token = self.ACCESS.token
        assert token is not None
        cookie = f"other=1; {self.ACCESS.cookie}={token}"
        assert let_in(answer_of(self.ACCESS, kind, path, host=self.HOST, cookie=cookie)[0])
        for wrong in (
            "",
            f"{self.ACCESS.cookie}=",
            f"{self.ACCESS.cookie}={token}x",
            f"steptwin_1={token}",
            "a;;=\x7f",
        ):
            message, app = answer_of(self.ACCESS, kind, path, host=self.HOST, cookie=wrong)
            assert not let_in(message), wrong
            assert not app.scopes
        message, _ = answer_of(self.ACCESS, kind, path, host=self.HOST, cookie=cookie, origin="http://evil.example")
        assert not let_in(message)

    def test_the_token_in_the_address_becomes_a_cookie(self) -> None:
        message, app = answer_of(self.ACCESS, query=f"a=1&token={self.ACCESS.token}", host=self.HOST)
        assert (message["status"], header(message, b"location")) == (303, b"/?a=1")
        cookie = header(message, b"set-cookie").decode()
        assert cookie == f"{self.ACCESS.cookie}={self.ACCESS.token}; Path=/; HttpOnly; SameSite=Lax"
        assert not app.scopes

    def test_the_address_never_leads_elsewhere(self) -> None:
        message, _ = answer_of(self.ACCESS, path="//evil.example", query=f"token={self.ACCESS.token}", host=self.HOST)
        assert header(message, b"location") == b"/evil.example"

    @pytest.mark.parametrize("query", ["", "token=", "token=wrong", "token=%00"])
    def test_a_wrong_token_opens_nothing(self, query: str) -> None:
        message, app = answer_of(self.ACCESS, query=query, host=self.HOST)
        assert message["status"] == 403
        assert not app.scopes

    def test_each_start_has_its_own_token(self) -> None:
        tokens = {remote_access(8090).token for _ in range(3)}
        assert len(tokens) == 3
        assert all(len(token or "") >= 32 for token in tokens)


class TestBodies:
    HOST = "127.0.0.1:8090"

    @pytest.mark.parametrize(("length", "status"), [(BODY_BYTES_MAX, 200), (BODY_BYTES_MAX + 1, 413)])
    def test_the_length_that_is_announced(self, length: int, status: int) -> None:
        message, app = answer_of(LOCAL, host=self.HOST, content_length=str(length))
        assert message["status"] == status
        assert bool(app.scopes) == (status == 200)

    @pytest.mark.parametrize("length", ["-1", "1e3", "x", "9" * 5000])
    def test_a_length_that_is_none_is_refused(self, length: str) -> None:
        assert answer_of(LOCAL, host=self.HOST, content_length=length)[0]["status"] == 413

    @pytest.mark.parametrize(("more", "status"), [(0, 200), (1, 413)])
    def test_the_length_that_comes(self, more: int, status: int) -> None:
        """A body in chunks has no length; it is cut off where it becomes too long."""
        chunk = BODY_BYTES_MAX // 4
        message, app = answer_of(LOCAL, host=self.HOST, body=[b"x" * chunk] * 4 + [b"x" * more])
        assert message["status"] == status
        assert app.bytes <= BODY_BYTES_MAX


def test_no_other_site_may_frame_the_page() -> None:
    message, _ = answer_of(LOCAL, host="localhost:8090")
    assert header(message, b"x-frame-options") == b"DENY"
    assert header(message, b"content-security-policy") == b"frame-ancestors 'none'"
    assert header(message, b"referrer-policy") == b"no-referrer"
