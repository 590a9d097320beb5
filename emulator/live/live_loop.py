"""Run a live board: sleep until a socket is ready or the board has work, simulate, hand frames on.

One thread does everything. A sleep ends some 50 us late (Linux' timer slack), so the loop polls without sleeping while
a frame is on the simulated bus, because a client waits for the answer.

When the loop wakes too late, it was held up and has not seen what the sockets received: the boards' clock then stands
for that time. Time never advances beyond the last look at the sockets, wherever in the loop the process is held up.
"""

import selectors
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from heapq import heappop, heappush
from itertools import count
from typing import Final

from steptwin.emulator.live.live_simulation import LiveSimulation

LOOK_NS: Final = 200_000
"""Time for which the loop polls instead of sleeping while the bus is busy: 8 bytes at 1 Mbit/s last 135 us at most."""
_SLEEP_MAX_NS: Final = 1_000_000_000

Callback = Callable[[], None]


class LiveLoop:
    """Runs a live simulation until it is stopped; a context manager that closes its sockets."""

    def __init__(
        self,
        live: LiveSimulation,
        clock_ns: Callable[[], int] = time.perf_counter_ns,
        selector: selectors.BaseSelector | None = None,
    ) -> None:
        """Prepare to run a simulation.

        Args:
            live: the simulation.
            clock_ns: wall clock of pacer and timers; Windows' monotonic one stands for 15.6 ms before Python 3.13.
            selector: sleeps until a socket is ready; by default `select`, the only one that sleeps less than 1 ms.
        """
        self.live = live
        self.now_ns = clock_ns
        self.looked_ns: int = 0
        """Instant of the last look at the sockets; a frame read since then has come in at this instant."""
        self.hand_on: Callback = lambda: None
        """Called after each stretch of simulation, to send waiting frames."""
        self._selector = selector or selectors.SelectSelector()
        self._timers: list[tuple[int, int, Callback]] = []
        self._numbers = count()
        self._soon: deque[Callback] = deque()
        """Callbacks from other threads."""
        self._stopping = False
        self._waker, self._woken = socket.socketpair()
        for end in (self._waker, self._woken):
            end.setblocking(False)
        self.watch(self._woken, selectors.EVENT_READ, self._wake_up)

    def __enter__(self) -> "LiveLoop":
        return self

    def __exit__(self, *_: object) -> None:
        self._selector.close()
        self._waker.close()
        self._woken.close()

    # --- what else happens

    def watch(self, sock: socket.socket, events: int, callback: Callback) -> None:
        """Call back whenever a socket is ready for any of these events; 0 ends the watching."""
        watched = sock.fileno() in self._selector.get_map()
        if not events:
            if watched:
                self._selector.unregister(sock)
        elif watched:
            self._selector.modify(sock, events, callback)
        else:
            self._selector.register(sock, events, callback)

    def call_after(self, dt_s: float, callback: Callback) -> None:
        """Call back once after a duration of wall time."""
        heappush(self._timers, (self.now_ns() + round(dt_s * 1e9), next(self._numbers), callback))

    def call_every(self, dt_s: float, callback: Callback) -> None:
        """Call back repeatedly, each time a duration of wall time after the last call."""

        def again() -> None:
            callback()
            self.call_after(dt_s, again)

        self.call_after(dt_s, again)

    def call_soon(self, callback: Callback) -> None:
        """Call back once between two stretches of simulation; may be called from any thread."""
        self._soon.append(callback)
        self.wake()

    def wake(self) -> None:
        """End a sleep; may be called from any thread and from signal handlers."""
        with suppress(OSError):  # a full buffer wakes the loop anyway; a closed socket belongs to a loop that has ended
            self._waker.send(b"\0")

    def stop(self) -> None:
        """Let `run` return; may be called from any thread and from signal handlers."""
        self._stopping = True
        self.wake()

    def _wake_up(self) -> None:
        self._woken.recv(4096)

    # --- the loop

    def run(self) -> None:
        """Switch the boards on and simulate them until `stop`."""
        live, select = self.live, self._selector.select
        live.start(self.now_ns(), time.time_ns() // 1000)
        while not self._stopping:
            wake_ns = self._wake_ns()
            ready = select(self._sleep_s(wake_ns))
            self.looked_ns = self.now_ns()
            if live.stand(self.looked_ns - wake_ns):
                ready = select(0)  # what came while the process was held up, perhaps after `select` had looked
            for key, _ in ready:
                key.data()
            while self._soon:
                self._soon.popleft()()
            live.advance(self.looked_ns)
            self.hand_on()
            now_ns = self.now_ns()
            live.settle(now_ns)
            while self._timers and self._timers[0][0] <= now_ns:
                heappop(self._timers)[2]()
            live.work(self.now_ns)

    def _wake_ns(self) -> int:
        """Return the instant when the loop next has work, as far as it is known."""
        now_ns = self.now_ns()
        wake_ns = min(self.live.wake_ns(now_ns), now_ns + _SLEEP_MAX_NS)
        return min(wake_ns, self._timers[0][0]) if self._timers else wake_ns

    def _sleep_s(self, wake_ns: int) -> float:
        left_ns = wake_ns - self.now_ns()
        if left_ns <= 0 or (left_ns < LOOK_NS and self.live.simulation.bus.busy):
            return 0.0
        return left_ns / 1e9
