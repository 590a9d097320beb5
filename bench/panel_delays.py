"""Measure how soon the operator's panel stops a machine: the service here, the served board as another process.

A second client of the bus takes the times, so they are those of the bus and not of the service's own snapshots. An axis
reports the end of its motion within 5 ms, the inhibit time of TPDO1.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from statistics import median
from typing import Final

import can
from rich.table import Table

from steptwin.bench import bench_table, panel_page
from steptwin.bench.live_server import Server, silence_python_can
from steptwin.features.panel.service.commands import Command, DeclareHere, Jog, JointJog, ResetFaults, ToolJog
from steptwin.features.panel.service.guards import BEAT_S
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.service import MachineService
from steptwin.host.client.drive_status import DriveStatus, at_rest
from steptwin.host.client.links.bus_link import Connection
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.protocol.frame import COB_SYNC, COB_TPDO, FIRST_NODE_ID

ROBOT: Final = load_robot("lab-scara")
HERE: Final = (150.0, 10.0, 40.0, 20.0)
"""Joint positions from which the tool can go in all directions."""
TIMES: Final = 10
GREY_MAX_MS: Final = 500.0
_HELD_S: Final = 0.6
"""Time for which a button is held once the machine moves."""
_TIMEOUT_S: Final = 20.0
_CLIENT: Final = "bench"
_TPDO1: Final = range(COB_TPDO[0] + FIRST_NODE_ID, COB_TPDO[0] + FIRST_NODE_ID + len(ROBOT.joints))


@dataclass(frozen=True)
class DelayRow:
    """One row: delays in ms of all trials, and the limit that each should keep."""

    what: str
    limit_ms: float
    delays_ms: tuple[float, ...]

    @property
    def median_ms(self) -> float:
        """The median."""
        return median(self.delays_ms)

    @property
    def kept(self) -> int:
        """Number of trials that kept the limit."""
        return sum(delay_ms <= self.limit_ms for delay_ms in self.delays_ms)


class Observer:
    """A client of the bus that only listens."""

    def __init__(self, server: Server) -> None:
        self.sync_s = 0.0
        """When the last SYNC was seen, on the clock of `time.monotonic`."""
        self.rest_s = 0.0
        """When the last axis that moved has reported its rest."""
        self.moving = False
        """True while an axis reports that it moves."""
        self._resting: dict[int, bool] = {}
        self._bus = server.client()
        self._notifier = can.Notifier(self._bus, [self._take], timeout=0.05)

    def _take(self, message: can.Message) -> None:
        now_s, cob_id = time.monotonic(), message.arbitration_id
        if cob_id == COB_SYNC:
            self.sync_s = now_s
        elif cob_id in _TPDO1:
            drive = DriveStatus.decode(bytes(message.data))
            self._resting[cob_id] = at_rest(drive.statusword, drive.mode)
            moving = not all(self._resting.values())
            if self.moving and not moving:
                self.rest_s = now_s
            self.moving = moving

    def close(self) -> None:
        """Leave the bus."""
        self._notifier.stop()
        self._bus.shutdown()


class _Panel:
    """A service on a served board, with its observer."""

    def __init__(self, server: Server) -> None:
        self.observer = Observer(server)
        self.service = _service(server, ROBOT)
        self._press = 0
        _await(lambda: self.service.snapshot.connected)
        self.service.operator.take(_CLIENT, _CLIENT)
        self.do(DeclareHere(HERE))
        _await(lambda: self.service.snapshot.homed)

    def do(self, command: Command) -> None:
        """Ask for a command, as soon as the service takes it, and wait for its end."""
        _await(lambda: self._takes(command))
        self.idle()

    def _takes(self, command: Command) -> bool:
        try:
            self.service.ask(_CLIENT, command, self.service.snapshot.number)
        except RefusedError:  # the newest snapshot is from before a stop or a reset
            return False
        return True

    def idle(self) -> None:
        """Wait until the service has nothing to do."""
        _await(lambda: self.service.snapshot.activity is None and not self.observer.moving)

    def hold(self, jog: Jog) -> tuple[int, float]:
        """Hold a button until the machine has moved for a while; return the press and the time of the last beat.

        A busy computer may be late with a beat; then the button is pressed again.
        """
        self._press += 1
        until_s = time.monotonic() + _TIMEOUT_S
        began_s = None
        while True:
            beat_s = time.monotonic()
            try:
                self.service.beat(_CLIENT, self._press, jog, self.service.snapshot.number)
            except RefusedError:
                self._press += 1
                began_s = None
            time.sleep(BEAT_S)
            if began_s is None and self.observer.moving:
                began_s = time.monotonic()
            if began_s is not None and time.monotonic() - began_s > _HELD_S:
                return self._press, beat_s
            assert time.monotonic() < until_s, "the machine does not move"

    def rest_ms(self, since_s: float) -> float:
        """Wait until the machine rests; return for how long it has moved since a time."""
        _await(lambda: self.observer.rest_s > since_s)
        self.idle()
        return 1000 * (self.observer.rest_s - since_s)

    def released(self, jog: Jog) -> float:
        """Return the time from the release of a button to standstill."""
        press, _ = self.hold(jog)
        released_s = time.monotonic()
        self.service.release(_CLIENT, press)
        return self.rest_ms(released_s)

    def silent(self, jog: Jog) -> float:
        """Return the time from the last beat of a page that is killed or frozen to standstill."""
        _, beat_s = self.hold(jog)
        return self.rest_ms(beat_s)

    def emergency_stop(self, jog: Jog) -> tuple[float, float]:
        """Return the times from the call of an emergency stop to the quick stop on the bus, and to power off."""
        self.hold(jog)
        called_s = time.monotonic()
        self.service.emergency_stop()
        _await(lambda: self.observer.sync_s > called_s)
        stopped_ms = 1000 * (self.observer.sync_s - called_s)
        _await(lambda: all(joint.drive_state == "FAULT" for joint in self.service.snapshot.joints))
        off_ms = 1000 * (time.monotonic() - called_s)
        self.idle()
        self.do(ResetFaults())
        _await(lambda: not self.service.snapshot.emergency_stopped)
        return stopped_ms, off_ms

    def close(self) -> None:
        """Leave the bus."""
        self.service.close()
        self.observer.close()


def _await(condition: Callable[[], bool]) -> None:
    until_s = time.monotonic() + _TIMEOUT_S
    while not condition():
        assert time.monotonic() < until_s, "the machine does not do it"
        time.sleep(0.001)


def _service(server: Server, robot: Robot) -> MachineService:
    service = MachineService(Connection("socketcand", None, None, "127.0.0.1", server.port), robot)
    service.start()
    return service


def measure(times: int = TIMES) -> list[DelayRow]:
    """Return a row for each delay; buttons move to and fro."""
    silence_python_can()
    joint = [JointJog("th2", speed) for speed in (10.0, -10.0)]
    tool = [ToolJog("y", speed) for speed in (-50.0, 50.0)]
    with Server("steptwin", "serve", ROBOT.name, "--port", "0", "--json") as server:
        panel = _Panel(server)
        try:
            trials = [(joint[i % 2], tool[i % 2]) for i in range(times)]
            stops = [panel.emergency_stop(jog) for jog, _ in trials]
            return [
                DelayRow("joint released to standstill", 150.0, tuple(panel.released(jog) for jog, _ in trials)),
                DelayRow("tool released to standstill", 150.0, tuple(panel.released(jog) for _, jog in trials)),
                DelayRow("page silent to standstill", 500.0, tuple(panel.silent(jog) for jog, _ in trials)),
                DelayRow("emergency stop to the quick stop on the bus", 50.0, tuple(bus_ms for bus_ms, _ in stops)),
                DelayRow("emergency stop to power off", 500.0, tuple(off_ms for _, off_ms in stops)),
            ]
        finally:
            panel.close()


def panel_tables() -> Iterator[Table | str]:
    """Measure delays, lateness, load and start, each with the limit that it keeps."""
    delays = measure()
    with_page = find_spec("nicegui") is not None
    if with_page:
        for death, number in panel_page.DEATHS.items():
            delays.append(DelayRow(f"board {death} to a grey page", GREY_MAX_MS, panel_page.measure_grey(number)))
    yield bench_table(
        "The operator's panel: delays, service or page's server and served board as two processes",
        "from, to|median, ms|worst, ms|limit, ms|within|trials",
        (
            f"{row.what}|{row.median_ms:.0f}|{max(row.delays_ms):.0f}|{row.limit_ms:g}|{row.kept}|{len(row.delays_ms)}"
            for row in delays
        ),
    )
    if not with_page:
        yield "the page is not measured: the extra `panel` is not installed"
        return
    yield panel_page.lateness_text()
    yield panel_page.load_text()
    yield from panel_page.start_texts()
