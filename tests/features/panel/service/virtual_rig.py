"""A service on an embedded board, in virtual time: the service's worker and the test take turns, so nothing waits.

The worker runs in its own thread, as always. In each of its waits virtual time passes, and the test goes on until it
lets time pass itself. Never do both run, so that a test sees the same every time, however busy the computer is.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from threading import Semaphore, get_ident
from types import SimpleNamespace
from typing import Final

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.panel.service.guards import Presses, ShownStates, StopRequests
from steptwin.features.panel.service.service import MachineService
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from tests.features.panel.service.rig import HERE, ROBOT, Rig, connection

LONGEST_S: Final = 120.0
"""Virtual time after which what a test waits for has failed to come."""
_TIMED: Final = ("commands", "connected", "results", "service", "snapshots", "telemetry")
"""Modules of the service that look at the clock."""


class Turns:
    """Lets one of two threads run at a time."""

    def __init__(self) -> None:
        self._worker, self._test = Semaphore(0), Semaphore(0)
        self._over = False

    def give(self) -> None:
        """Let the service's thread run until it waits; called by the test."""
        self._worker.release()
        self.await_worker()

    def await_worker(self) -> None:
        """Wait until the service's thread waits."""
        assert self._test.acquire(timeout=60.0), "the service's worker has ended or hangs"

    def take(self) -> None:
        """Wait for the next turn; called by the service's thread."""
        if not self._over:
            self._test.release()
            self._worker.acquire()

    def end(self) -> None:
        """Let the service's thread run on without the test."""
        self._over = True
        self._worker.release()


class VirtualLink:
    """What the service's link is to a bus, on an embedded board."""

    def __init__(self, board: EmbeddedBoard, turns: Turns, _bus: None, _title: str, stops: StopRequests) -> None:
        """Open the link in the service's thread; nothing is done with the bus."""
        self._board = board
        self._turns = turns
        self._stops = stops
        self._worker = get_ident()
        self._send: Callable[[int, bytes, bool], None] = board.network.send_message
        self.network = board.network
        self.held_up_s = 0.0
        self.publish: Callable[[], None] = lambda: None
        board.network.send_message = self._send_message  # type: ignore[method-assign]

    def _send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame as StoppableNetwork does, but without a lock: here the answers come before the sending ends."""
        if get_ident() == self._worker:
            self._stops.check()
        self._send(can_id, data, remote)

    def now_s(self) -> float:
        return self._board.now_s()

    def wait(self, dt_s: float) -> None:
        """Let virtual time pass, then the test go on."""
        self._board.wait(dt_s)
        self.publish()
        self._turns.take()
        self._stops.check()

    def __enter__(self) -> "VirtualLink":
        return self

    def __exit__(self, *_: object) -> None:
        pass


class VirtualRig(Rig):
    """A Rig on an embedded board."""

    def __init__(self, board: EmbeddedBoard, service: MachineService, turns: Turns) -> None:
        super().__init__(board, service)
        self.board = board
        self._turns = turns

    def now_s(self) -> float:
        return self.board.now_s()

    def await_true(self, condition: Callable[[], bool], what: str) -> None:
        until_s = self.now_s() + LONGEST_S
        while not condition():
            assert self.now_s() < until_s, f"not within {LONGEST_S:g} s: {what}"
            self._turns.give()

    def pass_time(self, dt_s: float) -> None:
        until_s = self.now_s() + dt_s
        while self.now_s() < until_s:
            self._turns.give()


@contextmanager
def virtual_rig(kernel: Kernel) -> Iterator[VirtualRig]:
    """Open a service at a board in virtual time while the block runs."""
    board, turns = EmbeddedBoard(ROBOT, kernel, MachineOptions(stand_at=list(HERE))), Turns()
    with pytest.MonkeyPatch.context() as patch:
        clock = SimpleNamespace(monotonic=board.now_s, time=board.now_s)
        for name in _TIMED:
            patch.setattr(import_module(f"steptwin.features.panel.service.{name}"), "time", clock)
        patch.setattr("steptwin.features.panel.service.service.Presses", partial(Presses, now_s=board.now_s))
        patch.setattr("steptwin.features.panel.service.service.ShownStates", partial(ShownStates, board.now_s))
        patch.setattr("steptwin.features.panel.service.service.open_bus", lambda _: None)
        patch.setattr("steptwin.features.panel.service.service.ServiceLink", partial(VirtualLink, board, turns))
        service = MachineService(connection(0), ROBOT)
        service.start()
        turns.await_worker()
        try:
            made = VirtualRig(board, service, turns)
            made.await_true(lambda: service.snapshot.connected, "connected")
            yield made
        finally:
            turns.end()
            service.close()
