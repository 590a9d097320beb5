"""One trajectory on its way: queues are fed, outputs switched, faults and standstill noticed, until its end."""

from typing import Final

from steptwin.host.client.axis import AxisClient, state_text
from steptwin.host.client.link import Link
from steptwin.host.client.outputs import OutputCommand, OutputSchedule
from steptwin.host.client.stream import AxisStream, fill
from steptwin.host.client.trajectory_time import TrajectoryTime
from steptwin.host.common.errors import BusError, DeviceFaultError
from steptwin.protocol.cia402 import ErrorCode, State

POLL_S: Final = 0.010
"""How often the client looks; the inhibit time of the status reports."""
_STALL_S: Final = 5.0
"""The longest record, 255 ms, takes up to sqrt(2 * 0.255 * 16.3) = 2.9 s at the end of the slowest ramp of a halt."""


class Run:
    """A motion that has been started; `Machine.wait` tends to it, `ended` says when it is over.

    Whoever halts it, it waits for as long as the axes rest: no time limit but that for records which do not go on.
    """

    def __init__(
        self,
        link: Link,
        axes: tuple[AxisClient, ...],
        streams: list[AxisStream],
        durations_ms: list[int],
        outputs: tuple[OutputCommand, ...],
    ) -> None:
        self.ended = False
        self._link = link
        self._axes = axes
        self._streams = streams
        now_s = link.now_s()
        self._reached = TrajectoryTime(durations_ms, now_s)
        self._schedule = OutputSchedule(axes, outputs, self._reached)
        self._seen = axes[0].pvt_status
        self._progress_s = now_s
        self._progress_at_s = 0.0
        """The trajectory time at which there was progress last."""

    @property
    def fraction(self) -> float:
        """The part of the records that has been sent, 0 to 1."""
        return min(stream.fraction for stream in self._streams)

    @property
    def trajectory_s(self) -> float:
        """How far the motion has come at least: the begin of the record that is executed, as last heard."""
        return self._reached.least_s

    @property
    def halted(self) -> bool:
        """Whether the machine rests amid its trajectory, as last heard."""
        return all(axis.halted for axis in self._axes)

    def tend(self) -> None:
        """Do what is due; not to be called later than the queues' reserve allows, nor from a frame's callback.

        Raises:
            DeviceFaultError: an axis is in fault, was stopped, refuses a record or has run out of them.
            BusError: an axis says nothing any more, or does not go on though nothing halts it.
        """
        now_s = self._link.now_s()
        check_faults(self._link, self._axes)
        check_enabled(self._axes)
        for stream in self._streams:
            stream.update(now_s)
            stream.check_running()
        fill(self._streams)
        done = all(stream.all_acknowledged for stream in self._streams) and all(axis.done for axis in self._axes)
        halted = self.halted
        self._follow(now_s, done=done, halted=halted)
        if not halted:
            self._schedule.tend(now_s)
        if done:
            self._link.wait(POLL_S)
            check_faults(self._link, self._axes)
            check_enabled(self._axes)  # a quick stop empties the queues, too
            self.ended = True

    def _follow(self, now_s: float, *, done: bool, halted: bool) -> None:
        status = self._axes[0].pvt_status
        if status is not None and status is not self._seen:
            self._seen = status
            self._reached.report(status.executing, now_s)
        if done:
            self._reached.end()
        if halted or self._reached.least_s != self._progress_at_s:
            self._progress_s = now_s
            self._progress_at_s = self._reached.least_s
        elif now_s - self._progress_s > _STALL_S:
            raise BusError(f"the motion has not gone on for {_STALL_S:g} s at {self._progress_at_s:g} s of its time")


def check_faults(link: Link, axes: tuple[AxisClient, ...]) -> None:
    """Raise DeviceFaultError if a drive is in fault, naming the axis with which it began."""
    faulty = [axis for axis in axes if axis.in_fault]
    if faulty:
        link.wait(POLL_S)  # let every node say what happened to it
        began = [axis for axis in axes if set(axis.error_codes) - {ErrorCode.GROUP_STOPPED}]
        raise DeviceFaultError((began or faulty)[0].fault_text())


def check_enabled(axes: tuple[AxisClient, ...]) -> None:
    """Raise DeviceFaultError if a drive that was enabled is so no more, as last heard: somebody has stopped it."""
    for axis in axes:
        status = axis.drive_status
        if status is not None and status.state is not State.OPERATION_ENABLED:
            raise DeviceFaultError(f"{axis.name}: was stopped, the drive is in {state_text(status.state)}")
