"""Whom the answers of one SDO server are to: two programs ask it at once, in thousands of orders of their frames.

The server is the board's. The bus carries one frame at a time; each program hears the frames of the others in the order
of the bus, but may look at them later. Each answer here knows who asked for it, which no answer on a real bus does.
"""

import random
from collections import Counter, deque
from collections.abc import Callable, Generator
from functools import partial

import pytest

from steptwin.controller.node.charge import Charge
from steptwin.host.client.shared_node import OpenRequests, Whose
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.sdo_server import SdoServer

ORDERS = [range(150), pytest.param(range(150, 1500), marks=pytest.mark.slow)]
"""Seeds of the orders in which frames come."""
TOKENS = (0x1111_1111, 0x2222_2222)
CLAIM, CHARGE = bytes.fromhex("23172001"), bytes.fromhex("4017200100000000")
"""The head of a claim of an axis (2017h:01), and the request for the token in charge."""
NAME = bytes.fromhex("4009100000000000")
"""The request for the hardware version (1009h), which comes in three segments."""
VERSION = b"STM32F103 + STEP/DIR"
REFUSED = 0x80
Step = Generator[bytes, bytes, object]
"""A program's work: it yields requests and gets the answers that are its own."""


class Program:
    """A program on the bus, and what it hears but has not looked at."""

    def __init__(self, work: Step, *, hears_requests: bool) -> None:
        self.requests = OpenRequests()
        self.unread: deque[tuple[bytes, int | None]] = deque()
        self.doubts = 0
        self.strays = 0
        """Number of answers that it took for its own and that were to another request."""
        self.result: object = None
        self.done = False
        self._hears_requests = hears_requests
        self._work = work
        self._asked = next(work)
        self._answer: bytes | None = None
        self._must_ask = True

    def look(self, me: int) -> None:
        """Look at the next frame that it has heard."""
        frame, to = self.unread.popleft()
        if to is None:
            if self._hears_requests:
                self.requests.overhear(frame)
            return
        whose = self.requests.answer(frame)
        if whose is Whose.OWN:
            in_one_frame = frame[0] & 0xE2 == 0x42
            self.strays += to != me and not in_one_frame
            self._answer = frame
        elif whose is Whose.DOUBTFUL:
            self.doubts += 1
            self._must_ask = True

    def request(self) -> bytes | None:
        """Return what it sends now; None if it waits for an answer or has ended."""
        try:
            if self._answer is not None:
                answer, self._answer = self._answer, None
                self._asked = self._work.send(answer)
            elif not self._must_ask or self.requests.awaited:
                return None
        except StopIteration as end:
            self.done, self.result = True, end.value
            return None
        self._must_ask = False
        self.requests.ask(self._asked)
        return self._asked


def run(works: list[Step], chance: random.Random, *, hears_requests: bool = True) -> list[Program]:
    """Let programs work on one bus until all have ended, in a random order."""
    dictionary = ObjectDictionary(0x10)
    Charge(dictionary)
    server = SdoServer(dictionary)
    programs = [Program(work, hears_requests=hears_requests) for work in works]
    outboxes: list[deque[bytes]] = [deque() for _ in programs]
    answers: deque[tuple[bytes, int]] = deque()

    def send(me: int) -> None:
        if not programs[me].done and (request := programs[me].request()) is not None:
            outboxes[me].append(request)

    def carry(me: int) -> None:
        request = outboxes[me].popleft()
        for other, program in enumerate(programs):
            if other != me:
                program.unread.append((request, None))
        answers.extend((answer, me) for answer in server.handle(request))

    def reply() -> None:
        answer, to = answers.popleft()
        for program in programs:
            program.unread.append((answer, to))

    for _ in range(10_000):
        if all(program.done for program in programs):
            return programs
        acts: list[Callable[[], None]] = [partial(send, me) for me in range(len(programs))]
        acts += [partial(carry, me) for me, outbox in enumerate(outboxes) if outbox]
        acts += [partial(program.look, me) for me, program in enumerate(programs) if program.unread]
        chance.choice([*acts, reply] if answers else acts)()
    pytest.fail("a program waits for ever")


def claim(token: int) -> Step:
    """Claim an axis as `Lease` does; return whether it was accepted and whether the token is the own one then."""
    own = token.to_bytes(4, "little")
    accepted = (yield CLAIM + own)[0] != REFUSED
    return accepted, (yield CHARGE)[4:] == own


def read_version() -> Step:
    """Read a string in segments; begin again when the server has dropped the transfer."""
    while True:
        text, toggle, answer = b"", 0, (yield NAME)
        while answer[0] != REFUSED and len(text) < len(VERSION):
            answer = yield bytes((0x60 | toggle,)) + bytes(7)
            text += answer[1 : 8 - (answer[0] >> 1 & 7)]
            toggle ^= 0x10
        if answer[0] != REFUSED:
            return text


@pytest.mark.parametrize("orders", ORDERS, ids=len)
def test_of_two_claims_one_succeeds_in_any_order(orders: range) -> None:
    ended: Counter[object] = Counter()
    doubts = 0
    for seed in orders:
        programs = run([claim(token) for token in TOKENS], random.Random(seed))
        assert [program.strays for program in programs] == [0, 0]
        ended.update([frozenset(program.result for program in programs)])
        doubts += sum(program.doubts for program in programs)
    assert ended == {frozenset({(True, True), (False, False)}): len(orders)}
    assert doubts > len(orders) / 10


@pytest.mark.parametrize("orders", ORDERS, ids=len)
def test_without_the_requests_of_others_answers_are_taken_for_ones_own(orders: range) -> None:
    """This is why programs overhear them: the same orders with deaf programs."""
    deaf = [
        program
        for seed in orders
        for program in run([claim(token) for token in TOKENS], random.Random(seed), hears_requests=False)
    ]
    assert sum(program.strays for program in deaf) > len(orders) / 10


@pytest.mark.parametrize("orders", ORDERS, ids=len)
def test_strings_come_whole(orders: range) -> None:
    for seed in orders:
        programs = run([read_version(), claim(TOKENS[1])], random.Random(seed))
        assert [program.result for program in programs] == [VERSION, (True, True)]


def test_who_hears_the_own_requests_has_no_doubt() -> None:
    """Some interfaces show a program what it sends itself."""
    requests = OpenRequests()
    requests.ask(CLAIM + bytes(4))
    requests.overhear(CLAIM + bytes(4))
    assert requests.answer(b"\x60" + CLAIM[1:] + bytes(4)) is Whose.OWN


def test_a_silent_server_owes_nothing() -> None:
    requests = OpenRequests()
    requests.overhear(CLAIM + bytes(4))
    requests.ask(CLAIM + TOKENS[0].to_bytes(4, "little"))
    assert requests.awaited
    requests.forget()
    assert not requests.awaited


@pytest.mark.parametrize("length", [0, 1, 4, 7])
def test_parts_of_requests_are_none(length: int) -> None:
    requests = OpenRequests()
    requests.overhear(CLAIM[:length])
    requests.ask(CLAIM + bytes(4))
    assert requests.answer(b"\x60" + CLAIM[1:] + bytes(4)) is Whose.OWN
