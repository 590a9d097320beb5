"""Run a live board: sleep until a socket is ready or the board has work, simulate, pass frames.

One thread does everything. A sleep ends some 50 us late (Linux' timer slack). So the loop polls without sleeping while
a frame is on the simulated bus, because a client waits for the answer.

If the loop wakes too late, the process was delayed and has not read its sockets: the boards' clock then stops for that
time. Simulated time never passes the last check of the sockets, at whatever point of the loop the process is delayed.
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
"""Time for which the loop polls without sleeping on a busy bus: 8 bytes at 1 Mbit/s last up to 135 us."""
_SLEEP_MAX_NS: Final = 1_000_000_000

Callback = Callable[[], None]


class LiveLoop:
    """Runs a live simulation until `stop`; a context manager that closes its sockets."""

    def __init__(
        self,
        live: LiveSimulation,
        clock_ns: Callable[[], int] = time.perf_counter_ns,
        selector: selectors.BaseSelector | None = None,
    ) -> None:
        """Prepare to run a simulation.

        Args:
            live: the simulation.
            clock_ns: wall clock of pacer and timers. Windows' monotonic clock has steps of 15.6 ms before Python 3.13.
            selector: waits until a socket is ready; by default `select`, the only one that sleeps less than 1 ms.
        """
        self.live = live
        self.now_ns = clock_ns
        self.looked_ns: int = 0
        """Instant of the last check of the sockets; frames read since then have this instant."""
        self.hand_on: Callback = lambda: None
        """Called after each slice of simulation, to send waiting frames."""
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

    # --- callbacks

    def watch(self, sock: socket.socket, events: int, callback: Callback) -> None:
        """Call back whenever a socket is ready for one of these events; 0 ends this."""
        watched = sock.fileno() in self._selector.get_map()
        if not events:
            if watched:
                self._selector.unregister(sock)
        elif watched:
            self._selector.modify(sock, events, callback)
        else:
            self._selector.register(sock, events, callback)

    def call_after(self, dt_s: float, callback: Callback) -> None:
        """Call back once after a wall time."""
        heappush(self._timers, (self.now_ns() + round(dt_s * 1e9), next(self._numbers), callback))

    def call_every(self, dt_s: float, callback: Callback) -> None:
        """Call back repeatedly, each time a wall time after the last call."""

        def repeat() -> None:
            callback()
            self.call_after(dt_s, repeat)

        self.call_after(dt_s, repeat)

    def call_soon(self, callback: Callback) -> None:
        """Call back once between two slices of simulation; may be called from any thread."""
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
            if live.pause(self.looked_ns - wake_ns):
                ready = select(0)  # for what arrived while the process was delayed, perhaps after the last `select`
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
        """Return the next known instant when the loop has work."""
        now_ns = self.now_ns()
        wake_ns = min(self.live.wake_ns(now_ns), now_ns + _SLEEP_MAX_NS)
        return min(wake_ns, self._timers[0][0]) if self._timers else wake_ns

    def _sleep_s(self, wake_ns: int) -> float:
        left_ns = wake_ns - self.now_ns()
        if left_ns <= 0 or (left_ns < LOOK_NS and self.live.simulation.bus.busy):
            return 0.0
        return left_ns / 1e9
