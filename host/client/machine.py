"""The axes of a robot on the bus: set up, home, run a trajectory, disconnect."""

import io
from collections.abc import Callable, Collection, Sequence
from functools import cache, partial
from itertools import count
from math import ceil
from typing import Final

from canopen.objectdictionary import ObjectDictionary, eds

from steptwin.host.client.axis import AxisClient, AxisSettings, Objects
from steptwin.host.client.axis_homing import AxisHoming, HomingPair, HomingSettings, PairWatch, run_homings
from steptwin.host.client.lease import WATCH_HOST, Heartbeat
from steptwin.host.client.links import Link
from steptwin.host.client.shared_node import Patience
from steptwin.host.client.stream import Stream, StreamedMotion, stop_others
from steptwin.host.client.waiting import POLL_S, REPLY_TIMEOUT_S, require
from steptwin.host.client.waits import HOLD_MS, Waits
from steptwin.host.common.errors import BusError, DeviceFaultError, WaitTimeoutError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, AbortConnection, Control, Mode, Status
from steptwin.protocol.exports import render_eds
from steptwin.protocol.frame import FIRST_NODE_ID
from steptwin.protocol.homing_methods import HOME_HERE
from steptwin.protocol.objects import TPDO_DEFAULTS
from steptwin.protocol.od import IDENTITY_DEVICE_TYPE

_STATUS_PERIOD: Final = od.address_of(od.TPDO_COMMUNICATION[2], od.PDO_EVENT_TIMER)
"""Event timer of TPDO3, which reports a queue's free places."""
_STATUS_PERIOD_MAX_MS: Final = TPDO_DEFAULTS[2].event_timer_ms
"""Longest period of these reports: the default of the event timer."""
_STATUS_PERIOD_MIN_MS: Final = 10
"""Shortest period of these reports: the inhibit time of TPDO3, and the client's polling period."""
_STATUS_PERIOD_SEGMENTS: Final = 20
"""Segments between two reports: three reports arrive before a queue of 64 runs empty."""
_LOOKS_PER_REPORT: Final = 10
"""Polls of a stream per progress report: ten reports per second."""
Progress = Callable[[float], None]
"""Called repeatedly with the finished fraction, 0 to 1."""


@cache
def object_dictionary() -> ObjectDictionary:
    """Return the object dictionary; it is created once, because that takes 40 ms, and nothing changes it."""
    dictionary: ObjectDictionary = eds.import_eds(io.StringIO(render_eds()), FIRST_NODE_ID)  # type: ignore[no-untyped-call]
    return dictionary


class Machine:
    """The axes in the order of their node ids, from FIRST_NODE_ID on, on one or several boards.

    A machine is also a clock: its `wait` keeps a running stream fed.
    """

    def __init__(self, link: Link, names: tuple[str, ...]) -> None:
        self.link = link
        dictionary, patience = object_dictionary(), Patience()
        self.axes: tuple[AxisClient, ...] = tuple(
            AxisClient(link, name, FIRST_NODE_ID + i, dictionary, patience) for i, name in enumerate(names)
        )
        self._heartbeat = Heartbeat(link.network)
        self._status_period_ms = _STATUS_PERIOD_MAX_MS
        self._stream: Stream | None = None
        self._waits: Waits | None = None
        """Waits of the last started trajectory."""

    # --- connect and disconnect

    def connect(self) -> None:
        """Set all nodes to PRE-OPERATIONAL; raise BusError if one is not a stepper axis."""
        self.link.network.nmt.state = "PRE-OPERATIONAL"
        self._check_types()

    def _check_types(self) -> None:
        for axis in self.axes:
            found = axis.read(od.DEVICE_TYPE)
            if found != IDENTITY_DEVICE_TYPE:
                raise BusError(
                    f"{axis.name}: node 0x{axis.node_id:02X} is not a stepper axis: type 0x{found:08X}"
                ).plainly(f"{axis.name}: what answers there is not a stepper axis: is this the right machine?")

    def configure(self, settings: Sequence[AxisSettings]) -> None:
        """Write every axis' settings, make it monitor this host, then set the nodes to OPERATIONAL."""
        for axis, own in zip(self.axes, settings, strict=True):
            for address, value in (*own.objects(), (od.ABORT_CONNECTION_OPTION, AbortConnection.FAULT_SIGNAL)):
                axis.write(address, value)
            axis.write(od.CONSUMER_HEARTBEATS[0], WATCH_HOST)
        self._heartbeat.start()
        self.start_nodes()

    def adopt(self, objects: Sequence[Objects]) -> bool:
        """Connect to boards that may be configured and enabled; write only values that differ.

        The nodes also monitor this host. Return whether a value was written.

        Raises:
            DeviceFaultError: an axis refuses a value; settings of the driver may change only while its power is off.
            BusError: a node does not answer or is not a stepper axis.
        """
        self._check_types()
        self._heartbeat.start()
        for axis in self.axes:
            axis.ensure(od.ABORT_CONNECTION_OPTION, AbortConnection.FAULT_SIGNAL)
            axis.write(od.CONSUMER_HEARTBEATS[0], WATCH_HOST)
        self._heartbeat.beat()  # before any motion, so that even the loss of a host that is killed at once is detected
        own = zip(self.axes, objects, strict=True)
        written = [axis.ensure(*entry) for axis, entries in own for entry in entries]
        return any(written)

    def start_nodes(self) -> None:
        """Set all nodes to OPERATIONAL; nodes that already are continue undisturbed."""
        self.link.network.nmt.state = "OPERATIONAL"

    def enable(self, axes: Collection[int] | None = None) -> None:
        """Enable drives (None for all); their drivers settle at the same time."""
        chosen = [self.axes[i] for i in (range(len(self.axes)) if axes is None else axes)]
        for axis in [axis for axis in chosen if not axis.begin_enabling()]:
            axis.await_enabled()

    def disable(self) -> None:
        """Switch every drive off."""
        for axis in self.axes:
            axis.disable()

    def disconnect(self) -> None:
        """Disconnect; the axes stop monitoring this host, and enabled drives stay enabled."""
        try:
            for axis in self.axes:
                axis.write(od.CONSUMER_HEARTBEATS[0], 0)
        finally:
            self.fall_silent()

    def fall_silent(self) -> None:
        """Stop this host's heartbeat; axes that still monitor it detect the loss of the host."""
        self._heartbeat.stop()

    # --- positions

    def preset(self, positions_units: list[int]) -> None:
        """Set the positions at standstill, by homing method 37 with the position as home offset."""
        for axis, position in zip(self.axes, positions_units, strict=True):
            axis.write(od.HOME_OFFSET, position)
            axis.write(od.HOMING_METHOD, HOME_HERE)
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)  # a run leaves the start bit set: clear it
            axis.write(od.MODE_OF_OPERATION, Mode.HOMING)
            axis.write(od.CONTROLWORD, ENABLE_OPERATION | Control.START)
            require(self.link, partial(_homed, axis), f"{axis.name}: homing was not attained", REPLY_TIMEOUT_S)
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)

    def home_axes(
        self,
        settings: tuple[HomingSettings | None, ...],
        progress: Progress = lambda _: None,
        *,
        together: bool = False,
        sets: Sequence[Sequence[int]] = (),
        pairs: Sequence[HomingPair] = (),
    ) -> None:
        """Home the enabled axes by their switches, one after the other or all together.

        Raises as `axis_homing.run_homings`; after an error no further axis is homed.

        Args:
            settings: settings of each axis; None for an axis that is not homed.
            progress: called with the fraction of the homed axes.
            together: True to home all axes at the same time.
            sets: axes that are always homed at the same time.
            pairs: pairs of axes whose travels must not differ too much.

        Afterwards an axis is at standstill a little beyond its home, whose position is `offset_units`.
        """
        homings = {
            i: AxisHoming(axis, how) for i, (axis, how) in enumerate(zip(self.axes, settings, strict=True)) if how
        }
        first_of = {axis: axes[0] for axes in sets for axis in axes}
        groups: dict[int, list[AxisHoming]] = {}
        for i, homing in homings.items():
            groups.setdefault(0 if together else first_of.get(i, i), []).append(homing)
        homed = count(1)
        for first, group in groups.items():
            watched = [PairWatch(self.axes, pair) for pair in pairs if together or pair.first == first]
            run_homings(self.link, group, lambda: progress(next(homed) / len(homings)), watched)

    def positions_units(self, moved: Collection[int] | None = None) -> list[int]:
        """Return the position actual value (6064h) of each axis, by its step counter.

        Axes of `moved` (None for all) are read by SDO. For the others the last report is used, because they are at
        standstill.
        """
        reports = [None if moved is None or i in moved else axis.drive_status for i, axis in enumerate(self.axes)]
        return [
            axis.read(od.POSITION_ACTUAL) if report is None else report.position_units
            for axis, report in zip(self.axes, reports, strict=True)
        ]

    # --- trajectories

    def run(self, motion: StreamedMotion, progress: Progress, begun: Callable[[], None] = lambda: None) -> None:
        """Start a trajectory and wait for its end; raises as `start` and `Stream.tend`.

        `begun` is called once, when the axes have reported their start.
        """
        stream = self.start(motion)
        begun()
        for look in count(1):
            self.wait(POLL_S)
            if stream.ended or look % _LOOKS_PER_REPORT == 0:
                progress(stream.fraction)
            if stream.ended:
                return

    def start(self, motion: StreamedMotion) -> Stream:
        """Start a trajectory at its first point, where the axes must be at standstill; `wait` feeds it until its end.

        `holds_ms` returns the durations of its waits.

        Raises:
            DeviceFaultError: an axis is at another position, has no position reference, or refuses a record.
            BusError: a node does not answer, or a queue does not fill.
        """
        self._waits = None
        shortest_ms = min(motion.records[0].durations_ms + [HOLD_MS] * bool(motion.waits))
        self._set_status_period(shortest_ms * 100 // motion.highest_percent)
        stream = self._stream = Stream(self.link, self.axes, motion)
        self._waits = stream.waits
        return stream

    def _set_status_period(self, shortest_ms: int) -> None:
        """Set the period in which nodes report their queues' free places, for segments of `shortest_ms`.

        PDO parameters can change only in PRE-OPERATIONAL; the drives keep their state meanwhile.
        """
        period_ms = min(_STATUS_PERIOD_MAX_MS, max(_STATUS_PERIOD_MIN_MS, _STATUS_PERIOD_SEGMENTS * shortest_ms))
        if period_ms == self._status_period_ms:
            return
        self.link.network.nmt.state = "PRE-OPERATIONAL"
        for axis in self.axes:
            axis.write(_STATUS_PERIOD, period_ms)
        self.start_nodes()
        self._status_period_ms = period_ms

    @property
    def holds_ms(self) -> tuple[int, ...]:
        """Duration in ms of each wait that the last trajectory has reached so far."""
        return self._waits.holds_ms if self._waits is not None else ()

    @property
    def waits_for(self) -> str:
        """Description of the present wait of the trajectory; empty while the machine moves."""
        return self._waits.title if self._waits is not None and self._stream is not None else ""

    def now_s(self) -> float:
        """Return the seconds on the link's clock."""
        return self.link.now_s()

    def wait(self, dt_s: float) -> None:
        """Wait, in addition to the time for sending, and feed the stream; raises as `Stream.tend`."""
        looks = max(1, ceil(dt_s / POLL_S))
        for _ in range(looks):
            (self._stream or self.link).wait(dt_s / looks)
            self._tend()

    def drop_trajectory(self) -> None:
        """Abandon a halted trajectory: stop feeding it and close the axes' queues."""
        self._stream = None
        for axis in self.axes:
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)

    def _tend(self) -> None:
        """Feed the stream; forget it when it has ended or failed."""
        stream, self._stream = self._stream, None
        if stream is not None:
            try:
                stream.tend()
            except WaitTimeoutError:  # the machine is at standstill
                raise
            except (BusError, DeviceFaultError):
                stop_others(self.axes)
                raise
            self._stream = None if stream.ended else stream


def _homed(axis: AxisClient) -> bool:
    return bool(axis.read(od.STATUSWORD) & Status.HOMING_ATTAINED)
