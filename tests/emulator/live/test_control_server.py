"""The server of the control port on the loopback: its clients take turns, and none of them holds the board up."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import chain

import pytest

from steptwin.emulator.live.control_server import Answer, ControlServer
from steptwin.emulator.live.live_simulation import LiveSimulation
from steptwin.emulator.live.tcp_server import BACKLOG_MAX_BYTES
from tests.emulator.live.live_rig import TIMEOUT_S, LiveRig, await_true


class Rig:
    """A live board with a control port; requests are answered with their number, and refused if they say so."""

    def __init__(self, live: LiveRig) -> None:
        self.live = live
        self.served_at: list[int] = []
        """Instant of each request, in counts."""
        self.pass_of: list[int] = []
        """Number of the loop's turn in which each request was done."""
        self._turns = 0
        self._open = ExitStack()
        listener = socket.create_server(("127.0.0.1", 0))
        self.port = listener.getsockname()[1]
        self.server = ControlServer(live.loop, listener, self._handle)
        advance = live.live.advance

        def counted(now_ns: int) -> None:
            self._turns += 1
            advance(now_ns)

        live.live.advance = counted  # type: ignore[method-assign]

    def _handle(self, request: dict[str, object]) -> Answer:
        self.served_at.append(self.live.live.simulation.now_counts)
        self.pass_of.append(self._turns)
        if "refuse" in request:
            return {"error": "no"}
        return {"number": len(self.served_at), "filling": "x" * int(str(request.get("bytes", 0)))}

    def client(self) -> socket.socket:
        """Return a connection; it is closed at the end."""
        return self._open.enter_context(socket.create_connection(("127.0.0.1", self.port), timeout=TIMEOUT_S))

    def close(self) -> None:
        self._open.close()


@pytest.fixture
def rig() -> Iterator[Rig]:
    live = LiveRig()
    rig = Rig(live)
    with live:
        yield rig
        closed = threading.Event()
        live.loop.call_soon(rig.server.close)
        live.loop.call_soon(closed.set)
        assert closed.wait(TIMEOUT_S)
        rig.close()


def lines(sock: socket.socket, count: int) -> list[dict[str, object]]:
    """Return the next answers."""
    with sock.makefile("rb") as file:
        return [json.loads(file.readline()) for _ in range(count)]


def test_one_request_a_turn_whosever_it_is(rig: Rig) -> None:
    """Answers come in the order of a client's requests, at instants that never decrease."""
    clients = [rig.client() for _ in range(5)]
    for client in clients:
        client.sendall(b"{}\n" * 20)
    answers = [lines(client, 20) for client in clients]
    numbers = [[int(str(answer["number"])) for answer in of_one] for of_one in answers]
    assert all(of_one == sorted(of_one) for of_one in numbers)
    assert sorted(chain.from_iterable(numbers)) == list(range(1, 101))
    assert rig.served_at == sorted(rig.served_at)
    assert len(set(rig.pass_of)) == 100
    assert (rig.server.requests, rig.server.refused) == (100, 0)


def test_a_refusal_is_counted_and_the_client_stays(rig: Rig) -> None:
    client = rig.client()
    client.sendall(b'{"refuse": 1}\n{}\n')
    assert [("error" in answer) for answer in lines(client, 2)] == [True, False]
    assert (rig.server.requests, rig.server.refused) == (2, 1)


def test_junk_ends_that_connection_only(rig: Rig) -> None:
    """What a client has asked for before is still answered."""
    rude, polite = rig.client(), rig.client()
    rude.sendall(b'{}\nGET / HTTP/1.1\r\n\r\n{"do": "state"}\n')
    with rude.makefile("rb") as file:
        assert [sorted(json.loads(line)) for line in file] == [["filling", "number"], ["error"]]
    polite.sendall(b"{}\n")
    assert lines(polite, 1)[0]["number"] == 2
    assert rig.server.disconnected == {"junk": 1}


def test_one_that_does_not_read_is_disconnected_and_no_one_else(rig: Rig) -> None:
    sleeper, polite = rig.client(), rig.client()
    sleeper.sendall(b'{"bytes": 500000}\n' * (20 * BACKLOG_MAX_BYTES // 500_000))
    await_true(lambda: bool(rig.server.disconnected), "the client is disconnected")
    assert rig.server.disconnected == {"reads too slowly": 1}
    polite.sendall(b"{}\n")
    assert len(lines(polite, 1)) == 1


def test_one_that_hangs_up_has_asked_for_what_it_has_asked_for(rig: Rig) -> None:
    client = rig.client()
    client.sendall(b"{}\n")
    client.close()
    await_true(lambda: rig.server.served == 1 and rig.server.clients == 0, "the client is forgotten")
    assert rig.server.requests == 1


def test_one_more_than_there_may_be(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("steptwin.emulator.live.tcp_server.CLIENTS_MAX", 1)
    first = rig.client()
    first.sendall(b"{}\n")
    lines(first, 1)
    assert lines(rig.client(), 1) == [{"error": "1 clients are connected, no more are served"}]


def test_actions_come_in_order_with_frames_at_their_instant() -> None:
    """Although the simulation stands far behind at that time, because nothing was due on the board."""
    rig = LiveRig()
    live: LiveSimulation = rig.live
    live.start(0, 0)
    live.advance(1_000_000_000)
    seen: list[int] = []
    for at_ns in (1_400_000_000, 1_400_000_001, 1_450_000_000):
        live.call(lambda: seen.append(live.simulation.now_counts), at_ns)
    assert live.due_ns <= 1_400_000_000
    live.advance(1_500_000_000)
    assert seen == [100_800_000, 100_800_000, 104_400_000]
    with rig:
        pass
