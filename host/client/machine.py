"""All axes of a robot on the bus: configure, preset, enable, stream a trajectory, see it through."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from canopen.objectdictionary import eds

from host.client.axis import AxisClient
from host.client.homing import AxisHoming, HomingSettings, home
from host.client.link import Link
from host.client.outputs import OutputCommand, OutputSchedule
from host.client.stream import AxisRecords, AxisStream, fill
from host.errors import BusError, DeviceFaultError
from protocol.cia402 import ENABLE_OPERATION, HOME_HERE, PVT_SUBMODE, Control, ErrorCode, Mode, Status
from protocol.eds import render_eds
from protocol.frame import COB_SYNC, FIRST_NODE_ID
from protocol.objects import IDENTITY_DEVICE_TYPE, TPDO_DEFAULTS
from protocol.pvt import PvtFlag

PRELOAD_RECORDS: Final = 32
_START: Final = ENABLE_OPERATION | Control.START
_STATUS_PERIOD_MAX_MS: Final = TPDO_DEFAULTS[2][2]
"""The event timer with which TPDO3 reports a queue's free places, as after power-up."""
_STATUS_PERIOD_MIN_MS: Final = 10
"""Its inhibit time; the client looks no more often."""
_STATUS_PERIOD_SEGMENTS: Final = 20
"""A queue of 64 then hears of its free places three times before it runs dry."""
_POLL_S: Final = 0.010
_REPLY_TIMEOUT_S: Final = 1.0
_PRELOAD_TIMEOUT_S: Final = 5.0
"""Enough for records to be sent again a few times on a bad line."""

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
    quick_stop_units_per_s2: int

    def objects(self) -> list[tuple[int, int, int]]:
        """As (index, sub-index, value)."""
        return [
            (0x2000, 1, self.microsteps),
            (0x2001, 1, self.steplen_ns),
            (0x2001, 2, self.stepspace_ns),
            (0x2001, 3, self.dirsetup_ns),
            (0x2001, 4, self.dirhold_ns),
            (0x607F, 0, self.velocity_max_units_per_s),
            (0x6085, 0, self.quick_stop_units_per_s2),
        ]


class Machine:
    """The axes in the order of their node ids, from FIRST_NODE_ID on."""

    def __init__(self, link: Link, names: tuple[str, ...]) -> None:
        self._link = link
        dictionary = eds.import_eds(io.StringIO(render_eds()), FIRST_NODE_ID)  # type: ignore[no-untyped-call]
        self.axes = tuple(AxisClient(link, name, FIRST_NODE_ID + i, dictionary) for i, name in enumerate(names))
        self._status_period_ms = _STATUS_PERIOD_MAX_MS

    def connect(self) -> None:
        """Bring all nodes to PRE-OPERATIONAL and see that each is a stepper axis."""
        self._link.network.nmt.state = "PRE-OPERATIONAL"
        for axis in self.axes:
            device_type = axis.read(0x1000)
            if device_type != IDENTITY_DEVICE_TYPE:
                raise BusError(f"{axis.name}: node 0x{axis.node_id:02X} is no stepper axis: type 0x{device_type:08X}")

    def configure(self, settings: tuple[AxisSettings, ...]) -> None:
        """Write every axis' settings, then let the nodes exchange process data."""
        for axis, chosen in zip(self.axes, settings, strict=True):
            for index, subindex, value in chosen.objects():
                axis.write(index, subindex, value)
        self._link.network.nmt.state = "OPERATIONAL"

    def enable(self) -> None:
        """Enable every drive."""
        for axis in self.axes:
            axis.enable()

    def preset(self, positions_units: list[int]) -> None:
        """Declare where the standing machine is: homing method 37 with the position as home offset."""
        for axis, position in zip(self.axes, positions_units, strict=True):
            axis.write(0x607C, 0, position)
            axis.write(0x6098, 0, HOME_HERE)
            axis.write(0x6060, 0, Mode.HOMING)
            axis.write(0x6040, 0, _START)
            self._await(partial(_homed, axis), f"{axis.name}: homing was not attained")
            axis.write(0x6040, 0, ENABLE_OPERATION)

    def home(
        self,
        settings: tuple[HomingSettings | None, ...],
        progress: Progress = lambda _: None,
        *,
        together: bool = False,
    ) -> None:
        """Home the enabled axes by their switches, one after the other or all together; None leaves an axis as it is.

        Afterwards an axis stands a little beyond its home, which has the position `offset_units`. `progress` is told
        which part of the axes is homed. Raises as `host.client.homing.home` does, with the axes after it untouched.
        """
        homings = [AxisHoming(axis, how) for axis, how in zip(self.axes, settings, strict=True) if how]
        homed = 0

        def ended() -> None:
            nonlocal homed
            homed += 1
            progress(homed / len(homings))

        for group in [homings] if together else [[homing] for homing in homings]:
            home(self._link, group, ended)

    def run(
        self,
        records: tuple[AxisRecords, ...],
        start_units: list[int],
        progress: Progress,
        outputs: tuple[OutputCommand, ...] = (),
    ) -> None:
        """Stream a trajectory from its start, which must be where the axes stand, to its end; switch outputs meanwhile.

        Raises:
            DeviceFaultError: an axis stands elsewhere, refuses a record or goes into fault.
            BusError: no answer.
        """
        self._report_status_for(min(records[0].durations_ms))
        self._prepare(start_units)
        streams = [
            AxisStream(axis, stream, self._link.now_s()) for axis, stream in zip(self.axes, records, strict=True)
        ]
        self._preload(streams, min(PRELOAD_RECORDS, len(records[0].durations_ms)))
        self._start_together()
        schedule = OutputSchedule(self.axes, outputs, self._link.now_s())
        self._feed(streams, schedule, progress)
        self._await_end(schedule, sum(records[0].durations_ms) / 1000 + _REPLY_TIMEOUT_S)

    def _report_status_for(self, shortest_ms: int) -> None:
        """Let the nodes report their queues' free places in time for segments that short.

        Nodes take parameters of PDOs in PRE-OPERATIONAL only; their drives stay as they are there.
        """
        period_ms = min(_STATUS_PERIOD_MAX_MS, max(_STATUS_PERIOD_MIN_MS, _STATUS_PERIOD_SEGMENTS * shortest_ms))
        if period_ms == self._status_period_ms:
            return
        self._link.network.nmt.state = "PRE-OPERATIONAL"
        for axis in self.axes:
            axis.write(0x1802, 5, period_ms)
        self._link.network.nmt.state = "OPERATIONAL"
        self._status_period_ms = period_ms

    def _prepare(self, start_units: list[int]) -> None:
        """Clear the queues, and the start bits that an earlier run has left set: the start is their rising edge."""
        for axis, start in zip(self.axes, start_units, strict=True):
            demand = axis.read(0x6062)
            if demand != start:
                raise DeviceFaultError(f"{axis.name}: stands at {demand} units, the trajectory starts at {start}")
            axis.write(0x6040, 0, ENABLE_OPERATION)
            axis.write(0x6060, 0, Mode.INTERPOLATED_POSITION)
            axis.write(0x60C0, 0, PVT_SUBMODE)
            axis.write(0x60C4, 6, 0)
            axis.pvt_status = None

    def _preload(self, streams: list[AxisStream], least: int) -> None:
        def enough() -> bool:
            now_s = self._link.now_s()
            for stream in streams:
                stream.update(now_s)
            fill(streams)
            return all(axis.read(0x60C4, 4) >= least for axis in self.axes)

        self._await(enough, f"the queues do not fill to {least} records", _PRELOAD_TIMEOUT_S)

    def _start_together(self) -> None:
        """Arm every axis' start bit, then one SYNC: all start in the same servo tick."""
        for axis in self.axes:
            axis.send_latched_controlword(_START)
            axis.pvt_status = None  # what was reported before the start says nothing about it
        self._link.network.send_message(COB_SYNC, b"")
        self._await(lambda: all(map(_started, self.axes)), "not all axes start")

    def _feed(self, streams: list[AxisStream], schedule: OutputSchedule, progress: Progress) -> None:
        while not all(stream.all_acknowledged for stream in streams):
            self._link.wait(_POLL_S)
            now_s = self._link.now_s()
            self._check_faults()
            for stream in streams:
                stream.update(now_s)
                stream.check_running()
            fill(streams)
            schedule.tend(now_s)
            progress(min(stream.fraction for stream in streams))

    def _await_end(self, schedule: OutputSchedule, timeout_s: float) -> None:
        """Wait until every queue has run dry at rest; a drive in fault ends the waiting with its error."""

        def ended() -> bool:
            self._check_faults()
            schedule.tend(self._link.now_s())
            return all(map(_ended, self.axes))

        self._await(ended, "the motion does not end", timeout_s)
        self._link.wait(_POLL_S)
        self._check_faults()

    def _check_faults(self) -> None:
        """Raise DeviceFaultError if a drive is in fault, naming the axis with which it began."""
        faulty = [axis for axis in self.axes if axis.in_fault]
        if faulty:
            self._link.wait(_POLL_S)  # let every node say what happened to it
            began = [axis for axis in self.axes if set(axis.error_codes) - {ErrorCode.GROUP_STOPPED}]
            raise DeviceFaultError((began or faulty)[0].fault_text())

    def await_standstill(self, timeout_s: float = 20.0) -> None:
        """Wait until no axis moves any more, whether it is in fault or not."""
        self._await(
            lambda: all(axis.read(0x6041) & Status.TARGET_REACHED for axis in self.axes),
            "the axes do not come to rest",
            timeout_s,
        )

    def positions_units(self) -> list[int]:
        """Where each axis' counter stands (0x6064)."""
        return [axis.read(0x6064) for axis in self.axes]

    def disable(self) -> None:
        """Switch every drive off."""
        for axis in self.axes:
            axis.disable()

    def _await(self, condition: Callable[[], bool], otherwise: str, timeout_s: float = _REPLY_TIMEOUT_S) -> None:
        deadline_s = self._link.now_s() + timeout_s
        while not condition():
            if self._link.now_s() > deadline_s:
                raise BusError(f"{otherwise} within {timeout_s:g} s")
            self._link.wait(_POLL_S)


def _homed(axis: AxisClient) -> bool:
    return bool(axis.read(0x6041) & Status.HOMING_ATTAINED)


def _started(axis: AxisClient) -> bool:
    """Running, or so short that it is done already."""
    return axis.pvt_status is not None and bool(axis.pvt_status.flags & (PvtFlag.RUNNING | PvtFlag.EMPTY))


def _ended(axis: AxisClient) -> bool:
    status = axis.pvt_status
    return status is not None and status.flags & (PvtFlag.RUNNING | PvtFlag.EMPTY) == PvtFlag.EMPTY
