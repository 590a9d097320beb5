"""All axes of a robot on the bus: configure, preset, enable, run a trajectory, halt it and let it go on."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from math import ceil
from typing import Final

from canopen.objectdictionary import ObjectDictionary, eds

from steptwin.host.client.axis import AxisClient
from steptwin.host.client.heartbeat import WATCH_HOST, Heartbeat
from steptwin.host.client.homing import AxisHoming, HomingSettings, home
from steptwin.host.client.link import Link
from steptwin.host.client.outputs import OutputCommand
from steptwin.host.client.run import POLL_S, Run, check_faults
from steptwin.host.client.stream import AxisStream, fill
from steptwin.host.common.axis_records import AxisRecords
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, PVT_SUBMODE, AbortConnection, Control, Mode, Status
from steptwin.protocol.eds import render_eds
from steptwin.protocol.frame import COB_SYNC, FIRST_NODE_ID
from steptwin.protocol.homing_methods import HOME_HERE
from steptwin.protocol.objects import IDENTITY_DEVICE_TYPE, TPDO_DEFAULTS
from steptwin.protocol.pvt import PvtFlag

PRELOAD_RECORDS: Final = 32
_START: Final = ENABLE_OPERATION | Control.START
_STATUS_PERIOD: Final = od.address_of(od.TPDO_COMMUNICATION[2], od.PDO_EVENT_TIMER)
_STATUS_PERIOD_MAX_MS: Final = TPDO_DEFAULTS[2][2]
"""The event timer with which TPDO3 reports a queue's free places, as after power-up."""
_STATUS_PERIOD_MIN_MS: Final = 10
"""Its inhibit time; the client looks no more often."""
_STATUS_PERIOD_SEGMENTS: Final = 20
"""A queue of 64 then hears of its free places three times before it runs dry."""
_REPLY_TIMEOUT_S: Final = 1.0
_PRELOAD_TIMEOUT_S: Final = 5.0
"""Enough for records to be sent again a few times on a bad line."""
_REST_TIMEOUT_S: Final = 20.0
"""A ramp to rest lasts at most as long as a queue of the longest records, 16.3 s."""
_STATUS_TIMEOUT_S: Final = 0.3
"""Three times the event timer with which TPDO1 says how a drive is, in OPERATIONAL."""

Progress = Callable[[float], None]
"""Told from time to time which part of the records has been sent, 0 to 1."""


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """What the client writes into an axis before it moves, in the objects' own units."""

    microsteps: int
    steplen_ns: int
    stepspace_ns: int
    dirsetup_ns: int
    dirhold_ns: int
    velocity_max_units_per_s: int
    deceleration_units_per_s2: int
    """Of a halt, a quick stop and the stop after a fault."""

    def objects(self) -> list[tuple[int, int]]:
        """As (address, value)."""
        return [
            (od.MICROSTEPS, self.microsteps),
            (od.STEPLEN_NS, self.steplen_ns),
            (od.STEPSPACE_NS, self.stepspace_ns),
            (od.DIRSETUP_NS, self.dirsetup_ns),
            (od.DIRHOLD_NS, self.dirhold_ns),
            (od.MAX_PROFILE_VELOCITY, self.velocity_max_units_per_s),
            (od.PROFILE_DECELERATION, self.deceleration_units_per_s2),
            (od.QUICK_STOP_DECELERATION, self.deceleration_units_per_s2),
        ]


class Machine:
    """The axes in the order of their node ids, from FIRST_NODE_ID on, on one board or on several."""

    def __init__(self, link: Link, names: tuple[str, ...]) -> None:
        self._link = link
        dictionary = object_dictionary()
        self.axes = tuple(AxisClient(link, name, FIRST_NODE_ID + i, dictionary) for i, name in enumerate(names))
        self._status_period_ms = _STATUS_PERIOD_MAX_MS
        self._heartbeat = Heartbeat(link.network)
        self._run: Run | None = None

    # --- setting up and leaving

    def connect(self) -> None:
        """Bring all nodes to PRE-OPERATIONAL and see that each is a stepper axis."""
        self._link.network.nmt.state = "PRE-OPERATIONAL"
        self._check_types()

    def _check_types(self) -> None:
        for axis in self.axes:
            device_type = axis.read(od.DEVICE_TYPE)
            if device_type != IDENTITY_DEVICE_TYPE:
                raise BusError(f"{axis.name}: node 0x{axis.node_id:02X} is no stepper axis: type 0x{device_type:08X}")

    def configure(self, settings: tuple[AxisSettings, ...]) -> None:
        """Write every axis' settings, let it watch this host, then let the nodes exchange process data."""
        for axis, chosen in zip(self.axes, settings, strict=True):
            for address, value in chosen.objects():
                axis.write(address, value)
            axis.write(od.ABORT_CONNECTION_OPTION, AbortConnection.FAULT_SIGNAL)
            axis.write(od.CONSUMER_HEARTBEATS[0], WATCH_HOST)
        self._heartbeat.start()
        self._link.network.nmt.state = "OPERATIONAL"

    def adopt(self, objects: tuple[list[tuple[int, int]], ...]) -> None:
        """Take over a board that may be set up and enabled: write what differs, let it watch this host.

        Nodes are brought to OPERATIONAL where one of them is not; none leaves it.

        Args:
            objects: of every axis, as (address, value).

        Raises:
            DeviceFaultError: an axis refuses a value; those of its driver it takes only while its power is off.
            BusError: no answer, or a node that is no stepper axis.
        """
        self._check_types()
        self._heartbeat.start()
        for axis, entries in zip(self.axes, objects, strict=True):
            for address, value in (*entries, (od.ABORT_CONNECTION_OPTION, AbortConnection.FAULT_SIGNAL)):
                axis.ensure(address, value)
            axis.write(od.CONSUMER_HEARTBEATS[0], WATCH_HOST)
        if not all(axis.read(od.STATUSWORD) & Status.REMOTE for axis in self.axes):
            self._link.network.nmt.state = "OPERATIONAL"

    def enable(self) -> None:
        """Enable every drive."""
        for axis in self.axes:
            axis.enable()

    def preset(self, positions_units: list[int]) -> None:
        """Declare where the standing machine is: homing method 37 with the position as home offset."""
        for axis, position in zip(self.axes, positions_units, strict=True):
            axis.write(od.HOME_OFFSET, position)
            axis.write(od.HOMING_METHOD, HOME_HERE)
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)  # homing starts with the bit's rise, and a run leaves it set
            axis.write(od.MODE_OF_OPERATION, Mode.HOMING)
            axis.write(od.CONTROLWORD, _START)
            self._await(partial(_homed, axis), f"{axis.name}: homing was not attained")
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)

    def home(
        self,
        settings: tuple[HomingSettings | None, ...],
        progress: Progress = lambda _: None,
        *,
        together: bool = False,
    ) -> None:
        """Home the enabled axes by their switches, one after the other or all together; None leaves an axis as it is.

        Afterwards an axis stands a little beyond its home, which has the position `offset_units`. `progress` is told
        which part of the axes is homed. Raises as
        `client.homing.home` does, with the axes after it untouched.
        """
        homings = [AxisHoming(axis, how) for axis, how in zip(self.axes, settings, strict=True) if how]
        homed = 0

        def ended() -> None:
            nonlocal homed
            homed += 1
            progress(homed / len(homings))

        for group in [homings] if together else [[homing] for homing in homings]:
            home(self._link, group, ended)

    def disconnect(self) -> None:
        """Take leave, so that the axes do not take this host for lost; enabled drives stay as they are, unwatched."""
        for axis in self.axes:
            axis.write(od.CONSUMER_HEARTBEATS[0], 0)
        self._heartbeat.stop()

    # --- trajectories

    def run(
        self,
        records: tuple[AxisRecords, ...],
        start_units: list[int],
        progress: Progress,
        outputs: tuple[OutputCommand, ...] = (),
    ) -> None:
        """Start a trajectory and wait for its end; raises as `start` and `Run.tend` do."""
        run = self.start(records, start_units, outputs)
        while not run.ended:
            self.wait(POLL_S)
            progress(run.fraction)

    def start(
        self, records: tuple[AxisRecords, ...], start_units: list[int], outputs: tuple[OutputCommand, ...] = ()
    ) -> Run:
        """Start a trajectory from its first point, which must be where the axes stand.

        It needs to be tended until it has ended, as `wait` does it.

        Args:
            records: of every axis, with the same durations.
            start_units: the first point.
            outputs: what to switch on the way.

        Raises:
            DeviceFaultError: an axis stands elsewhere, does not know where, or refuses a record.
            BusError: no answer.
        """
        durations_ms = records[0].durations_ms
        self._report_status_for(min(durations_ms))
        self._prepare(start_units)
        streams = [
            AxisStream(axis, stream, self._link.now_s()) for axis, stream in zip(self.axes, records, strict=True)
        ]
        self._preload(streams, min(PRELOAD_RECORDS, len(durations_ms)))
        self._start_together()
        self._run = Run(self._link, self.axes, streams, durations_ms, outputs)
        return self._run

    def wait(self, dt_s: float) -> None:
        """Let so much time pass, and what sending takes, and tend to the trajectory that runs; raises as `Run.tend`."""
        looks = max(1, ceil(dt_s / POLL_S))
        for _ in range(looks):
            self._link.wait(dt_s / looks)
            self._tend()

    def _tend(self) -> None:
        run, self._run = self._run, None
        if run is not None:
            run.tend()
            self._run = None if run.ended else run

    def _report_status_for(self, shortest_ms: int) -> None:
        """Let the nodes report their queues' free places in time for segments that short.

        Nodes take parameters of PDOs in PRE-OPERATIONAL only; their drives stay as they are there.
        """
        period_ms = min(_STATUS_PERIOD_MAX_MS, max(_STATUS_PERIOD_MIN_MS, _STATUS_PERIOD_SEGMENTS * shortest_ms))
        if period_ms == self._status_period_ms:
            return
        self._link.network.nmt.state = "PRE-OPERATIONAL"
        for axis in self.axes:
            axis.write(_STATUS_PERIOD, period_ms)
        self._link.network.nmt.state = "OPERATIONAL"
        self._status_period_ms = period_ms

    def _prepare(self, start_units: list[int]) -> None:
        """Clear the queues, and the start bits that an earlier run has left set: the start is their rising edge."""
        for axis in self.axes:
            if not axis.read(od.STATUSWORD) & Status.POSITION_KNOWN:
                raise DeviceFaultError(f"{axis.name}: does not know where it is: it must be homed first")
        for axis, start in zip(self.axes, start_units, strict=True):
            demand = axis.read(od.POSITION_DEMAND)
            if demand != start:
                raise DeviceFaultError(f"{axis.name}: stands at {demand} units, the trajectory starts at {start}")
            axis.write(od.CONTROLWORD, ENABLE_OPERATION)
            axis.write(od.MODE_OF_OPERATION, Mode.INTERPOLATED_POSITION)
            axis.write(od.INTERPOLATION_SUBMODE, PVT_SUBMODE)
            axis.write(od.BUFFER_CLEAR, 0)
            axis.pvt_status = None

    def _preload(self, streams: list[AxisStream], least: int) -> None:
        def enough() -> bool:
            now_s = self._link.now_s()
            for stream in streams:
                stream.update(now_s)
            fill(streams)
            return all(axis.read(od.BUFFER_POSITION) >= least for axis in self.axes)

        self._await(enough, f"the queues do not fill to {least} records", _PRELOAD_TIMEOUT_S)

    def _start_together(self) -> None:
        """Arm every axis' start bit, then one SYNC: all start in the same servo tick."""
        for axis in self.axes:
            axis.send_latched_controlword(_START)
            axis.pvt_status = None  # what was reported before the start says nothing about it
        self._link.network.send_message(COB_SYNC, b"")
        self._await(lambda: all(map(_started, self.axes)), "not all axes start")

    # --- halt and resume

    def pause(self) -> bool:
        """Halt the trajectory that runs, on its path, and wait until all axes rest.

        It may be another host's, which goes on feeding it: nothing but process data is sent, so that no SDO of that
        host is disturbed. Pausing what is halted already changes nothing.

        Returns:
            Whether the machine is halted; False if the trajectory came to its end first.

        Raises:
            InputError: no axis runs a trajectory.
            BusError: the axes do not come to rest.
            DeviceFaultError: a fault has ended the trajectory meanwhile.
        """
        running = self._interpolating("pause")
        for axis in running:
            axis.send_interpolation_controlword(_START | Control.HALT)
        self._await(
            lambda: all(axis.halted or not axis.interpolating for axis in running),
            "the axes do not come to rest",
            _REST_TIMEOUT_S,
        )
        check_faults(self._link, self.axes)
        if any(axis.halted for axis in running):
            return True
        for axis in running:
            axis.send_interpolation_controlword(_START)
        return False

    def resume(self) -> None:
        """Let a halted trajectory go on, whoever has halted it; one that is not halted goes on as it does.

        Raises:
            InputError: no axis runs a trajectory.
            BusError: the axes do not set off.
            DeviceFaultError: a fault has ended the trajectory meanwhile.
        """
        running = self._interpolating("resume")
        for axis in running:
            axis.send_interpolation_controlword(_START)
        self._await(lambda: not any(axis.halted for axis in running), "the axes do not go on")
        check_faults(self._link, self.axes)

    def _interpolating(self, what: str) -> list[AxisClient]:
        """The axes that execute records; nodes that are not OPERATIONAL do not say so, and do none."""
        deadline_s = self._link.now_s() + _STATUS_TIMEOUT_S
        while self._link.now_s() < deadline_s and any(axis.drive_status is None for axis in self.axes):
            self.wait(POLL_S)
        running = [axis for axis in self.axes if axis.interpolating]
        if not running:
            raise InputError(f"nothing to {what}: no axis runs a trajectory")
        return running

    # --- the axes

    def await_standstill(self, timeout_s: float = _REST_TIMEOUT_S) -> None:
        """Wait until no axis moves any more, whether it is in fault or not."""
        self._await(
            lambda: all(axis.read(od.STATUSWORD) & Status.TARGET_REACHED for axis in self.axes),
            "the axes do not come to rest",
            timeout_s,
        )

    def positions_units(self) -> list[int]:
        """Where each axis' counter stands (0x6064)."""
        return [axis.read(od.POSITION_ACTUAL) for axis in self.axes]

    def disable(self) -> None:
        """Switch every drive off."""
        for axis in self.axes:
            axis.disable()

    def _await(self, condition: Callable[[], bool], otherwise: str, timeout_s: float = _REPLY_TIMEOUT_S) -> None:
        deadline_s = self._link.now_s() + timeout_s
        while not condition():
            if self._link.now_s() > deadline_s:
                raise BusError(f"{otherwise} within {timeout_s:g} s")
            self.wait(POLL_S)


@cache
def object_dictionary() -> ObjectDictionary:
    """The objects of every node as the canopen library wants them; nothing writes to it, and to make it takes 40 ms."""
    dictionary: ObjectDictionary = eds.import_eds(io.StringIO(render_eds()), FIRST_NODE_ID)  # type: ignore[no-untyped-call]
    return dictionary


def _homed(axis: AxisClient) -> bool:
    return bool(axis.read(od.STATUSWORD) & Status.HOMING_ATTAINED)


def _started(axis: AxisClient) -> bool:
    """Running, or so short that it is done already."""
    running = axis.pvt_status is not None and bool(axis.pvt_status.flags & PvtFlag.RUNNING)
    return axis.done or (running and axis.interpolating)
